// The draws of a seed: layout, load, and which fault sites are armed with which rates. They are
// made before the run begins, so that they can be printed first.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "daemon/soak/fault_sites.h"
#include "protocol/base/instants.h"

namespace focalfleet::soak {

struct Draws {
  std::uint64_t seed = 1;
  std::uint32_t units = 37;
  std::uint32_t units_per_bus = 10;
  DurationNs safety = Seconds(120);     // the phase in which anything may fail
  DurationNs commit = Milliseconds(4);  // mean time of a commit
  DurationNs plan = Milliseconds(50);   // mean time of a plan
  DurationNs turn = Microseconds(200);  // least time between two turns
  DurationNs idle = Seconds(4);         // mean time between two requests of operators
  bool camera = false;
  bool kernel_stamps = true;       // false: frames are stamped when the host reads them
  double clock_error_max = 50e-6;  // of each unit's clock
  /// Units and buses have no faults, so that a host that dies or stands still excuses little.
  bool host_alone = false;
  double rail_motors = 0;  // as many motors of a rail may turn at a time in a plan; 0: all
  std::array<bool, kFaultSites> armed{};
  /// Mean time between two faults of a site that goes by time.
  std::array<DurationNs, kFaultSites> period{};
  /// The chance of a site that goes by occasions.
  std::array<double, kFaultSites> chance{};

  [[nodiscard]] bool is(FaultSite site) const { return armed[Index(site)]; }
};

/// Kinds of draws in the order in which they came. A seed without the later ones is the night that
/// it was before they came.
enum class DrawKinds : std::uint8_t {
  kFirst,
  kPower,  // also the power of rails, and old answers
  kAll
};

/// Fixes what a test wants fixed.
struct DrawLimits {
  std::optional<std::uint32_t> units;
  bool faults = true;
  DrawKinds kinds = DrawKinds::kAll;
};

Draws DrawSeed(std::uint64_t seed, const DrawLimits& limits);

/// A line for people.
std::string Describe(const Draws& draws);

}  // namespace focalfleet::soak
