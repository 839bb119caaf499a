// A night of a plane: one seed draws the plane, the weather of its network, a task, and one to
// three faults, each in a phase of the task. The task is a configuration, which may be measured and
// corrected, and in which some units may get other targets, or it is the homing of some units. Then
// all faults end, and the plane must carry out another configuration whole. The same seed gives the
// same night.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tests/scenario/plane_in_process.h"

namespace focalfleet::test {

enum class PlaneFault : std::uint8_t {
  kKillSector,
  kKillPlane,
  kKillBoth,
  kCutSector,       // from all others, both ways
  kCutSectorMuted,  // what it says is lost
  kCutSectorDeaf,   // what is said to it is lost
  kCutBorder,       // between two sectors, one way
  kStorm,           // 40 % of all messages are lost, delays up to 300 ms
  kSecondPlane,     // another coordinator, without the first one's store, beside it
  kSecondPlaneCut,  // the same, on one side of a partition
  kStop,            // an operator's, of the plane
  kStopSector,      // an operator's, of one sector
  kHaltUnit,        // a unit halts by itself
};
inline constexpr std::size_t kPlaneFaultCount = 13;
const char* Name(PlaneFault fault);

/// The units of the configuration that the faults struck, by what became of their targets.
struct PlaneFate {
  std::uint32_t units = 0;
  /// Counts by TargetOutcome; kNone and kPending are those that were left out.
  std::array<std::uint32_t, static_cast<std::size_t>(kLastTargetOutcome) + 1> outcomes{};
};

struct PlaneNightResult {
  std::uint64_t seed = 0;
  PlaneFate victims;  // the units of the sector that the first fault is about
  PlaneFate others;
  std::uint32_t rounds = 0;         // of that configuration
  std::uint32_t completed = 0;      // units that the last configuration brought to their targets
  std::vector<std::string> broken;  // empty: every rule was kept
  /// How often a fault struck while the plane was in a phase.
  std::array<std::array<std::uint32_t, kPlanePhaseCount>, kPlaneFaultCount> struck{};
  std::uint64_t begun = 0;    // moves of units
  std::uint64_t starts = 0;   // of sectors
  std::uint64_t sent = 0;     // messages
  std::uint64_t missed = 0;   // rounds that a sector gave back
  std::uint64_t excused = 0;  // contacts in the window before a start
  std::uint64_t silent = 0;   // neighbours that were given up in motion
  double nearest_mm = 0;
  double virtual_s = 0;
  std::uint64_t digest = 0;
};

struct PlaneNightOptions {
  std::uint64_t seed = 1;
  /// Instead of drawn faults: this one, when the plane enters this phase.
  std::optional<PlaneFault> fault;
  PlanePhase phase = PlanePhase::kMoving;
  double after_s = 0;
  bool tell = false;  // prints what happens
};

PlaneNightResult RunPlaneNight(const PlaneNightOptions& options);

}  // namespace focalfleet::test
