// Faults by the clock: which bus or unit misbehaves how, from when to when, with what chance. Two
// runs of one plan with one seed are the same run. Load testers write it as a table
// (daemon/simulator/faults_file.h), tests as it stands here.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "protocol/base/ids.h"
#include "protocol/base/instants.h"

namespace focalfleet::sim {

class World;

enum class FaultKind : std::uint8_t {
  // of a bus; chance per bit, then per frame
  kNoise,
  kDrop,
  kDuplicate,
  kDelay,  // value: seconds
  // of a bus; chance that it happens
  kStuck,    // the wire is dominant
  kDead,     // the cable is cut
  kHostOff,  // the host's controller goes bus-off when it begins; it comes back by itself
  // of a unit; chance that it happens
  kBabble,  // value: priority of what it sends without end, 0..7
  kUnplugged,
  kPowerCut,
  kSilent,
  kDeaf,
  kLate,    // value: seconds
  kCopies,  // value: copies of every answer
  kWrongDigest,
  kMuteDone,
  // of a sensor at a unit's joint, one at a time; value: its number
  kSensorStuck,
  kSensorSaturated,
  kSensorMissing,
  kSensorSwapped,  // with the next
  kSensorGain,
};
inline constexpr std::size_t kFaultKindCount = 21;
inline constexpr std::size_t kBusFaultKindCount = 7;  // the first ones

struct FaultKindInfo {
  FaultKind kind;
  const char* name;
  bool of_unit = false;
  bool needs_bit_clock = false;  // a fault of the wire itself
  const char* value = nullptr;   // its column's meaning; none: it has none
  double value_min = 0;
  double value_max = 0;
  std::optional<double> value_otherwise = {};  // none: it has to be given
};
const FaultKindInfo& InfoOf(FaultKind kind);
std::optional<FaultKind> FaultKindNamed(std::string_view name);

struct PlannedFault {
  FaultKind kind = FaultKind::kNoise;
  BusId bus;                 // of a fault of a bus
  UnitId unit;               // of a fault of a unit
  DurationNs from{0};        // since the world's start
  DurationNs to{kNever.ns};  // kNever: to the end
  double chance = 1;
  double value = 0;
};

/// What of a plan begins or ends next.
class FaultSchedule {
 public:
  FaultSchedule(std::vector<PlannedFault> plan, HostInstant start, std::uint64_t seed);

  [[nodiscard]] HostInstant next() const {
    return done_ < edges_.size() ? edges_[done_].at : kNever;
  }
  /// Does to `world` what is due at its now().
  void Apply(World* world);

 private:
  struct Edge {
    HostInstant at;
    std::uint32_t fault = 0;  // in plan_
    bool begins = false;
  };

  std::vector<PlannedFault> plan_;
  std::vector<Edge> edges_;  // in order of time; at one instant what ends first
  std::size_t done_ = 0;
};

}  // namespace focalfleet::sim
