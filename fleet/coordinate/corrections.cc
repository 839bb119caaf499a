#include "fleet/coordinate/corrections.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "fleet/coordinate/approach_choice.h"
#include "fleet/kinematics.h"

namespace focalfleet {
namespace {

constexpr double kApproachGuardMm = 0.02;
constexpr double kAimGuardMm = -1e-3;  // within what a plan takes for clear
// Share of the tolerance above which a unit is corrected. An exposure has its own error: a unit
// left alone with less than the whole tolerance is within it in the next exposure.
constexpr double kWorthwhile = 0.5;
constexpr int kWaves = 3;

/// The target was reached or is being reached, so the unit may be sent again.
bool IsServed(const UnitView& view) {
  return view.outcome == TargetOutcome::kArrived || view.outcome == TargetOutcome::kPending;
}

}  // namespace

Corrections::Corrections(const Coordination& fleet, Configuration* configuration)
    : fleet_(fleet), configuration_(*configuration), units_(fleet.units.size()) {}

void Corrections::Begin() {
  const auto& measure = configuration_.measure;
  corrections_left_ = measure ? measure->corrections : std::uint8_t{0};
  goes_past_ = measure && !measure->observe;
  waves_left_ = 0;
  for (Unit& unit : units_) unit.correction.reset();
}

void Corrections::GiveUpApproach() {
  goes_past_ = false;
  waves_left_ = 0;
}

bool Corrections::EndApproach() { return std::exchange(goes_past_, false); }

ApproachUnit Corrections::ApproachOf(PositionerIndex i) const {
  const Unit& unit = units_[i.value];
  return {.unit = fleet_.layout.unit(i),
          .drive = fleet_.drive(i),
          .config = fleet_.config,
          .knowledge = fleet_.units[i].view.knowledge,
          .play = unit.play,
          .correction = unit.correction,
          .range = fleet_.units.RangesOf(i)};
}

void Corrections::NoteDirections(PositionerIndex i, const UnitPlan* reached) {
  const ApproachUnit approach = ApproachOf(i);
  for (const Axis axis : kAxes) {
    AxisPlay& play = units_[i.value].play[Index(axis)];
    const double length = ApproachLength(approach, axis);
    if (reached == nullptr || length == 0) {
      play.Forget();
      continue;
    }
    for (const Segment& segment : reached->path[Index(axis)].segments())
      play.Go(segment.delta / length);
  }
}

Pose Corrections::GoalFor(PositionerIndex i, const Pose& target) const {
  const std::array<VectorRange, kAxisCount> ranges = fleet_.units.RangesOf(i);
  const std::size_t theta = Index(Axis::kTheta);
  const AxisGeometry& geometry = fleet_.layout.unit(i).axis[theta];
  const AxisDrive& drive = fleet_.drive(i).axis[theta];
  // Twice, because the range moves with the unit's offset after the next exposure.
  const std::int32_t room =
      NearestVectors(2 * std::abs(fleet_.config.approach_deg[theta]), geometry, drive);
  const std::int32_t turn = NearestVectors(360, geometry, drive);
  for (const std::int32_t turns : {0, turn, -turn}) {
    const std::int32_t there = target[theta] + turns;
    if (ranges[theta].contains(there - room) && ranges[theta].contains(there + room))
      return fleet_.units.NearestInReach(i, {there, target[1]});
  }
  return fleet_.units.NearestInReach(i, target);
}

std::vector<Pose> Corrections::AsideOf(PositionerIndex i) const {
  const UnitView& view = fleet_.units[i].view;
  const bool may_go = units_[i.value].correction && view.phase == UnitPhase::kReady &&
                      view.enabled && !configuration_[i].excluded && IsServed(view);
  return may_go ? PosesAside(ApproachOf(i)) : std::vector<Pose>{};
}

bool Corrections::GoPast(std::vector<std::optional<Pose>>* targets) {
  const bool blind = configuration_.view.measured.empty();
  std::vector<ApproachWish> wishes(targets->size());
  for (std::uint32_t n = 0; n < wishes.size(); ++n) {
    const UnitKnowledge& knowledge = fleet_.units[{n}].view.knowledge;
    if (!IsPlace(knowledge)) continue;
    const std::optional<Pose>& target = (*targets)[n];
    const std::optional<Correction>& correction = units_[n].correction;
    wishes[n].otherwise = target && blind ? *target : PlaceOf(knowledge);
    if (target)
      wishes[n].wished = PosesPast(ApproachOf({n}), correction ? correction->aim : *target);
    if (wishes[n].wished.empty() && !blind) wishes[n].aside = AsideOf({n});
  }
  const auto chosen =
      ChooseApproaches(fleet_.layout, fleet_.units.drives, wishes, kApproachGuardMm);
  std::vector<std::optional<Pose>> first(targets->size());
  bool any = false;
  std::uint32_t without = 0;
  for (std::uint32_t n = 0; n < wishes.size(); ++n) {
    if (!chosen[n]) continue;
    if (!(*targets)[n]) {
      if (*chosen[n] == *wishes[n].otherwise) continue;
      SendToAim({n});  // moved aside now, it comes back in the next leg
    }
    if (!wishes[n].wished.empty() && *chosen[n] == *wishes[n].otherwise) ++without;
    const bool goes = *chosen[n] != PlaceOf(fleet_.units[{n}].view.knowledge);
    if (goes) first[n] = chosen[n];
    any |= goes;
  }
  if (without > 0 && blind)
    fleet_.ledger.alarms().Raise(
        AlarmName::kRunUpsLeftOut, {}, {},
        std::to_string(without) +
            " units have no room for a run-up: from which side they come is left open");
  if (any) *targets = std::move(first);
  return any;
}

void Corrections::SetNext() {
  for (std::uint32_t n = 0; n < units_.size(); ++n) {
    const UnitView& view = fleet_.units[{n}].view;
    if (units_[n].correction && view.outcome == TargetOutcome::kPending && IsPlace(view.knowledge))
      configuration_[{n}].target = NextPose(ApproachOf({n}));
  }
}

bool Corrections::Waits(PositionerIndex i) const {
  const std::optional<Correction>& correction = units_[i.value].correction;
  const std::optional<Pose>& target = configuration_[i].target;
  return correction && target && *target != correction->aim;
}

bool Corrections::BeginWave() {
  if (waves_left_ == 0) return false;
  --waves_left_;
  bool any = false;
  for (std::uint32_t n = 0; n < units_.size(); ++n) {
    const UnitView& view = fleet_.units[{n}].view;
    if (!units_[n].correction || view.phase != UnitPhase::kReady || configuration_[{n}].excluded ||
        !IsPlace(view.knowledge) || !IsServed(view))
      continue;
    const ApproachUnit approach = ApproachOf({n});
    const Pose place = approach.place();
    bool goes = false;
    for (const Axis axis : kAxes) {
      const std::int32_t left = units_[n].correction->aim[Index(axis)] - place[Index(axis)];
      goes |= left != 0 || NeedsApproach(approach, axis, left);
    }
    if (!goes) continue;
    SendToAim({n});
    any = true;
  }
  if (any) {
    goes_past_ = true;
    configuration_.view.round = 0;  // each wave has the full number of tries
  }
  return any;
}

void Corrections::NoteUnitsWithoutRoom() {
  for (std::uint32_t n = 0; n < units_.size(); ++n)
    if (units_[n].correction) units_[n].correction->has_no_room |= Waits({n});
}

bool Corrections::HasNoRoom(PositionerIndex i) const {
  const std::optional<Correction>& correction = units_[i.value].correction;
  return correction && correction->has_no_room;
}

bool Corrections::BeginCorrection() {
  if (corrections_left_ == 0) return false;
  --corrections_left_;
  std::vector<ApproachWish> wishes(units_.size());
  for (std::uint32_t n = 0; n < wishes.size(); ++n) {
    const UnitView& view = fleet_.units[{n}].view;
    std::optional<Correction>& correction = units_[n].correction;
    correction.reset();
    if (!IsPlace(view.knowledge)) continue;
    wishes[n].otherwise = PlaceOf(view.knowledge);
    if (view.outcome != TargetOutcome::kArrived || !view.target || !view.error_um) continue;
    correction = Correction{.aim = *wishes[n].otherwise, .side = {}};
    const bool is_off = *view.error_um > kWorthwhile * configuration_.measure->tolerance_um;
    for (const Axis axis : kAxes) {
      std::int8_t& side = correction->side[Index(axis)];
      side = units_[n].play[Index(axis)].side();
      // A unit within the tolerance is left alone, though the side that it came from is not known.
      if (side == 0 && is_off) side = UsualSide(fleet_.config, axis);
    }
    if (is_off) wishes[n].wished = AimsOf({n});
  }
  // A unit that stays may stand a little nearer to a neighbour's target than its own target is.
  const auto chosen = ChooseApproaches(fleet_.layout, fleet_.units.drives, wishes, kAimGuardMm);
  bool again = false;
  for (std::uint32_t n = 0; n < wishes.size(); ++n) {
    if (wishes[n].wished.empty()) continue;
    units_[n].correction->has_no_room = *chosen[n] != wishes[n].wished.front();
    if (*chosen[n] == *wishes[n].otherwise) continue;
    units_[n].correction->aim = *chosen[n];
    SendToAim({n});
    again = true;
  }
  if (!again) return false;
  goes_past_ = true;
  waves_left_ = kWaves - 1;
  configuration_.view.round = 0;  // each correction has the full number of tries
  configuration_.view.state = ConfigurationState::kPlanning;
  configuration_.ForgetStrikes();
  return true;
}

std::vector<Pose> Corrections::AimsOf(PositionerIndex i) const {
  const ApproachUnit approach = ApproachOf(i);
  const Pose place = approach.place();
  const Pose aim = fleet_.units.NearestInReach(
      i, AimOf(approach, configuration_[i].goal.value_or(place), corrections_left_ == 0,
               configuration_.measure->tolerance_um));
  return {aim, {aim[0], place[1]}, {place[0], aim[1]}};
}

void Corrections::SendToAim(PositionerIndex i) {
  configuration_.SendAgain(i);
  configuration_[i].target = units_[i.value].correction->aim;
}

}  // namespace focalfleet
