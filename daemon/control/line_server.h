// The listening end of a control socket: lines in, lines out, never waiting for anybody.
//
// Owner and group may connect (mode 0660). A socket file that a live server answers on is refused
// as in use; one that nobody answers on is left from a crash and replaced. The new socket listens
// under a temporary name and is renamed into place, so that nobody ever finds a file that does not
// answer.
//
// Bounds: a line, the number of clients, and what may wait to be read by a client. One line of each
// client is handed out a call, and none while much of the earlier answers waits: a client that asks
// without reading stops itself. All descriptors sit in one inner epoll, so that an event loop
// watches a single one.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/control/messages.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// Never given twice by one server, so an answer cannot reach another client than the one that
/// asked.
using ClientId = std::uint64_t;

struct IncomingLine {
  ClientId client = 0;
  std::string text;  // without its newline
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
    std::size_t clients_max = 64;
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

  /// Accepts, reads, writes what goes without waiting, and appends at most one line of each client.
  void Service(std::vector<IncomingLine>* lines);

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
