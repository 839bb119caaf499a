// A client of the control socket as the server sees it: its waiting lines, the answers that it has
// not read yet, and whether it still sends and reads.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "daemon/access/caller.h"
#include "daemon/control/line_buffer.h"
#include "protocol/base/limits.h"
#include "protocol/base/result.h"

namespace focalfleet {

struct ServerClient {
  int fd = -1;
  bool reserved = false;     // its place is one of the reserved ones
  Caller caller = {};        // user and role of its process
  std::uint64_t active = 0;  // the server's count when it was last accepted, heard or answered
  LineBuffer input;
  std::string output;
  std::size_t written = 0;    // bytes of output
  std::uint32_t open = 0;     // lines handed out and not yet answered
  std::uint32_t watched = 0;  // epoll events
  bool input_ended = false;   // it will ask nothing more
  bool closing = false;       // only its output is still of interest
  bool deaf = false;          // it closed: its requests still count, answers do not

  /// Units: bytes of output that the client has not read yet.
  [[nodiscard]] std::size_t waiting() const { return output.size() - written; }
  /// Whether the client reads its answers: at most `bytes_pause` of them wait.
  [[nodiscard]] bool Listens(std::size_t bytes_pause) const {
    return !closing && waiting() <= bytes_pause;
  }
  /// Whether a line of the client is taken now. Lines beyond limits::kControlRequestsOpen wait
  /// until one is answered. A client that closed does not keep its place until then: all that it
  /// has sent is taken.
  [[nodiscard]] bool Ready(std::size_t bytes_pause) const {
    return input.has_line() && Listens(bytes_pause) &&
           (open < limits::kControlRequestsOpen || deaf);
  }
  /// Whether the client may lose its place: no request of it is open, and nothing that it sent
  /// waits, unless it does not read its answers.
  [[nodiscard]] bool Idle(std::size_t bytes_pause) const;

  /// A chunk is read, no more, so that one busy client does not keep the others waiting. False: the
  /// client is gone.
  bool Read();
  /// Output is written, as much as goes without waiting. False: the client is gone.
  bool Write();
  /// False: the next line is longer than `bytes_max`. The client receives an error, and nothing
  /// more of its input is taken.
  bool CheckLength(std::size_t bytes_max);
};

/// The connection is closed; before, its client receives `why` in one line, if that goes without
/// waiting.
void ReportAndClose(int fd, ErrorCode code, const std::string& why);

}  // namespace focalfleet
