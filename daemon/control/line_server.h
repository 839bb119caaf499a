// The server's end of a control socket: lines come in, lines go out, and the server never waits for
// a client. control/listening_socket.h makes the socket file.
//
// The length of a line, the number of clients and the unread output of a client are bounded.
// Clients take turns. No line of a client is taken while much of its earlier answers is unread, or
// limits::kControlRequestsOpen of its lines are not answered, so a client that asks without reading
// or waiting stops itself. All descriptors are in one inner epoll, so that
// an event loop watches a single one.
//
// A line may be urgent (`Options::urgent`). Such a line is handed out before all others, even from
// behind other lines of its own client: up to ahead_bytes are read of lines that wait. No other
// client can keep an urgent line out:
//   - Where all places are taken, a newcomer gets the place of the client that was idle longest.
//   - Where none is idle, a newcomer gets a reserved place, where only urgent lines are handled.
//   - Each reserved place keeps a descriptor of its own, for when the process has none left.
//
// A newcomer without a role (`Options::role_of`) is refused before it gets a place.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/control/line_exchange.h"
#include "daemon/control/messages.h"
#include "protocol/base/limits.h"
#include "protocol/base/result.h"

namespace focalfleet {

class LineServer final : public LineExchange {
 public:
  struct Options {
    std::size_t line_bytes_max = limits::kControlLineBytes;
    /// The limit of a client by its role, in place of line_bytes_max.
    std::function<std::size_t(Role)> line_bytes_max_of = {};
    std::size_t output_bytes_max = std::size_t{64}
                                   << 20;  // more than this waits: the client is dropped
    std::size_t output_bytes_pause = std::size_t{1}
                                     << 20;  // more than this waits: no further line is taken
    std::size_t progress_bytes_max = std::size_t{64}
                                     << 10;  // more than this waits: progress is skipped
    std::size_t clients_max = limits::kControlClients;
    /// Whether a line goes before all others. The function sees each complete line, so it must be
    /// quick. Without it nothing is urgent, and no place is reserved.
    std::function<bool(std::string_view)> urgent = {};
    std::size_t reserved_max = limits::kControlClientsReserved;
    /// Bytes that are read of each client beyond its next line, to find urgent lines; they hold
    /// 1600 short requests. With half of it, a stop behind more than 800 requests waits for some
    /// answers. Twice as much costs twice the memory, 4 MiB for all clients.
    std::size_t ahead_bytes = std::size_t{64} << 10;
    /// The role of a newcomer. Without this function everybody may do everything.
    std::function<Role(const std::optional<Peer>&)> role_of = {};
    /// Receives each newcomer that was refused for want of a role.
    std::function<void(const Caller&)> turned_away = {};
    /// The rights of the socket's file: owner and group by default.
    std::uint32_t file_mode = 0660;
    /// The pause in accepting after an accept that found no descriptor at all.
    std::chrono::milliseconds accept_pause{1000};
  };

  /// The server listens at `path`. Errors: kRefused where a live server answers there; kUnavailable
  /// where the path is no socket, too long or not writable; both name it.
  static Result<LineServer> Create(const std::string& path, const Options& options);
  static Result<LineServer> Create(const std::string& path) { return Create(path, Options{}); }

  LineServer(LineServer&&) noexcept;
  LineServer& operator=(LineServer&&) noexcept;
  /// Removes the socket file, if it still is the one of this server.
  ~LineServer() override;

  /// Readable whenever Service has something to do.
  [[nodiscard]] int fd() const override;

  /// Accepts, reads and writes as much as goes without waiting. Urgent lines are appended, at most
  /// one of each client.
  void Service(std::vector<IncomingLine>* urgent) override;
  /// The next line; clients take turns. None: no line waits, or its client does not read answers.
  std::optional<IncomingLine> Next() override;

  /// Queues the last answer to a line of this client. False: the client is gone (that is no fault).
  bool Answer(ClientId client, std::string_view line) override;
  /// Queues a line before the last answer; skipped where the client does not read. False: the
  /// client is gone.
  bool Progress(ClientId client, std::string_view line) override;

  [[nodiscard]] bool connected(ClientId client) const override;
  [[nodiscard]] std::size_t clients() const;
  [[nodiscard]] const std::string& path() const;

 private:
  class Impl;
  explicit LineServer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace focalfleet
