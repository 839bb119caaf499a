// Corrections lead a measured configuration to its targets: the unidirectional approach of the
// blind way, and then each correction after an exposure (unidirectional_approach.h). A leg that
// ends past the targets comes first, then the leg to them.
//
// A unit without room for its approach between its neighbours has them moved aside, where they can
// come back from the same side. Else it keeps that axis still, and is tried again when they have
// come back: a correction is made in waves. Neighbours that a plan leads aside meanwhile may come
// back from the wrong side; they go in the next wave.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "fleet/coordinate/configuration.h"
#include "fleet/coordinate/coordination.h"
#include "fleet/coordinate/play.h"
#include "fleet/coordinate/unidirectional_approach.h"
#include "fleet/plan/plan.h"

namespace focalfleet {

class Corrections {
 public:
  /// `configuration` outlives this.
  Corrections(const Coordination& fleet, Configuration* configuration);

  /// A configuration begins: no unit is in a correction.
  void Begin();
  /// The leg under way ends past the targets.
  [[nodiscard]] bool goes_past() const { return goes_past_; }
  /// No approach could be planned: the units come to their targets as they can.
  void GiveUpApproach();
  /// The leg past the targets is over; returns whether there was one.
  bool EndApproach();

  /// Notes the way of a unit whose motion ended. `reached`: its plan; null where it ended
  /// elsewhere.
  void NoteDirections(PositionerIndex i, const UnitPlan* reached);
  /// The target, where it is in reach with room for its approach and for corrections either way.
  /// Else the target a whole turn of theta on, where that has room; else as near as the unit gets.
  [[nodiscard]] Pose GoalFor(PositionerIndex i, const Pose& target) const;

  /// Replaces the targets by the poses to go past first; false: no unit goes anywhere first.
  bool GoPast(std::vector<std::optional<Pose>>* targets);
  /// Sets where the units in a correction go now.
  void SetNext();
  /// The unit keeps an axis still until its neighbours have come back.
  [[nodiscard]] bool Waits(PositionerIndex i) const;

  /// All units are where they were to go. True: some unit waited, or was led aside and came back
  /// from the wrong side, and goes now.
  [[nodiscard]] bool BeginWave();
  /// Notes which units wait still: their neighbours leave no room.
  void NoteUnitsWithoutRoom();
  [[nodiscard]] bool HasNoRoom(PositionerIndex i) const;
  /// All units have been measured. False: no correction is left, or no unit would gain by one.
  [[nodiscard]] bool BeginCorrection();
  /// The unit has another target: the correction to the last one is over.
  void Forget(PositionerIndex i) { units_[i.value].correction.reset(); }

 private:
  struct Unit {
    std::array<AxisPlay, kAxisCount> play;
    std::optional<Correction> correction;  // none: not measured, or blind
  };

  [[nodiscard]] ApproachUnit ApproachOf(PositionerIndex i) const;
  /// Where the unit may be moved aside; empty where it must not move.
  [[nodiscard]] std::vector<Pose> AsideOf(PositionerIndex i) const;
  /// Where a correction of the unit is to end, the best first, then one axis of it.
  [[nodiscard]] std::vector<Pose> AimsOf(PositionerIndex i) const;
  /// Sends the unit to the aim of its correction again.
  void SendToAim(PositionerIndex i);

  const Coordination fleet_;
  Configuration& configuration_;
  std::vector<Unit> units_;
  bool goes_past_ = false;
  int waves_left_ = 0;  // of this correction
  std::uint8_t corrections_left_ = 0;
};

}  // namespace focalfleet
