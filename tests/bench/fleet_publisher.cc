// This program does bare_publisher's task through StatusPublisher:
//   fleet_publisher DOMAIN UNITS CYCLES HZ [CREDENTIALS]
#include <sys/resource.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <thread>
#include <vector>

#include "daemon/dds/status_publisher.h"

namespace focalfleet {
namespace {

double CpuSeconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) +
         1e-6 * static_cast<double>(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec);
}

int Main(int argc, char** argv) {
  if (argc != 5 && argc != 6) return 2;
  const int cycles = std::atoi(argv[3]);
  const std::chrono::nanoseconds period(1'000'000'000 / std::atoi(argv[4]));
  auto publisher =
      StatusPublisher::Create({.domain = static_cast<std::uint32_t>(std::atoi(argv[1])),
                               .config_xml = {},
                               .security = argc == 6 ? argv[5] : ""});
  if (!publisher) {
    std::fprintf(stderr, "%s\n", publisher.error().text.c_str());
    return 1;
  }
  while ((*publisher)->unit_readers() == 0)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));

  std::vector<UnitStatusValue> units(static_cast<std::size_t>(std::atoi(argv[2])));
  for (std::size_t i = 0; i < units.size(); ++i) {
    units[i].unit = {static_cast<std::uint32_t>(i + 1)};
    units[i].at = {-1};
  }
  // With DDS Security each side finishes the handshake by itself, and a matched reader may not read
  // yet. An acknowledged value shows that it does; these are not counted.
  if (argc == 6 && (*publisher)->Publish(units) != units.size()) return 1;
  (*publisher)->Flush();
  while (!(*publisher)->acknowledged()) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  const std::uint64_t first_samples = (*publisher)->counters().samples;
  const double before = CpuSeconds();
  const auto began = std::chrono::steady_clock::now();
  for (int cycle = 0; cycle < cycles; ++cycle) {
    for (UnitStatusValue& unit : units) {
      unit.at = {cycle};
      unit.low_deg[0] = cycle * 0.25;
      unit.phase = UnitPhase::kMoving;
    }
    if ((*publisher)->Publish(units) != units.size()) return 1;
    (*publisher)->Flush();
    std::this_thread::sleep_until(began + (cycle + 1) * period);
  }
  std::printf("%.6f %lu\n", CpuSeconds() - before,
              (*publisher)->counters().samples - first_samples);
  return 0;
}

}  // namespace
}  // namespace focalfleet

int main(int argc, char** argv) { return focalfleet::Main(argc, argv); }
