// A daemon may own one sector of a focal plane. Its units then move only in rounds of the plane's
// coordinator (fleet/plane): the sector asks for a plan as it would ask its own planner, and gets
// its part of one plan of the whole plane. The sector uploads, reads back, arms, makes its intents
// durable, and holds the round until it is given the start instant.
//
//   asks for a plan -> SectorRound -> holds -> SectorStart -> moves -> asks for the next plan
//                                       |
//                                       +-> SectorWithdraw -> gives its moves back, asks again
//
// A round of homing has no moves: the units of a wave are held and started in the same way, while
// every other unit in reach of one of them stands.
//
// Units on both sides of a border follow each other as others do. The end of a unit that units
// beyond the border follow is among the effects; the end of one beyond it is a command.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "fleet/plan/plan.h"
#include "fleet/records.h"
#include "protocol/base/ids.h"
#include "protocol/base/instants.h"

namespace focalfleet {

/// The part of a plan that one sector carries out. Positions are those of the sector's layout;
/// times count from the common start instant.
struct SectorRound {
  struct Refused {
    PositionerIndex unit;
    std::string reason;
  };
  /// A unit of this sector follows one beyond the border.
  struct FollowsBeyond {
    UnitId leader;
    std::uint32_t sector = 0;  // of the leader
    UnitPlan::Follower follower;
  };
  /// A unit of this sector is followed from beyond the border within this time.
  struct LeadsBeyond {
    PositionerIndex unit;
    double since_s = 0;
    double left_s = 0;
  };

  std::uint64_t job = 0;  // of the sector's, that is answered
  std::vector<UnitPlan> moves;
  std::vector<PositionerIndex> homing = {};  // units that home together; `moves` is empty then
  std::vector<Refused> refused;              // targets that are not served
  std::vector<FollowsBeyond> follows;
  std::vector<LeadsBeyond> leads;
  double start_skew_s = 0;  // that the plan allows for
  double makespan_s = 0;    // of the sector's moves
  double energy_J = 0;      // of the same, predicted
  double peak_power_W = 0;  // of the same, predicted
  bool finished = false;    // no round follows: the configuration ends
  /// With `finished`: the state in which it ends. Targets that are left are stopped with it, or
  /// fail.
  ConfigurationState end = ConfigurationState::kDone;
  std::string failure;  // why targets that are left have not arrived; empty: by themselves
};

/// The common start, by this sector's clock.
struct SectorStartCommand {
  std::uint64_t job = 0;
  HostInstant at;
};
/// The round is off: units give their moves back, and the sector asks for another plan.
struct SectorWithdrawCommand {
  std::uint64_t job = 0;
};
/// Units beyond the border may have ended between `from` and `until`, both included: whoever would
/// come where they may stand is stopped.
struct BorderEndCommand {
  std::vector<UnitId> leaders;
  HostInstant from;
  HostInstant until;
  std::string reason;
};
/// The end of a unit of this sector that units beyond the border follow.
struct BorderEnd {
  UnitId leader;
  HostInstant from;
  HostInstant until;
  bool operator==(const BorderEnd&) const = default;
};

/// How far the sector is with its round, for its agent.
enum class SectorStage : std::uint8_t {
  kIdle,       // no configuration is under way
  kPreparing,  // gathers answers, uploads, or gives moves back
  kAsking,     // waits for its part of a plan
  kReady,      // all units of the round are armed, their intents are durable
  kMoving,
  kEnding,   // the last rows are being written
  kLooking,  // waits for the findings of an exposure of the plane's camera
};
inline constexpr std::uint8_t kSectorStageCount = 7;
constexpr const char* Name(SectorStage stage) {
  constexpr const char* kNames[] = {"idle",   "preparing", "asking", "ready",
                                    "moving", "ending",    "looking"};
  return kNames[static_cast<std::size_t>(stage)];
}
struct SectorView {
  SectorStage stage = SectorStage::kIdle;
  std::uint64_t job = 0;     // the last one asked for
  bool looks_first = false;  // kLooking: no unit has moved yet
};

/// The fault of a round that came from outside, for a sector of `units` units; empty: none.
std::string FaultOf(const SectorRound& round, std::size_t units);

}  // namespace focalfleet
