// One client of the control socket as the server sees it: its lines that wait, its answers that it
// has not read yet, and in which of its two halves it has ended.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "daemon/control/line_buffer.h"

namespace focalfleet {

struct ServerClient {
  int fd = -1;
  bool reserved = false;     // its place is one of the reserved ones
  std::uint64_t active = 0;  // the server's count when it was last accepted, heard or answered
  LineBuffer input;
  std::string output;
  std::size_t written = 0;    // of output
  std::uint32_t open = 0;     // lines handed out and not yet answered
  std::uint32_t watched = 0;  // epoll events
  bool input_ended = false;   // it will ask nothing more
  bool closing = false;       // only its output is still of interest
  bool deaf = false;          // it closed: what it asked still counts, answers do not

  /// Units: bytes of output that the client has not read yet.
  [[nodiscard]] std::size_t waiting() const { return output.size() - written; }
  /// Whether the client's lines are taken: at most `bytes_pause` of its answers wait.
  [[nodiscard]] bool Listens(std::size_t bytes_pause) const {
    return !closing && waiting() <= bytes_pause;
  }
  [[nodiscard]] bool Ready(std::size_t bytes_pause) const {
    return input.has_line() && Listens(bytes_pause);
  }
  /// Whether the client may lose its place: no request of it is open, and nothing that it sent
  /// waits, unless it does not read its answers.
  [[nodiscard]] bool Idle(std::size_t bytes_pause) const;

  /// Reads one chunk, so that one busy client does not keep the others waiting. False: the client
  /// is gone.
  bool Read();
  /// Writes as much as goes without waiting. False: the client is gone.
  bool Write();
  /// False: the next line is longer than `bytes_max`. The client receives an error, and nothing
  /// more of its input is taken.
  bool CheckLength(std::size_t bytes_max);
};

/// Reports in one line why the server closes this connection, if that goes without waiting.
void ReportAndClose(int fd, const std::string& why);

}  // namespace focalfleet
