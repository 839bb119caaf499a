// The listening end of a control socket: lines in, lines out, never waiting for anybody.
//
// Owner and group may connect (mode 0660). A socket file that a live server answers on is refused
// as in use; one that nobody answers on is left from a crash and replaced. The new socket listens
// under a temporary name and is renamed into place, so that nobody ever finds a file that does not
// answer.
//
// Bounds: a line, the number of clients, and what may wait to be read by a client. Clients take
// turns, and none of their lines is taken while much of the earlier answers waits: a client that
// asks without reading stops itself. All descriptors sit in one inner epoll, so that an event loop
// watches a single one.
//
// A line may be urgent (`Options::urgent`). Then it is handed out before all others, from behind
// other lines of its own client, too: up to ahead_bytes are read of what nobody has taken yet.
// Nobody can keep such a line out:
//   - Where all places are taken, a newcomer gets the place of the client that was idle longest.
//   - Where none is idle, it gets one of the reserved places, and says what is urgent, or waits.
//   - Each reserved place keeps a descriptor of its own, for when the process has none left.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/control/messages.h"
#include "protocol/base/limits.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// Never given twice by one server, so an answer cannot reach another client than the one that
/// asked.
using ClientId = std::uint64_t;

struct IncomingLine {
  ClientId client = 0;
  std::string text;        // without its newline
  bool overtaken = false;  // an urgent line that came later was handed out before it
  bool reserved = false;  // of a client in a reserved place, where only urgent lines are to be done
};

class LineServer {
 public:
  struct Options {
    std::size_t line_bytes_max = kControlLineBytesMax;
    std::size_t output_bytes_max = std::size_t{64}
                                   << 20;  // more than this waits: the client is dropped
    std::size_t output_bytes_pause = std::size_t{1}
                                     << 20;  // more than this waits: no further line is taken
    std::size_t progress_bytes_max = std::size_t{64}
                                     << 10;  // more than this waits: progress is skipped
    std::size_t clients_max = limits::kControlClients;
    /// Which lines go before all others; asked about each complete line, so it must be quick. None:
    /// nothing is urgent, and no place is reserved.
    std::function<bool(std::string_view)> urgent = {};
    std::size_t reserved_max = limits::kControlClientsReserved;
    /// Read of each client beyond the line that is next, to find what is urgent: 1600 short
    /// requests. With half of it a stop behind 800 of them waits for some answers; twice as much
    /// costs twice the memory, 4 MiB for all clients.
    std::size_t ahead_bytes = std::size_t{64} << 10;
    /// After an accept that found no descriptor at all, nobody is accepted for so long.
    std::chrono::milliseconds accept_pause{1000};
  };

  /// Errors: kRefused where a live server answers at `path`; kUnavailable where the path is no
  /// socket, too long or not writable; both name it.
  static Result<LineServer> Create(const std::string& path, const Options& options);
  static Result<LineServer> Create(const std::string& path) { return Create(path, Options{}); }

  LineServer(LineServer&&) noexcept;
  LineServer& operator=(LineServer&&) noexcept;
  /// Removes the socket file, if it still is ours.
  ~LineServer();

  /// Readable whenever Service has something to do.
  [[nodiscard]] int fd() const;

  /// Accepts, reads, writes what goes without waiting, and appends what is urgent: at most one line
  /// of each client.
  void Service(std::vector<IncomingLine>* urgent);
  /// Another line; clients take turns. None: nothing is there, or nobody reads his answers.
  std::optional<IncomingLine> Next();

  /// Queues the last answer to a line of this client. False: the client is gone (that is no fault).
  bool Answer(ClientId client, std::string_view line);
  /// Queues something before the last answer; skipped where the client does not read. False: gone.
  bool Progress(ClientId client, std::string_view line);

  [[nodiscard]] bool connected(ClientId client) const;
  [[nodiscard]] std::size_t clients() const;
  [[nodiscard]] const std::string& path() const;

 private:
  class Impl;
  explicit LineServer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace focalfleet
