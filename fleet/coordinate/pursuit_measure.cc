// Pursuit, when all have arrived: the camera looks, and who is too far off is sent again.
//
// What a unit reports is its own count. The camera's place takes its stead, so a correction is a
// configuration like any other, from where everything truly stands; only the way to it is fixed:
// past the target, then back in the direction of the approach, always the same one. The play of a
// gear, 1.4 degrees of the axis before its last stage (DESI's positioners), would swallow any
// correction that is smaller and comes from the other side.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "fleet/coordinate/pursuit.h"
#include "fleet/coordinate/run_up.h"
#include "fleet/kinematics.h"

namespace focalfleet {
namespace {

constexpr int kExposuresRefusedMax = 3;
constexpr double kRunUpGuardMm = 0.02;
constexpr double kAimGuardMm = -1e-3;  // within what a plan takes for clear
// An exposure has its own error: who is let off with less than the whole tolerance is within it
// when it is looked at again.
constexpr double kWorthwhile = 0.5;

void Summarise(std::vector<double> errors_um, MeasuredRound* round) {
  if (errors_um.empty()) return;
  double sum = 0;
  for (const double um : errors_um) sum += um * um;
  round->rms_um = std::sqrt(sum / static_cast<double>(errors_um.size()));
  std::sort(errors_um.begin(), errors_um.end());
  round->median_um = errors_um[errors_um.size() / 2];
  round->worst_um = errors_um.back();
}

std::string Micrometres(double um) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f um", um);
  return text;
}

/// A swapped unit's place is certain, too, but not the way by which another's commands led there.
bool IsPut(SightingStatus status) {
  return status == SightingStatus::kMeasured || status == SightingStatus::kDidNotMove;
}

}  // namespace

/// An axis needs no run-up where it was measured and has to go on in the direction in which it
/// came, at most as far as a run-up is long: its play is on the right side already.
bool Pursuit::NeedsRunUp(PositionerIndex i, Axis axis, std::int32_t left) const {
  const AxisKnowledge& known = core_.units[i.value].view.knowledge[Index(axis)];
  const std::int32_t run_up = std::abs(NearestVectors(core_.config.approach_deg[Index(axis)],
                                                      core_.layout.unit(i).axis[Index(axis)],
                                                      core_.drives[i.value].axis[Index(axis)]));
  const std::int32_t ahead = left * came_[i.value][Index(axis)];
  return known.witness != Witness::kMeasured || (left != 0 && (ahead <= 0 || ahead > run_up));
}

/// `reached`: null where it ended elsewhere than its plan did.
void Pursuit::NoteDirections(PositionerIndex i, const UnitPlan* reached) {
  for (const Axis axis : kAxes) {
    std::int8_t& came = came_[i.value][Index(axis)];
    if (reached == nullptr) {
      came = 0;
      continue;
    }
    for (const Segment& segment : reached->path[Index(axis)].segments())
      if (segment.delta != 0) came = segment.delta > 0 ? 1 : -1;
  }
}

