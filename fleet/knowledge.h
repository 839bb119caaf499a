// Knowledge of the coordinator about a unit's place. A bare number hides how it is known, so each
// has its witness. - measured: by a camera, or by the unit's own Hall sensors.
// - reported: the unit's own vectors after a clean end.
// - predicted: by the plan, while the unit moves.
// - interval: a move was cut short, so the unit is somewhere in low..high.
// - unknown: no source.
#pragma once

#include <array>
#include <cstdint>

#include "fleet/drive.h"

namespace focalfleet {

enum class Witness : std::uint8_t { kUnknown, kInterval, kPredicted, kReported, kMeasured };
constexpr const char* Name(Witness witness) {
  constexpr const char* kNames[] = {"unknown", "interval", "predicted", "reported", "measured"};
  return kNames[static_cast<std::size_t>(witness)];
}

/// Knowledge of one axis: low == high unless the witness is kInterval; meaningless where it is
/// kUnknown.
struct AxisKnowledge {
  Witness witness = Witness::kUnknown;
  std::int32_t low = 0;   // vectors
  std::int32_t high = 0;  // vectors
  constexpr bool operator==(const AxisKnowledge&) const = default;
};

using UnitKnowledge = std::array<AxisKnowledge, kAxisCount>;

constexpr AxisKnowledge Exactly(Witness witness, std::int32_t vectors) {
  return {witness, vectors, vectors};
}
constexpr UnitKnowledge Exactly(Witness witness, const Pose& pose) {
  return {Exactly(witness, pose[0]), Exactly(witness, pose[1])};
}

/// Both axes stand at one known place, so a move may start from there.
constexpr bool IsPlace(const UnitKnowledge& k) {
  return k[0].witness >= Witness::kReported && k[1].witness >= Witness::kReported;
}
constexpr Pose PlaceOf(const UnitKnowledge& k) { return {k[0].low, k[1].low}; }

}  // namespace focalfleet
