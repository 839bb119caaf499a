// The talker publishes as a daemon does: units 1..N and alarms 1..A once. Then it prints `ready`
// and stays until its stdin ends.   talker DOMAIN UNITS ALARMS [CREDENTIALS]
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <vector>

#include "daemon/dds/status_publisher.h"

namespace focalfleet {
namespace {

int Main(int argc, char** argv) {
  if (argc != 4 && argc != 5) return 2;
  DdsOptions options;
  options.domain = static_cast<std::uint32_t>(std::atoi(argv[1]));
  if (argc == 5) options.security = argv[4];
  auto publisher = StatusPublisher::Create(options);
  if (!publisher) {
    std::fprintf(stderr, "%s\n", publisher.error().text.c_str());
    return 1;
  }
  std::vector<UnitStatusValue> units(static_cast<std::size_t>(std::atoi(argv[2])));
  for (std::size_t i = 0; i < units.size(); ++i)
    units[i].unit = {static_cast<std::uint32_t>(i + 1)};
  if ((*publisher)->Publish(units) != units.size()) return 1;
  for (int id = 1; id <= std::atoi(argv[3]); ++id) {
    AlarmValue alarm;
    alarm.row.id = static_cast<std::uint64_t>(id);
    if (!(*publisher)->Publish(alarm)) return 1;
  }
  if (!(*publisher)->Publish(FleetStatusValue{})) return 1;
  (*publisher)->Flush();
  std::puts("ready");
  std::fflush(stdout);
  char c = 0;
  while (read(STDIN_FILENO, &c, 1) > 0) {
  }
  return 0;
}

}  // namespace
}  // namespace focalfleet

int main(int argc, char** argv) { return focalfleet::Main(argc, argv); }
