// ConfigurationExecutor, from which side units come to where they are to end.
//
// The play of a gear, 1.4 to 1.6 degrees of the axis before its last stage (DESI's positioners),
// swallows a way that is smaller and comes from the other side. So a way that is measured ends by a
// last piece in one direction: past the target first, then back. Blind, it is the approach of the
// configuration for everybody. A correction comes from the side that its axis was measured on
// (AxisPlay), because on the other side the measured place is worth nothing: only an axis that has
// to go back runs up anew, one that has to go on just goes.
//
// What a way scatters by grows with the root of its length, so a unidirectional approach is as
// short as the widest play allows. Where another correction follows, each axis ends short of its
// target by what its way scatters by and what its gain may be off by, so that the last way is a
// very short one in the same direction; the last correction runs up only where the tolerance cannot
// be met without.
//
// Who finds no room for its unidirectional approach between its neighbours sends them aside, where
// they can come back from the same side; else it keeps that axis still, and is tried again when
// they have come back from theirs: a correction is made in waves. Neighbours that a plan leads
// aside meanwhile may come back from the wrong side; they go in the next wave.

#include <algorithm>
#include <cmath>
#include <numbers>

#include "fleet/coordinate/executor.h"
#include "fleet/coordinate/unidirectional_approach.h"
#include "fleet/kinematics.h"

