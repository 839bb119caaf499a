// Turns of a line server, taken one by one, so that a test waits for nothing.
#pragma once

#include <poll.h>

#include <string_view>
#include <utility>
#include <vector>

#include "daemon/control/line_server.h"

namespace focalfleet::test {

inline bool Readable(int fd) {
  pollfd poller{fd, POLLIN, 0};
  return ::poll(&poller, 1, 0) == 1;
}

/// Does a turn: urgent lines, then a line of each client that has one.
inline void Turn(LineServer* server, std::vector<IncomingLine>* lines) {
  server->Service(lines);
  for (std::size_t left = server->clients(); left > 0; --left)
    if (auto line = server->Next()) lines->push_back(std::move(*line));
}

/// All lines that the server hands out until it has nothing more to do.
inline std::vector<IncomingLine> Drain(LineServer* server) {
  std::vector<IncomingLine> lines;
  for (int i = 0; i < 100'000 && Readable(server->fd()); ++i) Turn(server, &lines);
  return lines;
}

/// Lets the server read and write what there is, and takes no line that is not urgent.
inline std::vector<IncomingLine> OnlyUrgent(LineServer* server) {
  std::vector<IncomingLine> lines;
  for (int i = 0; i < 100; ++i) server->Service(&lines);
  return lines;
}

inline bool IsStop(std::string_view line) { return line.starts_with("stop"); }

}  // namespace focalfleet::test
