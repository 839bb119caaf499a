// The program focalfleet-can-opener: opens CAN sockets in the network namespace in which it runs,
// for the daemon in another one (socket_opener.h). systemd gives it its listening socket.
#include <signal.h>
#include <unistd.h>

#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "daemon/ports/socket_opener.h"

namespace {

std::atomic<bool> ending{false};

void End(int /*signal*/) { ending = true; }

/// The descriptor that systemd has passed; -1: none.
int PassedSocket() {
  const char* const pid = std::getenv("LISTEN_PID");
  const char* const count = std::getenv("LISTEN_FDS");
  constexpr int kFirst = 3;
  const bool passed = pid != nullptr && count != nullptr && std::string(count) == "1" &&
                      std::string(pid) == std::to_string(::getpid());
  return passed ? kFirst : -1;
}

}  // namespace

int main(int argc, char** /*argv*/) {
  const int listener = PassedSocket();
  if (argc != 1 || listener < 0) {
    std::fputs(
        "focalfleet-can-opener: systemd starts it, with a listening socket "
        "(focalfleet-can-opener.socket); it takes no arguments\n",
        stderr);
    return 2;
  }
  struct sigaction action {};
  action.sa_handler = End;
  ::sigaction(SIGTERM, &action, nullptr);
  ::sigaction(SIGINT, &action, nullptr);
  const auto served = focalfleet::ServeOpener(listener, ending);
  if (served) return 0;
  std::fprintf(stderr, "focalfleet-can-opener: %s\n", served.error().text.c_str());
  return 1;
}