namespace focalfleet {
namespace {

constexpr double kRunUpGuardMm = 0.02;
constexpr double kAimGuardMm = -1e-3;  // within what a plan takes for clear
// An exposure has its own error: who is let off with less than the whole tolerance is within it
// when it is looked at again.
constexpr double kWorthwhile = 0.5;
constexpr double kWellWithin = 0.8;  // of the tolerance: another exposure has its error, too
constexpr double kSigmasShort = 3;   // of its scatter
constexpr int kWaves = 3;

std::int8_t SignOf(double value) {
  return static_cast<std::int8_t>((value > 0 ? 1 : 0) - (value < 0 ? 1 : 0));
}

/// By how much axes may well go farther than they are told, arms and gears not being quite as
/// described. Arms that are a little longer put the same fibre on another angle of phi, and the
/// nearer it is to stretched or folded, the more; theta has to make up for what phi does to the
/// fibre's direction.
std::array<double, kAxisCount> GainDoubtDeg(const Unit& unit, const AxisAngles& at,
                                            const std::array<double, kAxisCount>& left_deg) {
  constexpr double kLeast = 0.05;
  constexpr double kMost = 0.3;
  constexpr double kArmsMm = 0.08;  // standard deviation of both together
  constexpr double kMostDeg = 0.2;  // what is left beyond that needs another correction anyhow
  const double phi = (at.phi_deg + unit.phi().zero_deg) * std::numbers::pi / 180;
  const double a = unit.theta().arm_mm, b = unit.phi().arm_mm;
  const double r2 = a * a + b * b + 2 * a * b * std::cos(phi);
  const double outwards_mm = a * b * std::abs(std::sin(phi)) / std::sqrt(std::max(r2, 1e-6));
  const double off_rad = kArmsMm / std::max(outwards_mm, 1e-3);
  const double gain =
      std::clamp(2 * off_rad * std::abs(std::cos(phi)) / std::max(std::abs(std::sin(phi)), 1e-3),
                 kLeast, kMost);
  const double turn = std::abs(b * b + a * b * std::cos(phi)) / std::max(r2, b * b / 4);
  const double theta_deg = kLeast * std::abs(left_deg[0]) + turn * gain * std::abs(left_deg[1]);
  return {std::min(theta_deg, kMostDeg), std::min(gain * std::abs(left_deg[1]), kMostDeg)};
}

}  // namespace

/// In vectors, without its sign; 0: this axis has none.
std::int32_t ConfigurationExecutor::RunUpOf(PositionerIndex i, Axis axis) const {
  return std::abs(NearestVectors(core_.config.approach_deg[Index(axis)],
                                 core_.layout.unit(i).axis[Index(axis)],
                                 core_.drives[i.value].axis[Index(axis)]));
}

std::int8_t ConfigurationExecutor::SideAfter(PositionerIndex i, Axis axis,
                                             std::int32_t left) const {
  const double run_up = RunUpOf(i, axis);
  return run_up > 0 ? play_[i.value][Index(axis)].SideAfter(left / run_up) : std::int8_t{0};
}

/// Blind: unless it was measured and goes on, not far, as it came. In a correction: if its play
/// would not be on the side on which it was measured.
bool ConfigurationExecutor::NeedsRunUp(PositionerIndex i, Axis axis, std::int32_t left) const {
  const std::int32_t run_up = RunUpOf(i, axis);
  if (run_up == 0) return false;
  if (const auto& approach = approaches_[i.value]) {
    const std::int8_t side = approach->side[Index(axis)];
    return side != 0 && SideAfter(i, axis, left) != side;
  }
  if (core_.units[i.value].view.knowledge[Index(axis)].witness != Witness::kMeasured) return true;
  return left != 0 &&
         (play_[i.value][Index(axis)].side() != SignOf(left) || std::abs(left) > run_up);
}

/// `reached`: null where it ended elsewhere than its plan did.
void ConfigurationExecutor::NoteDirections(PositionerIndex i, const UnitPlan* reached) {
  for (const Axis axis : kAxes) {
    AxisPlay& play = play_[i.value][Index(axis)];
    const double run_up = RunUpOf(i, axis);
    if (reached == nullptr || run_up == 0) {
      play.Forget();
      continue;
    }
    for (const Segment& segment : reached->path[Index(axis)].segments())
      play.Go(segment.delta / run_up);
  }
}

/// Where it may go before it goes to `target`, the best first: past it on both axes, then on one of
/// them. Blind, also past its other side where a neighbour is in the way. Empty where no axis needs
/// it.
std::vector<Pose> ConfigurationExecutor::PastTarget(PositionerIndex i, const Pose& target) const {
  const Pose place = PlaceOf(core_.unit(i).view.knowledge);
  const auto& approach = approaches_[i.value];
  if (!approach && place == target) return {};
  const std::array<VectorRange, kAxisCount> range = core_.RangesOf(i);
  // Of each axis: the usual side, the other side, and where it stays if it needs or gets none.
  std::array<std::array<std::int32_t, 3>, kAxisCount> choice{};
  bool any = false;
  for (const Axis axis : kAxes) {
    choice[Index(axis)].fill(place[Index(axis)]);
    if (!NeedsRunUp(i, axis, target[Index(axis)] - place[Index(axis)])) continue;
    any = true;
    const std::int8_t side =
        approach ? approach->side[Index(axis)] : SignOf(core_.config.approach_deg[Index(axis)]);
    const std::int32_t back = side * RunUpOf(i, axis);
    std::size_t option = 0;
    for (const std::int32_t past : {target[Index(axis)] - back, target[Index(axis)] + back}) {
      if (range[Index(axis)].contains(past)) choice[Index(axis)][option++] = past;
      if (approach) break;
    }
  }
  if (!any) return {};
  std::vector<Pose> wished;
  constexpr std::array<std::array<std::size_t, 2>, 8> kOrder{
      {{0, 0}, {0, 1}, {1, 0}, {1, 1}, {0, 2}, {2, 0}, {1, 2}, {2, 1}}};
  for (const auto& [theta, phi] : kOrder) {
    const Pose pose{choice[0][theta], choice[1][phi]};
    if (pose != place && std::ranges::find(wished, pose) == wished.end()) wished.push_back(pose);
  }
  return wished;
}

/// Where one that is corrected may go so that another has room: back on the side from which it was
/// measured, so that it comes to the same place again. Empty where it must not move.
std::vector<Pose> ConfigurationExecutor::AsideOf(PositionerIndex i) const {
  const UnitView& view = core_.units[i.value].view;
  const bool may_go =
      approaches_[i.value] && view.phase == UnitPhase::kReady && view.enabled &&
      excluded_[i.value] == 0 &&
      (view.outcome == TargetOutcome::kArrived || view.outcome == TargetOutcome::kPending);
  if (!may_go) return {};
  const auto& [aim, side, has_no_room] = *approaches_[i.value];
  const std::array<VectorRange, kAxisCount> range = core_.RangesOf(i);
  std::vector<Pose> aside;
  for (const std::int32_t times : {1, 2})
    for (const auto& [theta, phi] : {std::array{1, 0}, std::array{0, 1}, std::array{1, 1}}) {
      const Pose pose{aim[0] - theta * times * side[0] * RunUpOf(i, Axis::kTheta),
                      aim[1] - phi * times * side[1] * RunUpOf(i, Axis::kPhi)};
      const bool comes_back = (theta == 0 || side[0] != 0) && (phi == 0 || side[1] != 0);
      if (comes_back && range[0].contains(pose[0]) && range[1].contains(pose[1]))
        aside.push_back(pose);
    }
  return aside;
}

/// Puts where they go first in the place of the targets; false: nobody goes anywhere first.
bool ConfigurationExecutor::GoPast(std::vector<std::optional<Pose>>* targets) {
  const bool blind = view_.measured.empty();
  std::vector<RunUp> units(targets->size());
  for (std::uint32_t n = 0; n < units.size(); ++n) {
    const UnitKnowledge& knowledge = core_.units[n].view.knowledge;
    if (!IsPlace(knowledge)) continue;
    const std::optional<Pose>& target = (*targets)[n];
    units[n].otherwise = target && blind ? *target : PlaceOf(knowledge);
    if (target) units[n].wished = PastTarget({n}, approaches_[n] ? approaches_[n]->aim : *target);
    if (units[n].wished.empty() && !blind) units[n].aside = AsideOf({n});
  }
  const auto chosen = ChooseRunUps(core_.layout, core_.drives, units, kRunUpGuardMm);
  std::vector<std::optional<Pose>> first(targets->size());
  bool any = false;
  std::uint32_t without = 0;
  for (std::uint32_t n = 0; n < units.size(); ++n) {
    if (!chosen[n]) continue;
    if (!(*targets)[n]) {
      if (*chosen[n] == *units[n].otherwise) continue;
      SendAgain({n});  // it goes aside, and comes back
      targets_[n] = approaches_[n]->aim;
    }
    if (!units[n].wished.empty() && *chosen[n] == *units[n].otherwise) ++without;
    const bool goes = *chosen[n] != PlaceOf(core_.units[n].view.knowledge);
    if (goes) first[n] = chosen[n];
    any |= goes;
  }
  if (without > 0 && blind)
    core_.Raise(Severity::kInfo, {}, {},
                std::to_string(without) +
                    " units have no room for a run-up: from which side they come is left open");
  if (any) *targets = std::move(first);
  return any;
}

/// Where a unit in a correction goes now: to its aim with those axes that will come from the right
/// side. One that would not, and is near, waits.
Pose ConfigurationExecutor::NextOf(PositionerIndex i) const {
  const Pose& aim = approaches_[i.value]->aim;
  const Pose place = PlaceOf(core_.units[i.value].view.knowledge);
  Pose next = aim;
  for (const Axis axis : kAxes) {
    const std::int32_t left = aim[Index(axis)] - place[Index(axis)];
    if (NeedsRunUp(i, axis, left) && 2 * std::abs(left) < RunUpOf(i, axis))
      next[Index(axis)] = place[Index(axis)];
  }
  return next;
}

void ConfigurationExecutor::SetNext() {
  for (std::uint32_t n = 0; n < core_.units.size(); ++n) {
    const UnitView& view = core_.units[n].view;
    if (approaches_[n] && view.outcome == TargetOutcome::kPending && IsPlace(view.knowledge))
      targets_[n] = NextOf({n});
  }
}

bool ConfigurationExecutor::Waits(PositionerIndex i) const {
  const auto& approach = approaches_[i.value];
  return approach && targets_[i.value] && *targets_[i.value] != approach->aim;
}

void ConfigurationExecutor::NoteWhoHasNoRoom() {
  for (std::uint32_t n = 0; n < core_.units.size(); ++n)
    if (approaches_[n]) approaches_[n]->has_no_room |= Waits({n});
}

/// The target where it is in reach with room for its unidirectional approach and for corrections
/// either way, else a whole turn of theta on where that is, else as near as it gets.
Pose ConfigurationExecutor::GoalFor(PositionerIndex i, const Pose& target) const {
  const std::array<VectorRange, kAxisCount> ranges = core_.RangesOf(i);
  const std::size_t theta = Index(Axis::kTheta);
  const AxisGeometry& geometry = core_.layout.unit(i).axis[theta];
  const AxisDrive& drive = core_.drives[i.value].axis[theta];
  // Twice, because the range moves with what the next exposure makes of the unit's count.
  const std::int32_t room =
      NearestVectors(2 * std::abs(core_.config.approach_deg[theta]), geometry, drive);
  const std::int32_t turn = NearestVectors(360, geometry, drive);
  for (const std::int32_t turns : {0, turn, -turn}) {
    const std::int32_t there = target[theta] + turns;
    if (ranges[theta].contains(there - room) && ranges[theta].contains(there + room))
      return core_.NearestInReach(i, {there, target[1]});
  }
  return core_.NearestInReach(i, target);
}

/// All are where they were to go: whether there is somebody who waited, or who was led aside and
/// came back from the wrong side, and is to go now.
bool ConfigurationExecutor::AnotherWave() {
  if (waves_left_ == 0) return false;
  --waves_left_;
  bool any = false;
  for (std::uint32_t n = 0; n < core_.units.size(); ++n) {
    const UnitView& view = core_.units[n].view;
    if (!approaches_[n] || view.phase != UnitPhase::kReady || excluded_[n] != 0 ||
        !IsPlace(view.knowledge))
      continue;
    if (view.outcome != TargetOutcome::kArrived && view.outcome != TargetOutcome::kPending)
      continue;
    const Pose place = PlaceOf(view.knowledge);
    bool goes = false;
    for (const Axis axis : kAxes) {
      const std::int32_t left = approaches_[n]->aim[Index(axis)] - place[Index(axis)];
      goes |= left != 0 || NeedsRunUp({n}, axis, left);
    }
    if (!goes) continue;
    SendAgain({n});
    targets_[n] = approaches_[n]->aim;
    any = true;
  }
  if (any) {
    goes_past_ = true;
    view_.round = 0;  // each wave has the full number of tries
  }
  return any;
}

/// False: nobody would gain by another correction.
bool ConfigurationExecutor::Correct() {
  --corrections_left_;
  std::vector<RunUp> units(core_.units.size());
  for (std::uint32_t n = 0; n < units.size(); ++n) {
    const UnitView& view = core_.units[n].view;
    approaches_[n].reset();
    if (!IsPlace(view.knowledge)) continue;
    units[n].otherwise = PlaceOf(view.knowledge);
    if (view.outcome != TargetOutcome::kArrived || !view.target || !view.error_um) continue;
    approaches_[n] = Approach{.aim = *units[n].otherwise, .side = {}};
    const bool is_off = *view.error_um > kWorthwhile * measure_->tolerance_um;
    for (const Axis axis : kAxes) {
      std::int8_t& side = approaches_[n]->side[Index(axis)];
      side = play_[n][Index(axis)].side();
      // Who is where it should be is left alone, though nobody knows from which side it came.
      if (side == 0 && is_off) side = SignOf(core_.config.approach_deg[Index(axis)]);
    }
    if (is_off) units[n].wished = AimsOf({n});
  }
  // Who stays may stand a little nearer to a neighbour's target than its own target is.
  const auto chosen = ChooseRunUps(core_.layout, core_.drives, units, kAimGuardMm);
  bool again = false;
  for (std::uint32_t n = 0; n < units.size(); ++n) {
    if (units[n].wished.empty()) continue;
    approaches_[n]->has_no_room = *chosen[n] != units[n].wished.front();
    if (*chosen[n] == *units[n].otherwise) continue;
    SendAgain({n});
    approaches_[n]->aim = *chosen[n];
    targets_[n] = chosen[n];
    again = true;
  }
  if (!again) return false;
  goes_past_ = true;
  sets_out_ = true;
  waves_left_ = kWaves - 1;
  view_.round = 0;  // each correction has the full number of tries
  view_.state = ConfigurationState::kPlanning;
  std::fill(strikes_.begin(), strikes_.end(), std::uint8_t{0});
  Gather();
  return true;
}

/// Standard deviation of where an axis ends after a way (CoordinatorConfig::scatter_deg).
double ConfigurationExecutor::ScatterDeg(double way_deg) const {
  constexpr double kTravelDeg = 360;
  return core_.config.scatter_deg * std::sqrt(2 * (1 - std::exp(-way_deg / kTravelDeg)));
}

/// Where a correction is to end, the best first, then one axis of it.
std::vector<Pose> ConfigurationExecutor::AimsOf(PositionerIndex i) const {
  const Unit& unit = core_.layout.unit(i);
  const Pose place = PlaceOf(core_.units[i.value].view.knowledge);
  Pose aim = goals_[i.value].value_or(place);
  std::array<bool, kAxisCount> runs_up{};
  std::array<double, kAxisCount> left_deg{};
  for (const Axis axis : kAxes) {
    const std::size_t a = Index(axis);
    runs_up[a] = NeedsRunUp(i, axis, aim[a] - place[a]);
    left_deg[a] = AngleDeg(aim[a] - place[a], unit.axis[a], core_.drives[i.value].axis[a]);
  }
  if (corrections_left_ == 0) {
    aim = LastAimOf(i, aim, runs_up);
  } else {
    const std::array<double, kAxisCount> doubt_deg =
        GainDoubtDeg(unit, AnglesOf(unit, core_.drives[i.value], place), left_deg);
    for (const Axis axis : kAxes) {
      const std::size_t a = Index(axis);
      const double run_up_deg = std::abs(core_.config.approach_deg[a]);
      const double short_deg =
          doubt_deg[a] +
          (runs_up[a] ? core_.config.creep_deg : kSigmasShort * ScatterDeg(std::abs(left_deg[a])));
      // Without a unidirectional approach it cannot end farther back than it is.
      const double most_deg = runs_up[a] ? run_up_deg : std::abs(left_deg[a]);
      if (run_up_deg > 0)
        aim[a] -= approaches_[i.value]->side[a] * NearestVectors(std::min(short_deg, most_deg),
                                                                 unit.axis[a],
                                                                 core_.drives[i.value].axis[a]);
    }
  }
  aim = core_.NearestInReach(i, aim);
  return {aim, {aim[0], place[1]}, {place[0], aim[1]}};
}

/// Nothing mends what the last correction's unidirectional approaches scatter by: they are made by
/// as few axes as bring the fibre well within the tolerance.
Pose ConfigurationExecutor::LastAimOf(PositionerIndex i, const Pose& goal,
                                      const std::array<bool, kAxisCount>& runs_up) const {
  const Unit& unit = core_.layout.unit(i);
  const UnitDrive& drive = core_.drives[i.value];
  const Pose place = PlaceOf(core_.units[i.value].view.knowledge);
  const PointFp wanted = FibreAt(unit, drive, goal);
  const auto off_um = [&](const Pose& pose) {
    return 1e3 * DistanceMm(FibreAt(unit, drive, pose), wanted);
  };
  const Pose stays{runs_up[0] ? place[0] : goal[0], runs_up[1] ? place[1] : goal[1]};
  if (off_um(stays) <= kWellWithin * measure_->tolerance_um) return stays;
  if (!runs_up[0] || !runs_up[1]) return goal;
  const Pose theta_stays{place[0], goal[1]}, phi_stays{goal[0], place[1]};
  const Pose& better = off_um(theta_stays) < off_um(phi_stays) ? theta_stays : phi_stays;
  return off_um(better) <= kWellWithin * measure_->tolerance_um ? better : goal;
}

/// For a unit that ends too far from its target: what kept it, to go after the distance.
std::string ConfigurationExecutor::WhyItStays(PositionerIndex i) const {
  const UnitView& view = core_.units[i.value].view;
  if (!IsPlace(view.knowledge)) return {};
  if (core_.NearestInReach(i, *view.target) != *view.target) return ": its range ends before it";
  if (approaches_[i.value] && approaches_[i.value]->has_no_room)
    return ": its neighbours leave no room to correct it";
  return {};
}

}  // namespace focalfleet
