// LineExchange is what the request handler needs of a server of lines: lines come in, answers go
// out, and nothing waits. LineServer does so over a socket; a simulation over queues.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/access/caller.h"
#include "protocol/base/limits.h"

namespace focalfleet {

/// A server never gives an id twice, so an answer cannot reach another client than the one that
/// asked.
using ClientId = std::uint64_t;

/// Open requests of all clients that there can be. More are of clients that came, asked and went.
inline constexpr std::size_t kOpenRequestsMax =
    (limits::kControlClients + limits::kControlClientsReserved) *
    std::size_t{limits::kControlRequestsOpen};

struct IncomingLine {
  ClientId client = 0;
  std::string text;        // without its newline
  bool overtaken = false;  // an urgent line that came later was handed out before it
  bool reserved = false;   // its client has a reserved place: only urgent lines are to be handled
  Caller caller = {};      // user and role of the client's process when it connected
};

class LineExchange {
 public:
  virtual ~LineExchange() = default;

  /// Readable whenever Service has something to do; -1: there is no descriptor.
  [[nodiscard]] virtual int fd() const = 0;
  /// Accepts, reads and writes as much as goes without waiting. Urgent lines are appended.
  virtual void Service(std::vector<IncomingLine>* urgent) = 0;
  virtual std::optional<IncomingLine> Next() = 0;
  [[nodiscard]] virtual bool connected(ClientId client) const = 0;
  /// Queues the last answer to a line of this client. False: the client is gone.
  virtual bool Answer(ClientId client, std::string_view line) = 0;
  /// Queues a line before the last answer. False: the client is gone.
  virtual bool Progress(ClientId client, std::string_view line) = 0;

 protected:
  LineExchange() = default;
  LineExchange(const LineExchange&) = default;
  LineExchange(LineExchange&&) = default;
  LineExchange& operator=(const LineExchange&) = default;
  LineExchange& operator=(LineExchange&&) = default;
};

}  // namespace focalfleet
