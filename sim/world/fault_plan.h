// A plan of faults by the clock: each entry has a bus or unit, a misbehaviour, a begin and an end,
// and a chance. Two runs of one plan with one seed are the same run. Load testers write it as a
// table (daemon/simulator/faults_file.h), tests as it stands here.
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
  // Faults of a bus; the chance is per bit, then per frame.
  kNoise,
  kDrop,
  kDuplicate,
  kDelay,  // value: seconds
  // Faults of a bus; the chance is that of the whole fault.
  kStuck,    // the wire is dominant
  kDead,     // the cable is cut
  kHostOff,  // the host's controller goes bus-off when the fault begins; it comes back by itself
  // Faults of a unit; the chance is that of the whole fault.
  kBabble,  // value: priority of the frame that it sends without end, 0..7
  kUnplugged,
  kPowerCut,
  kSilent,
  kDeaf,
  kLate,    // value: seconds
  kCopies,  // value: copies of every answer
  kWrongDigest,
  kMuteDone,
  // Faults of a sensor at a unit's joint, one at a time; the value is its number.
  kSensorStuck,
  kSensorSaturated,
  kSensorMissing,
  kSensorSwapped,  // with the next sensor
  kSensorGain,
};
inline constexpr std::size_t kFaultKindCount = 21;
inline constexpr std::size_t kBusFaultKindCount = 7;  // the first kinds

struct FaultKindInfo {
  FaultKind kind;
  const char* name;
  bool of_unit = false;
  bool needs_bit_clock = false;  // a fault of the wire itself
  const char* value = nullptr;   // the meaning of its column; none: the kind has no value
  double value_min = 0;
  double value_max = 0;
  std::optional<double> value_otherwise = {};  // none: the value has to be given
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

/// The schedule of a plan: the fault that begins or ends next.
class FaultSchedule {
 public:
  FaultSchedule(std::vector<PlannedFault> plan, HostInstant start, std::uint64_t seed);

  [[nodiscard]] HostInstant next() const {
    return done_ < edges_.size() ? edges_[done_].at : kNever;
  }
  /// Does to `world` all that is due at its now().
  void Apply(World* world);

 private:
  struct Edge {
    HostInstant at;
    std::uint32_t fault = 0;  // index in plan_
    bool begins = false;
  };

  std::vector<PlannedFault> plan_;
  std::vector<Edge> edges_;  // in order of time; at one instant ends come first
  std::size_t done_ = 0;
};

}  // namespace focalfleet::sim
