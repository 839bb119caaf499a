// The watcher reads the status of units as a monitor does, until its stdin ends. Each second it
// prints how many units it knows, how many samples have come, the longest time without any in ms,
// and how many values of units were missed. A publisher that counts its cycles in `at` shows the
// latter: each cycle is one value of each unit, and a value that comes twice counts once.
//   watcher DOMAIN [CREDENTIALS]
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <map>

#include "daemon/dds/status_reader.h"

namespace focalfleet {
namespace {

using Clock = std::chrono::steady_clock;

int Main(int argc, char** argv) {
  if (argc != 2 && argc != 3) return 2;
  StatusReader::Options options;
  options.dds.domain = static_cast<std::uint32_t>(std::atoi(argv[1]));
  if (argc == 3) options.dds.security = argv[2];
  auto reader = StatusReader::Create(options);
  if (!reader) {
    std::printf("%s\n", reader.error().text.c_str());
    return 1;
  }
  std::map<std::uint32_t, std::int64_t> cycle_of;  // the newest of each unit
  std::uint64_t samples = 0;
  std::int64_t missed = 0;
  std::chrono::milliseconds longest{0};
  auto last = Clock::now();
  auto said = last;
  StatusUpdate update;
  pollfd input{.fd = STDIN_FILENO, .events = POLLIN, .revents = 0};
  while (::poll(&input, 1, 0) == 0) {
    if (!(*reader)->Wait(std::chrono::milliseconds(50)) || !(*reader)->Take(&update)) return 1;
    const auto now = Clock::now();
    if (!update.units.empty()) {
      if (samples > 0)
        longest =
            std::max(longest, std::chrono::duration_cast<std::chrono::milliseconds>(now - last));
      last = now;
    }
    for (const auto& unit : update.units) {
      const auto [known, is_new] = cycle_of.emplace(unit.unit.value, unit.at.ns);
      if (is_new || unit.at.ns <= known->second) continue;
      missed += unit.at.ns - known->second - 1;
      known->second = unit.at.ns;
    }
    samples += update.units.size();
    if (now - said < std::chrono::seconds(1)) continue;
    said = now;
    std::printf("%zu %lu %ld %ld\n", cycle_of.size(), samples, longest.count(), missed);
    std::fflush(stdout);
  }
  return 0;
}

}  // namespace
}  // namespace focalfleet

int main(int argc, char** argv) { return focalfleet::Main(argc, argv); }