/// Where it may go first, the best first: past the target by the approach on both axes, then past
/// its other side where a neighbour is in the way, then on one axis alone. Empty where it has
/// arrived already, or where there is no approach to prepare.
std::vector<Pose> Pursuit::PastTarget(PositionerIndex i) const {
  const Pose target = *targets_[i.value];
  const Pose place = PlaceOf(core_.unit(i).view.knowledge);
  if (place == target) return {};
  // Of each axis: the usual side, the other side, and where it stays if it needs or gets none.
  std::array<std::array<std::int32_t, 3>, kAxisCount> choice{};
  bool any = false;
  for (const Axis axis : kAxes) {
    choice[Index(axis)].fill(place[Index(axis)]);
    if (!NeedsRunUp(i, axis, target[Index(axis)] - place[Index(axis)])) continue;
    const AxisGeometry& geometry = core_.layout.unit(i).axis[Index(axis)];
    const AxisDrive& drive = core_.drives[i.value].axis[Index(axis)];
    const VectorRange range = RangeOf(geometry, drive);
    const std::int32_t approach =
        NearestVectors(core_.config.approach_deg[Index(axis)], geometry, drive);
    if (approach == 0) continue;
    any = true;
    std::size_t option = 0;
    for (const std::int32_t past : {target[Index(axis)] - approach, target[Index(axis)] + approach})
      if (past >= range.low && past <= range.high) choice[Index(axis)][option++] = past;
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

/// Puts where they go first in the place of the targets; false: nobody goes anywhere first.
bool Pursuit::GoPast(std::vector<std::optional<Pose>>* targets) {
  const bool blind = view_.measured.empty();
  std::vector<RunUp> units(targets->size());
  for (std::uint32_t n = 0; n < units.size(); ++n) {
    const UnitKnowledge& knowledge = core_.units[n].view.knowledge;
    if (!IsPlace(knowledge)) continue;
    const std::optional<Pose>& target = (*targets)[n];
    units[n].otherwise = target && blind ? *target : PlaceOf(knowledge);
    if (target) units[n].wished = PastTarget({n});
  }
  const auto chosen = ChooseRunUps(core_.layout, core_.drives, units, kRunUpGuardMm);
  std::vector<std::optional<Pose>> first(targets->size());
  bool any = false;
  std::uint32_t without = 0;
  for (std::uint32_t n = 0; n < units.size(); ++n) {
    if (!(*targets)[n]) continue;
    if (!units[n].wished.empty() && *chosen[n] == *units[n].otherwise) ++without;
    const bool goes = *chosen[n] != PlaceOf(core_.units[n].view.knowledge);
    if (goes) first[n] = chosen[n];
    any |= goes;
  }
  if (without > 0)
    core_.Raise(Severity::kInfo, {}, {},
                std::to_string(without) +
                    " units have no room for a run-up: from which side they come is left open");
  if (any) *targets = std::move(first);
  return any;
}

void Pursuit::MeasureOrFinish() {
  // Somebody must have arrived, durably or not yet, for there to be anything to measure.
  if (!measure_ || (view_.arrived == 0 && arrivals_.empty())) {
    FinishWhenDurable(ConfigurationState::kDone);
    return;
  }
  exposures_refused_ = 0;
  exposure_ = 0;  // asked for when the arrivals are durable
  due_ = core_.now;
  SetState(State::kMeasuring);
}

void Pursuit::AskForExposure() {
  exposure_ = core_.next_exposure++;
  ExposureJob job{
      .id = exposure_, .since = core_.now, .expected = {}, .before = stood_, .seen = {}};
  for (const UnitRecord& unit : core_.units) {
    job.expected.push_back(unit.view.knowledge);
    job.seen.push_back(unit.view.offset != Pose{} ? 1 : 0);
  }
  core_.out->exposure = std::move(job);
}

void Pursuit::OnExposure(const ExposureDone& done) {
  if (state_ != State::kMeasuring || done.id != exposure_) return;  // of a goal that was stopped
  if (!done.exposure) {
    core_.Raise(Severity::kWarning, {}, {},
                "exposure " + std::to_string(exposure_) + ": " + done.exposure.error().text);
    if (++exposures_refused_ < kExposuresRefusedMax) {
      AskForExposure();
      return;
    }
    core_.Raise(Severity::kError, {}, {},
                "configuration " + std::to_string(view_.id) + " is not measured: " +
                    std::to_string(exposures_refused_) + " exposures could not be used");
    FinishWhenDurable(ConfigurationState::kDone);
    return;
  }
  MeasuredRound round{.exposure = exposure_};
  std::vector<double> errors_um;
  for (const Sighting& sighting : done.exposure->sightings) {
    TakeSighting(*done.exposure, sighting, &round);
    const UnitView& view = core_.unit(sighting.unit).view;
    if (view.target && view.error_um) errors_um.push_back(*view.error_um);
  }
  Summarise(std::move(errors_um), &round);
  view_.measured.push_back(round);
  measured_batch_ = core_.batch_now();
  CorrectOrFinish();
}

void Pursuit::TakeSighting(const ExposureFindings& exposure, const Sighting& sighting,
                           MeasuredRound* round) {
  const PositionerIndex i = sighting.unit;
  UnitView& view = core_.unit(i).view;
  const bool put = IsPut(sighting.status) && sighting.place;
  view.sighting = sighting.status;
  view.error_um.reset();
  core_.Changed(i);
  if (put && view.target) {
    const PointFp wanted = FibreAt(core_.layout.unit(i), core_.drives[i.value], *view.target);
    view.error_um = 1e3 * std::hypot(sighting.x_mm - wanted.x_mm, sighting.y_mm - wanted.y_mm);
    ++round->measured;
    if (*view.error_um <= measure_->tolerance_um) ++round->within_tolerance;
  } else if (view.target) {
    ++round->unknown;
  }
  if (view.serial.value != 0) {
    MeasurementRow row{.exposure = exposure.id,
                       .configuration = view_.id,
                       .serial = view.serial,
                       .unit = core_.layout.unit(i).id,
                       .status = sighting.status,
                       .other = {},
                       .x_mm = sighting.x_mm,
                       .y_mm = sighting.y_mm,
                       .sigma_um = sighting.sigma_um,
                       .place = sighting.place,
                       .target_fp = {},
                       .error_um = view.error_um};
    if (sighting.other) row.other = core_.layout.unit(*sighting.other).id;
    if (view.target)
      row.target_fp = FibreAt(core_.layout.unit(i), core_.drives[i.value], *view.target);
    core_.Note(std::move(row));
  }
  if (put && !measure_->observe && view.phase == UnitPhase::kReady && IsPlace(view.knowledge))
    core_.See(i, *sighting.place);
  if (sighting.status == SightingStatus::kDidNotMove && stood_[i.value] && view.target &&
      *stood_[i.value] != *view.target)
    core_.Raise(Severity::kWarning, i, {},
                core_.NameOf(i) + " did not move, though it reports that it did");
  if (sighting.status == SightingStatus::kSwapped && sighting.other)
    core_.Raise(Severity::kError, i, {},
                core_.NameOf(i) + " stands where " + core_.NameOf(*sighting.other) +
                    " was sent: the two are confused in the layout or on the bus");
}

void Pursuit::CorrectOrFinish() {
  if (corrections_left_ > 0 && Correct()) return;
  for (std::uint32_t n = 0; n < core_.units.size(); ++n) {
    UnitView& view = core_.unit({n}).view;
    if (view.outcome != TargetOutcome::kArrived || !view.target || measure_->observe) continue;
    if (!view.error_um) {
      view.outcome_reason =
          std::string("not measured: ") + (view.sighting ? Name(*view.sighting) : "not looked for");
    } else if (*view.error_um > measure_->tolerance_um) {
      Reopen({n});
      SetOutcome({n}, TargetOutcome::kFailed,
                 Micrometres(*view.error_um) + " from its target as measured, more than " +
                     Micrometres(measure_->tolerance_um));
    }
  }
  FinishWhenDurable(ConfigurationState::kDone);
}

/// False: nobody would gain by another correction.
bool Pursuit::Correct() {
  --corrections_left_;
  std::vector<RunUp> units(core_.units.size());
  for (std::uint32_t n = 0; n < units.size(); ++n) {
    const UnitView& view = core_.units[n].view;
    if (!IsPlace(view.knowledge)) continue;
    units[n].otherwise = PlaceOf(view.knowledge);
    if (view.outcome == TargetOutcome::kArrived && view.target && view.error_um &&
        *view.error_um > kWorthwhile * measure_->tolerance_um)
      units[n].wished = AimsOf({n});
  }
  // Who stays may stand a little nearer to a neighbour's target than its own target is.
  const auto chosen = ChooseRunUps(core_.layout, core_.drives, units, kAimGuardMm);
  bool again = false;
  for (std::uint32_t n = 0; n < units.size(); ++n) {
    if (units[n].wished.empty() || *chosen[n] == *units[n].otherwise) continue;
    Reopen({n});
    targets_[n] = chosen[n];
    again = true;
  }
  if (!again) return false;
  goes_past_ = true;
  sets_out_ = true;
  view_.round = 0;  // each correction has the full number of tries
  view_.state = ConfigurationState::kPlanning;
  std::fill(strikes_.begin(), strikes_.end(), std::uint8_t{0});
  Gather();
  return true;
}

/// Where a correction is to end, or one axis of it. A run-up scatters by some micrometres itself:
/// it is taken only for more than that, and where another correction follows, it ends short of the
/// target.
std::vector<Pose> Pursuit::AimsOf(PositionerIndex i) const {
  const UnitView& view = core_.units[i.value].view;
  const Unit& unit = core_.layout.unit(i);
  const Pose place = PlaceOf(view.knowledge);
  const SegmentFp arm = ArmAt(unit, core_.drives[i.value], place);
  Pose aim = *view.target;
  for (const Axis axis : kAxes) {
    const AxisGeometry& geometry = unit.axis[Index(axis)];
    const AxisDrive& drive = core_.drives[i.value].axis[Index(axis)];
    const std::int32_t left = aim[Index(axis)] - place[Index(axis)];
    if (!NeedsRunUp(i, axis, left)) continue;
    const double lever_mm =
        axis == Axis::kTheta ? DistanceMm(unit.base_fp, arm.b) : DistanceMm(arm.a, arm.b);
    const double off_um =
        1e3 * lever_mm * std::abs(AngleDeg(left, geometry, drive)) * std::numbers::pi / 180;
    const double creep_deg = core_.config.approach_deg[Index(axis)] < 0 ? core_.config.creep_deg
                                                                        : -core_.config.creep_deg;
    if (off_um < kWorthwhile * measure_->tolerance_um) {
      aim[Index(axis)] = place[Index(axis)];
    } else if (corrections_left_ > 0) {
      aim[Index(axis)] += NearestVectors(creep_deg, geometry, drive);
    }
  }
  if (!InRange(unit, core_.drives[i.value], aim)) aim = *view.target;
  return {aim, {aim[0], place[1]}, {place[0], aim[1]}};
}

/// Takes its arrival back: the camera knows better.
void Pursuit::Reopen(PositionerIndex i) {
  UnitView& view = core_.unit(i).view;
  view.outcome = TargetOutcome::kPending;
  --view_.arrived;
  core_.Changed(i);
}

}  // namespace focalfleet
