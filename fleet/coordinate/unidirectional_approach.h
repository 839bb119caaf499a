// A unidirectional approach ends a way by a last piece in one direction: past the target first,
// then back. The play of a gear swallows a way that is smaller and comes from the other side. Such
// play is 1.4 to 1.6 degrees of the axis, before its last stage (DESI's positioners).
//
// The blind way of a measured configuration approaches every target from the configured side. A
// correction comes from the side that its axis was measured on (AxisPlay), because on the other
// side the measured place is worth nothing. Only an axis that has to go back needs another
// approach; one that has to go on just goes.
//
// The scatter of a way grows with the root of its length, so an approach is as short as the widest
// play allows. Where another correction follows, each axis ends short of its target: by the scatter
// of its way, and by what its gain may be off. The last way is then a very short one in the same
// direction. The last correction makes an approach only where the tolerance cannot be met without.
//
// All functions here are of values alone.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "fleet/coordinate/coordinator_config.h"
#include "fleet/coordinate/play.h"
#include "fleet/drive.h"
#include "fleet/kinematics.h"
#include "fleet/knowledge.h"
#include "fleet/layout.h"

namespace focalfleet {

/// A correction of one unit: where it is to end, and on which side of their play its axes were
/// measured (0: not known).
struct Correction {
  Pose aim{};
  std::array<std::int8_t, kAxisCount> side{};
  /// Neighbours leave no room for the correction, or for its unidirectional approach.
  bool has_no_room = false;
};

/// The values of a unit that decide how it approaches. References outlive this.
struct ApproachUnit {
  const Unit& unit;
  const UnitDrive& drive;
  const CoordinatorConfig& config;
  const UnitKnowledge& knowledge;  // a place
  const std::array<AxisPlay, kAxisCount>& play;
  const std::optional<Correction>& correction;  // none: not measured, or blind
  std::array<VectorRange, kAxisCount> range{};

  [[nodiscard]] Pose place() const { return PlaceOf(knowledge); }
};

/// Length of an approach. Units: vectors, without a sign; 0: this axis makes none.
[[nodiscard]] std::int32_t ApproachLength(const ApproachUnit& unit, Axis axis);
/// True where the axis needs an approach before a way of `left` vectors. Blind: unless it was
/// measured and goes on as it came, not far. In a correction: where its play would not be on the
/// side on which it was measured.
[[nodiscard]] bool NeedsApproach(const ApproachUnit& unit, Axis axis, std::int32_t left);

/// Poses from which the unit approaches `target`, the best first: past it on both axes, then on one
/// of them. Blind, also past its other side where a neighbour is in the way. Empty where no axis
/// needs an approach.
[[nodiscard]] std::vector<Pose> PosesPast(const ApproachUnit& unit, const Pose& target);
/// Poses to which a unit that is corrected may be moved aside to make room. They are back on the
/// side from which it was measured, so that it returns to the same place. Pre: unit.correction.
[[nodiscard]] std::vector<Pose> PosesAside(const ApproachUnit& unit);
/// Where a unit in a correction goes now: to its aim with those axes that will come from the right
/// side. An axis that would not, and is near, waits. Pre: unit.correction.
[[nodiscard]] Pose NextPose(const ApproachUnit& unit);

/// The pose at which a correction is to end. Pre: unit.correction.
/// `goal` is the target; `is_last`: no correction follows.
[[nodiscard]] Pose AimOf(const ApproachUnit& unit, const Pose& goal, bool is_last,
                         double tolerance_um);

/// The usual side of the axis: the sign of CoordinatorConfig::approach_deg.
[[nodiscard]] std::int8_t UsualSide(const CoordinatorConfig& config, Axis axis);

}  // namespace focalfleet
