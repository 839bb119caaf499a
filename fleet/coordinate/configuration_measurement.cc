#include "fleet/coordinate/configuration_measurement.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "fleet/coordinate/count_setting.h"
#include "fleet/coordinate/sensor_reading.h"
#include "fleet/coordinate/unit_knowledge.h"
#include "fleet/kinematics.h"

namespace focalfleet {
namespace {

constexpr int kExposuresRefusedMax = 3;

// A unit's sensors are read so long after the last motion: a board averages over 26 ms.
constexpr DurationNs kSensorsSettle = Milliseconds(50);

bool IsLocating(const UnitTable& units) {
  return std::ranges::any_of(units.all(),
                             [](const UnitRecord& unit) { return unit.locating.has_value(); });
}

}  // namespace

void Summarise(std::vector<double> errors_um, MeasuredRound* round) {
  if (errors_um.empty()) return;
  double sum = 0;
  for (const double um : errors_um) sum += um * um;
  round->rms_um = std::sqrt(sum / static_cast<double>(errors_um.size()));
  std::ranges::sort(errors_um);
  round->median_um = errors_um[errors_um.size() / 2];
  round->worst_um = errors_um.back();
}

void ConfigurationMeasurement::Begin() {
  measured_batch_ = 0;
  exposures_refused_ = 0;
  looked_first_ = false;
  is_locating_ = false;
}

bool ConfigurationMeasurement::LooksFirst() const {
  const auto& measure = configuration_.measure;
  if (!measure || measure->observe || looked_first_ || !fleet_.config.has_camera) return false;
  return std::ranges::any_of(fleet_.units.all(), [](const UnitRecord& unit) {
    return unit.view.outcome == TargetOutcome::kPending && unit.view.enabled &&
           unit.view.phase == UnitPhase::kReady && !IsPlace(unit.view.knowledge);
  });
}

void ConfigurationMeasurement::Start(Look look) {
  look_ = look;
  looked_first_ = true;
  exposures_refused_ = 0;
  exposure_ = 0;  // asked for when the arrivals are durable
  sensing_ = false;
  is_locating_ = false;
  sense_at_ = fleet_.config.reads_sensors ? fleet_.now() + kSensorsSettle : kNever;
  configuration_.due = fleet_.config.reads_sensors ? sense_at_ : fleet_.now();
  configuration_.SetPhase(ConfigurationPhase::kMeasuring);
}

ConfigurationMeasurement::Progress ConfigurationMeasurement::Advance() {
  if (exposure_ == 0 && !configuration_.outcomes.IsAnyNoted() && SensorsAreRead()) AskForExposure();
  return is_locating_ ? EndWhenLocated() : Progress::kUnderWay;
}

// The readings of all units with sensors are there, as far as they come. A unit may be read anew
// meanwhile, because it did not hear the host for a while. Such a unit is awaited, and asked as
// soon as it is known again.
bool ConfigurationMeasurement::SensorsAreRead() {
  if (sense_at_ == kNever) return true;
  if (fleet_.now() < sense_at_) return false;
  const bool first = !std::exchange(sensing_, true);
  if (first) sense_until_ = fleet_.now() + fleet_.config.silence_limit;
  const bool patient = fleet_.now() < sense_until_;
  bool read = true;
  for (std::uint32_t n = 0; n < fleet_.units.size(); ++n) {
    if (fleet_.layout.unit({n}).sensors == 0) continue;
    UnitRecord& unit = fleet_.units[{n}];
    if (first) unit.sensing = {};  // of an exposure before
    const bool is_ready = unit.view.phase == UnitPhase::kReady;
    if (is_ready && !unit.sensing.begun() && (first || patient)) Sense(fleet_, {n});
    if (is_ready ? unit.sensing.under_way() : patient && unit.view.phase == UnitPhase::kIdentifying)
      read = false;
  }
  return read;
}

void ConfigurationMeasurement::AskForExposure() {
  exposure_ = fleet_.ledger.TakeExposureId();
  exposure_asked_ = fleet_.now();
  ExposureJob job{.id = exposure_,
                  .since = fleet_.now(),
                  .expected = {},
                  .before = {},
                  .reported = {},
                  .seen = {}};
  for (std::uint32_t n = 0; n < fleet_.units.size(); ++n) {
    const UnitRecord& unit = fleet_.units[{n}];
    job.expected.push_back(unit.view.knowledge);
    job.before.push_back(look_ == Look::kAfter ? configuration_[{n}].stood : std::nullopt);
    std::optional<Pose> says;
    if (unit.view.phase == UnitPhase::kReady && !IsPlace(unit.view.knowledge))
      says = fleet_.units.PlaceAt({n}, unit.reading.position);
    job.reported.push_back(says);
    job.seen.push_back(unit.view.offset != Pose{} ? 1 : 0);
    job.wanted.push_back(unit.view.target && unit.view.phase == UnitPhase::kReady ? 1 : 0);
    if (fleet_.config.reads_sensors) job.readings.push_back(unit.sensing.reading);
  }
  job.tolerance_um = configuration_.measure->tolerance_um;
  fleet_.out().exposure = std::move(job);
}

ConfigurationMeasurement::Progress ConfigurationMeasurement::OnExposure(const ExposureDone& done) {
  if (done.id != exposure_) return Progress::kUnderWay;  // of a configuration that was stopped
  if (!done.exposure) return Refuse(done.exposure.error());
  ConfigurationView& view = configuration_.view;
  view.not_measured.clear();
  MeasuredRound round{.exposure = exposure_, .camera = done.exposure->camera};
  fleet_.ledger.alarms().End(AlarmName::kExposureRefused, {}, {});
  if (done.exposure->camera_trouble.empty()) {
    fleet_.ledger.alarms().End(AlarmName::kCameraLate, {}, {});
    fleet_.ledger.alarms().End(AlarmName::kCameraFailed, {}, {});
  } else {
    fleet_.ledger.alarms().Raise(AlarmName::kCameraFailed, {}, {},
                                 "exposure " + std::to_string(exposure_) + ": " +
                                     done.exposure->camera_trouble +
                                     "; units are measured by their own sensors alone");
  }
  std::vector<double> errors_um;
  for (const Measurement& measurement : done.exposure->measurements) {
    Take(*done.exposure, measurement, &round);
    const UnitView& unit = fleet_.units[measurement.unit].view;
    if (unit.target && unit.error_um) errors_um.push_back(*unit.error_um);
  }
  Summarise(std::move(errors_um), &round);
  if (look_ != Look::kBefore) view.measured.push_back(round);
  // Where no unit was found there is nothing to wait for.
  measured_batch_ = fleet_.out().rows.empty() ? 0 : fleet_.ledger.batch_now();
  is_locating_ = true;
  return EndWhenLocated();
}

ConfigurationMeasurement::Progress ConfigurationMeasurement::EndWhenLocated() {
  if (IsLocating(fleet_.units)) return Progress::kUnderWay;
  is_locating_ = false;
  if (!fleet_.out().rows.empty()) measured_batch_ = fleet_.ledger.batch_now();
  return Progress::kTaken;
}

ConfigurationMeasurement::Progress ConfigurationMeasurement::Refuse(const Error& error) {
  // A camera that answers, however badly, is not late.
  const bool late = error.code == ErrorCode::kUnavailable;
  if (!late) fleet_.ledger.alarms().End(AlarmName::kCameraLate, {}, {});
  fleet_.ledger.alarms().Raise(late ? AlarmName::kCameraLate : AlarmName::kExposureRefused, {}, {},
                               "exposure " + std::to_string(exposure_) + ": " + error.text);
  if (++exposures_refused_ < kExposuresRefusedMax) {
    AskForExposure();
    return Progress::kUnderWay;
  }
  failure_ = std::to_string(exposures_refused_) +
             " exposures could not be used, the last because " + error.text;
  if (look_ == Look::kBefore) {
    fleet_.ledger.alarms().Raise(AlarmName::kLostNotSought, {}, {},
                                 "units of unknown place were not looked for: " + failure_);
  } else {
    fleet_.ledger.alarms().Raise(AlarmName::kConfigurationNotMeasured, {}, {},
                                 "configuration " + std::to_string(configuration_.view.id) +
                                     " is not measured: " + failure_);
    configuration_.view.not_measured = failure_;
  }
  return Progress::kFailed;
}

void ConfigurationMeasurement::Take(const ExposureFindings& exposure,
                                    const Measurement& measurement, MeasuredRound* round) {
  const PositionerIndex i = measurement.unit;
  const ApplyCommand::Measure& measure = *configuration_.measure;
  UnitView& view = fleet_.units[i].view;
  const bool put = IsPut(measurement.status) && measurement.place;
  view.measurement = measurement.status;
  TakeFibreCarrier(i, measurement);
  view.error_um.reset();
  fleet_.units.Changed(i);
  if (look_ == Look::kBefore) {
    // The unit is still to move: its distance from its target is no error.
  } else if (put && view.target) {
    const PointFp wanted = FibreAt(fleet_.layout.unit(i), fleet_.drive(i), *view.target);
    view.error_um =
        1e3 * std::hypot(measurement.x_mm - wanted.x_mm, measurement.y_mm - wanted.y_mm);
    ++round->measured;
    if (measurement.source == MeasurementSource::kSensors) ++round->by_sensors;
    if (*view.error_um <= measure.tolerance_um) ++round->within_tolerance;
  } else if (view.target) {
    ++round->unknown;
  }
  if (view.serial.value != 0) fleet_.ledger.Note(RowOf(exposure, measurement));
  if (put && !measure.observe && view.phase == UnitPhase::kReady) {
    if (IsPlace(view.knowledge))
      See(fleet_, i, *measurement.place, measurement.source);
    else
      Locate(fleet_, i, *measurement.place);
  }
  WarnOf(measurement);
}

void ConfigurationMeasurement::WarnOf(const Measurement& measurement) const {
  const PositionerIndex i = measurement.unit;
  const std::optional<Pose>& stood = configuration_[i].stood;
  const std::optional<Pose>& target = fleet_.units[i].view.target;
  if (look_ == Look::kAfter && measurement.status == MeasurementStatus::kDidNotMove && stood &&
      target && *stood != *target)
    fleet_.ledger.alarms().Raise(
        AlarmName::kUnitDidNotMove, i, {},
        fleet_.units.NameOf(i) + " did not move, though it reports that it did");
  if (measurement.status == MeasurementStatus::kSwapped && measurement.other)
    fleet_.ledger.alarms().Raise(AlarmName::kUnitsSwapped, i, {},
                                 fleet_.units.NameOf(i) + " stands where " +
                                     fleet_.units.NameOf(*measurement.other) +
                                     " was sent: the two are confused in the layout or on the bus");
}

// A unit whose own sensors cannot be believed is reported once, when that is found.
void ConfigurationMeasurement::TakeFibreCarrier(PositionerIndex i,
                                                const Measurement& measurement) const {
  UnitView& view = fleet_.units[i].view;
  view.source = measurement.source;
  view.covariance = measurement.covariance;
  const std::string before = view.carrier && !view.carrier->trusted ? view.carrier->verdict : "";
  view.carrier = measurement.carrier;
  if (view.carrier && view.carrier->trusted)
    fleet_.ledger.alarms().End(AlarmName::kSensorsDoubted, i, {});
  if (view.carrier && !view.carrier->trusted && view.carrier->verdict != before)
    fleet_.ledger.alarms().Raise(
        AlarmName::kSensorsDoubted, i, {},
        fleet_.units.NameOf(i) + " is not measured by its sensors: " + view.carrier->verdict);
}

MeasurementRow ConfigurationMeasurement::RowOf(const ExposureFindings& exposure,
                                               const Measurement& measurement) const {
  const PositionerIndex i = measurement.unit;
  const UnitView& view = fleet_.units[i].view;
  const ConfigurationUnit& unit = configuration_[i];
  MeasurementRow row{.exposure = exposure.id,
                     .configuration = configuration_.view.id,
                     .serial = view.serial,
                     .unit = fleet_.layout.unit(i).id,
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
  if (measurement.other) row.other = fleet_.layout.unit(*measurement.other).id;
  if (view.target && look_ != Look::kBefore)
    row.target_fp = FibreAt(fleet_.layout.unit(i), fleet_.drive(i), *view.target);
  if (row.target_fp) row.target_id = unit.target_id;
  if (unit.ended != kNever && std::isfinite(exposure.after_request_s))
    row.delay_s = (exposure_asked_ - unit.ended).seconds() + exposure.after_request_s;
  return row;
}

}  // namespace focalfleet
