// ConfigurationExecutor, when all have arrived: the camera looks, and who is too far off is sent
// again. Where units of unknown place have targets, the camera looks before anybody moves, too, and
// their counts are set to where they are found (UnitSessions::Locate).
//
// A measured configuration has served those units alone that are known to be within the tolerance:
// by an exposure after their last motion. All others end as failed (beyond it), unmeasured, or
// stopped (JudgeMeasured).
//
// What a unit reports is its own count. The camera's place takes its stead, so a correction is a
// configuration like any other, from where everything truly stands; only the way to it is fixed
// (executor_approach.cc).

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include "fleet/coordinate/executor.h"
#include "fleet/kinematics.h"

namespace focalfleet {
namespace {

constexpr int kExposuresRefusedMax = 3;

// A unit's sensors are read so long after the last motion: a board averages over 26 ms.
constexpr DurationNs kSensorsSettle = Milliseconds(50);

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
bool IsPut(MeasurementStatus status) {
  return status == MeasurementStatus::kMeasured || status == MeasurementStatus::kDidNotMove;
}

}  // namespace

void ConfigurationExecutor::MeasureOrFinish() {
  // Somebody must have arrived, durably or not yet, for there to be anything to measure.
  if (!measure_ || (view_.arrived == 0 && arrivals_.empty())) {
    FinishWhenDurable(ConfigurationState::kDone);
    return;
  }
  StartLook(Look::kAfter);
}

/// Units of unknown place have targets, and nobody has looked for them yet.
bool ConfigurationExecutor::LooksFirst() const {
  if (!measure_ || measure_->observe || looked_first_ || !core_.config.has_camera) return false;
  return std::ranges::any_of(core_.units, [](const UnitRecord& unit) {
    return unit.view.outcome == TargetOutcome::kPending && unit.view.enabled &&
           unit.view.phase == UnitPhase::kReady && !IsPlace(unit.view.knowledge);
  });
}

void ConfigurationExecutor::StartLook(Look look) {
  look_ = look;
  looked_first_ = true;
  exposures_refused_ = 0;
  exposure_ = 0;  // asked for when the arrivals are durable
  sensing_ = false;
  sense_at_ = core_.config.reads_sensors ? core_.now + kSensorsSettle : kNever;
  due_ = core_.config.reads_sensors ? sense_at_ : core_.now;
  SetState(State::kMeasuring);
}

/// The readings of all units with sensors are there, as far as they come. A unit that is read anew
/// meanwhile, because it missed us for a while, is awaited and asked as soon as it is known again.
bool ConfigurationExecutor::SensorsAreRead() {
  if (sense_at_ == kNever) return true;
  if (core_.now < sense_at_) return false;
  const bool first = !std::exchange(sensing_, true);
  if (first) sense_until_ = core_.now + core_.config.silence_limit;
  const bool patient = core_.now < sense_until_;
  bool read = true;
  const auto count = static_cast<std::uint32_t>(core_.units.size());
  for (std::uint32_t n = 0; n < count; ++n) {
    if (core_.layout.unit({n}).sensors == 0) continue;
    UnitRecord& unit = core_.units[n];
    if (first) unit.sensing = {};  // of an exposure before
    const bool is_ready = unit.view.phase == UnitPhase::kReady;
    if (is_ready && !unit.sensing.begun() && (first || patient)) sessions_.Sense({n});
    if (is_ready ? unit.sensing.under_way() : patient && unit.view.phase == UnitPhase::kIdentifying)
      read = false;
  }
  return read;
}

void ConfigurationExecutor::AskForExposure() {
  exposure_ = core_.next_exposure++;
  exposure_asked_ = core_.now;
  ExposureJob job{.id = exposure_,
                  .since = core_.now,
                  .expected = {},
                  .before = {},
                  .reported = {},
                  .seen = {}};
  job.before = stood_;
  if (look_ != Look::kAfter) job.before.assign(core_.units.size(), std::nullopt);
  for (std::uint32_t n = 0; n < core_.units.size(); ++n) {
    const UnitRecord& unit = core_.units[n];
    job.expected.push_back(unit.view.knowledge);
    std::optional<Pose> says;
    if (unit.view.phase == UnitPhase::kReady && !IsPlace(unit.view.knowledge))
      says = core_.PlaceAt({n}, unit.reading.position);
    job.reported.push_back(says);
    job.seen.push_back(unit.view.offset != Pose{} ? 1 : 0);
    job.wanted.push_back(unit.view.target && unit.view.phase == UnitPhase::kReady ? 1 : 0);
    if (core_.config.reads_sensors) job.readings.push_back(unit.sensing.reading);
  }
  job.tolerance_um = measure_->tolerance_um;
  core_.out->exposure = std::move(job);
}

void ConfigurationExecutor::OnExposure(const ExposureDone& done) {
  if (state_ != State::kMeasuring || done.id != exposure_) return;  // of a goal that was stopped
  if (!done.exposure) return ExposureFailed(done.exposure.error());
  view_.not_measured.clear();
  MeasuredRound round{.exposure = exposure_, .camera = done.exposure->camera};
  if (!done.exposure->camera_trouble.empty())
    core_.Raise(Severity::kError, {}, {},
                "exposure " + std::to_string(exposure_) + ": " + done.exposure->camera_trouble +
                    "; units are measured by their own sensors alone");
  std::vector<double> errors_um;
  for (const Measurement& measurement : done.exposure->measurements) {
    TakeMeasurement(*done.exposure, measurement, &round);
    const UnitView& view = core_.unit(measurement.unit).view;
    if (view.target && view.error_um) errors_um.push_back(*view.error_um);
  }
  Summarise(std::move(errors_um), &round);
  if (look_ != Look::kBefore) view_.measured.push_back(round);
  // Where nobody was found there is nothing to wait for.
  measured_batch_ = core_.out->rows.empty() ? 0 : core_.batch_now();
  is_locating_ = true;
  if (!IsLocating()) LookIsOver();
}

void ConfigurationExecutor::ExposureFailed(const Error& error) {
  core_.Raise(Severity::kWarning, {}, {},
              "exposure " + std::to_string(exposure_) + ": " + error.text);
  if (++exposures_refused_ < kExposuresRefusedMax) {
    AskForExposure();
    return;
  }
  const std::string tried = std::to_string(exposures_refused_) +
                            " exposures could not be used, the last because " + error.text;
  if (look_ == Look::kBefore) {
    core_.Raise(Severity::kWarning, {}, {}, "units of unknown place were not looked for: " + tried);
    Gather();
    return;
  }
  core_.Raise(Severity::kError, {}, {},
              "configuration " + std::to_string(view_.id) + " is not measured: " + tried);
  view_.not_measured = tried;
  if (look_ == Look::kOnly)
    for (std::uint32_t n = 0; n < core_.units.size(); ++n)
      if (core_.units[n].view.outcome == TargetOutcome::kPending)
        SetOutcome({n}, TargetOutcome::kUnmeasured, "not measured: " + tried);
  FinishWhenDurable(look_ == Look::kOnly ? ConfigurationState::kFailed : ConfigurationState::kDone);
}

bool ConfigurationExecutor::IsLocating() const {
  return std::ranges::any_of(core_.units,
                             [](const UnitRecord& unit) { return unit.locating.has_value(); });
}

/// What was found is taken in, the counts of units that were lost included.
void ConfigurationExecutor::LookIsOver() {
  is_locating_ = false;
  if (!core_.out->rows.empty()) measured_batch_ = core_.batch_now();
  switch (look_) {
    case Look::kBefore:
      Gather();
      return;
    case Look::kAfter:
      if (corrections_left_ == 0 || !Correct()) FinishWhenDurable(ConfigurationState::kDone);
      return;
    case Look::kOnly:
      for (std::uint32_t n = 0; n < core_.units.size(); ++n) {
        const UnitView& view = core_.units[n].view;
        const bool found = view.knowledge[0].witness == Witness::kMeasured &&
                           view.knowledge[1].witness == Witness::kMeasured && view.measurement &&
                           IsPut(*view.measurement);
        if (view.outcome != TargetOutcome::kPending) continue;
        SetOutcome({n}, found ? TargetOutcome::kArrived : TargetOutcome::kUnmeasured,
                   found ? "" : WhyNotMeasured({n}));
      }
      FinishWhenDurable(ConfigurationState::kDone);
      return;
  }
}

void ConfigurationExecutor::TakeMeasurement(const ExposureFindings& exposure,
                                            const Measurement& measurement, MeasuredRound* round) {
  const PositionerIndex i = measurement.unit;
  UnitView& view = core_.unit(i).view;
  const bool put = IsPut(measurement.status) && measurement.place;
  view.measurement = measurement.status;
  TakeFibreCarrier(i, measurement);
  view.error_um.reset();
  core_.Changed(i);
  if (look_ == Look::kBefore) {
    // It is still to move: how far it is from its target is no error.
  } else if (put && view.target) {
    const PointFp wanted = FibreAt(core_.layout.unit(i), core_.drives[i.value], *view.target);
    view.error_um =
        1e3 * std::hypot(measurement.x_mm - wanted.x_mm, measurement.y_mm - wanted.y_mm);
    ++round->measured;
    if (measurement.source == MeasurementSource::kSensors) ++round->by_sensors;
    if (*view.error_um <= measure_->tolerance_um) ++round->within_tolerance;
  } else if (view.target) {
    ++round->unknown;
  }
  if (view.serial.value != 0) core_.Note(RowOf(exposure, measurement));
  if (put && !measure_->observe && view.phase == UnitPhase::kReady) {
    if (IsPlace(view.knowledge))
      core_.See(i, *measurement.place, measurement.source);
    else
      sessions_.Locate(i, *measurement.place);
  }
  if (look_ == Look::kAfter && measurement.status == MeasurementStatus::kDidNotMove &&
      stood_[i.value] && view.target && *stood_[i.value] != *view.target)
    core_.Raise(Severity::kWarning, i, {},
                core_.NameOf(i) + " did not move, though it reports that it did");
  if (measurement.status == MeasurementStatus::kSwapped && measurement.other)
    core_.Raise(Severity::kError, i, {},
                core_.NameOf(i) + " stands where " + core_.NameOf(*measurement.other) +
                    " was sent: the two are confused in the layout or on the bus");
}

/// What its own sensors say; who of them is not to be believed is told when it is found out.
void ConfigurationExecutor::TakeFibreCarrier(PositionerIndex i, const Measurement& measurement) {
  UnitView& view = core_.unit(i).view;
  view.source = measurement.source;
  view.covariance = measurement.covariance;
  const std::string before = view.carrier && !view.carrier->trusted ? view.carrier->verdict : "";
  view.carrier = measurement.carrier;
  if (view.carrier && !view.carrier->trusted && view.carrier->verdict != before)
    core_.Raise(Severity::kWarning, i, {},
                core_.NameOf(i) + " is not measured by its sensors: " + view.carrier->verdict);
}

MeasurementRow ConfigurationExecutor::RowOf(const ExposureFindings& exposure,
                                            const Measurement& measurement) const {
  const PositionerIndex i = measurement.unit;
  const UnitView& view = core_.units[i.value].view;
  MeasurementRow row{.exposure = exposure.id,
                     .configuration = view_.id,
                     .serial = view.serial,
                     .unit = core_.layout.unit(i).id,
                     .status = measurement.status,
                     .other = {},
                     .x_mm = measurement.x_mm,
                     .y_mm = measurement.y_mm,
                     .covariance = measurement.covariance,
                     .place = measurement.place,
                     .target_fp = {},
                     .error_um = view.error_um,
                     .target_id = {},
                     .delay_s = {},
                     .source = measurement.source,
                     .carrier = measurement.carrier};
  if (measurement.other) row.other = core_.layout.unit(*measurement.other).id;
  if (view.target && look_ != Look::kBefore)
    row.target_fp = FibreAt(core_.layout.unit(i), core_.drives[i.value], *view.target);
  if (row.target_fp && !target_ids_.empty()) row.target_id = target_ids_[i.value];
  if (ended_[i.value] != kNever && std::isfinite(exposure.after_request_s))
    row.delay_s = (exposure_asked_ - ended_[i.value]).seconds() + exposure.after_request_s;
  return row;
}

bool ConfigurationExecutor::IsWithinTolerance(PositionerIndex i) const {
  const UnitView& view = core_.units[i.value].view;
  return view.error_um && *view.error_um <= measure_->tolerance_um;
}

std::string ConfigurationExecutor::WhyNotMeasured(PositionerIndex i) const {
  const UnitView& view = core_.units[i.value].view;
  if (!view_.not_measured.empty()) return "not measured: " + view_.not_measured;
  if (view.phase != UnitPhase::kReady) return "not measured: it " + core_.TroubleOf(i);
  if (!view.measurement) return "not measured: not looked for";
  if (IsPut(*view.measurement))
    return IsPlace(view.knowledge)
               ? "not measured: it was seen, and has moved since"
               : "not measured: its fibre was seen, but more than one pose of its arms is possible";
  std::string why = std::string("not measured: ") + Name(*view.measurement);
  if (view.measurement == MeasurementStatus::kSensorsDoubted && view.carrier)
    why += " (" + view.carrier->verdict + ")";
  return why;
}

/// Takes back the arrival of whoever was to be measured and is not known to be within the
/// tolerance. A configuration that is only observed asks for the look alone.
void ConfigurationExecutor::JudgeMeasured() {
  if (!measure_ || view_.kind != ConfigurationKind::kApply) return;
  const bool looked = !view_.measured.empty() && view_.not_measured.empty();
  for (std::uint32_t n = 0; n < core_.units.size(); ++n) {
    const UnitView& view = core_.units[n].view;
    if (view.outcome != TargetOutcome::kArrived || !view.target) continue;
    if (measure_->observe ? looked : IsWithinTolerance({n})) continue;
    Reopen({n});
    if (!measure_->observe && view.error_um)
      SetOutcome({n}, TargetOutcome::kFailed,
                 Micrometres(*view.error_um) + " from its target as measured, more than " +
                     Micrometres(measure_->tolerance_um) + WhyItStays({n}));
    else if (end_ == ConfigurationState::kStopped)
      SetOutcome({n}, TargetOutcome::kStopped, failure_ + ", before it was measured");
    else
      SetOutcome({n}, TargetOutcome::kUnmeasured, WhyNotMeasured({n}));
  }
}

/// How far it was off says nothing of where it goes now.
void ConfigurationExecutor::SendAgain(PositionerIndex i) {
  Reopen(i);
  core_.unit(i).view.error_um.reset();
}

/// Takes its arrival back: the camera knows better.
void ConfigurationExecutor::Reopen(PositionerIndex i) {
  UnitView& view = core_.unit(i).view;
  std::erase_if(arrivals_, [&](const Arrival& arrival) { return arrival.unit == i; });
  if (view.outcome != TargetOutcome::kArrived) return;
  --*CountOf(view.outcome);
  view.outcome = TargetOutcome::kPending;
  core_.Changed(i);
}

}  // namespace focalfleet
