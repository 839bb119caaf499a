#include "daemon/dds/sample_conversion.h"

#include <cmath>
#include <cstring>
#include <string_view>

namespace focalfleet::dds_internal {
namespace {

// The codes that the IDL documents are the enumerators of the C++ types.
static_assert(focalfleet_WITNESS_MEASURED == static_cast<int>(Witness::kMeasured));
static_assert(focalfleet_SOURCE_SENSORS == static_cast<int>(MeasurementSource::kSensors));
static_assert(focalfleet_PHASE_SILENT == static_cast<int>(UnitPhase::kSilent));
static_assert(focalfleet_PHASE_MOVING == static_cast<int>(UnitPhase::kMoving));
static_assert(focalfleet_STATE_HOST_LOST == static_cast<int>(UnitState::kHostLost));
static_assert(focalfleet_FAULT_DRIVER == static_cast<int>(FaultCode::kDriver));
static_assert(focalfleet_OUTCOME_FAILED == static_cast<int>(TargetOutcome::kFailed));
static_assert(focalfleet_OUTCOME_UNMEASURED == static_cast<int>(TargetOutcome::kUnmeasured));
static_assert(focalfleet_LINK_DOWN == static_cast<int>(LinkState::kDown));
static_assert(focalfleet_CONFIGURATION_FAILED == static_cast<int>(ConfigurationState::kFailed));
static_assert(focalfleet_SEVERITY_ERROR == static_cast<int>(Severity::kError));
static_assert(sizeof(focalfleet_FleetStatus::units_by_phase) / sizeof(std::uint32_t) ==
              kUnitPhaseCount);
static_assert(sizeof(focalfleet_FleetStatus::units_by_witness) / sizeof(std::uint32_t) ==
              kWitnessCount);

constexpr MeasurementSource kLastSource = MeasurementSource::kSensors;
constexpr Witness kLastWitness = Witness::kMeasured;
constexpr UnitPhase kLastPhase = static_cast<UnitPhase>(kUnitPhaseCount - 1);
constexpr UnitState kLastUnitState = static_cast<UnitState>(kUnitStateCount - 1);
constexpr FaultCode kLastFault = static_cast<FaultCode>(kFaultCodeCount - 1);
constexpr LinkState kLastLink = LinkState::kDown;
constexpr ConfigurationState kLastState = ConfigurationState::kFailed;
constexpr Severity kLastSeverity = Severity::kError;

template <class Enum>
constexpr std::uint8_t Code(Enum value) {
  return static_cast<std::uint8_t>(value);
}

template <class Enum>
bool Take(std::uint8_t code, Enum last, Enum* value) {
  *value = static_cast<Enum>(code);
  return code <= static_cast<std::uint8_t>(last);
}

template <std::size_t kSize>
void CopyText(std::string_view text, char (&out)[kSize]) {
  std::size_t length = std::min(text.size(), text.find('\0'));
  if (length > kSize - 1) {
    length = kSize - 1;
    // The cut must not fall inside a character, whose bytes after the first are 10xxxxxx.
    while (length > 0 && (static_cast<unsigned char>(text[length]) & 0xc0u) == 0x80u) --length;
  }
  std::memcpy(out, text.data(), length);
  std::memset(out + length, 0, kSize - length);
}

template <std::size_t kSize>
std::string TextOf(const char (&text)[kSize]) {
  return {text, strnlen(text, kSize)};
}

}  // namespace

const char* Flaw(const UnitStatusValue& value) {
  if (value.witness[0] > kLastWitness || value.witness[1] > kLastWitness) return "witness";
  if (value.phase > kLastPhase) return "phase";
  if (value.reported_state > kLastUnitState) return "reported state";
  if (value.fault > kLastFault) return "fault";
  if (value.outcome > kLastTargetOutcome) return "outcome";
  return nullptr;
}
template <class Sample>
void PutUpload(const UploadView& upload, Sample* sample) {
  sample->upload_predicted_s = upload.predicted_s;
  sample->upload_s = upload.measured_s;
  sample->upload_bits_predicted = upload.bits_predicted;
  sample->upload_bits = upload.bits;
}
template <class Sample>
UploadView UploadOf(const Sample& sample) {
  return {.bits_predicted = sample.upload_bits_predicted,
          .bits = sample.upload_bits,
          .predicted_s = sample.upload_predicted_s,
          .measured_s = sample.upload_s};
}

const char* Flaw(const UnitOrientationValue& value) {
  return value.source > kLastSource ? "source" : nullptr;
}
const char* Flaw(const BusStatusValue& value) {
  return value.view.link > kLastLink ? "link" : nullptr;
}
const char* Flaw(const ConfigurationProgressValue& value) {
  return value.view.state > kLastState ? "state" : nullptr;
}
const char* Flaw(const AlarmValue& value) {
  return value.row.severity > kLastSeverity ? "severity" : nullptr;
}

void ToSample(const UnitStatusValue& value, focalfleet_UnitStatus* sample) {
  sample->time_ns = value.at.ns;
  sample->theta_low_deg = value.low_deg[0];
  sample->theta_high_deg = value.high_deg[0];
  sample->phi_low_deg = value.low_deg[1];
  sample->phi_high_deg = value.high_deg[1];
  sample->x_fp_mm = value.x_fp_mm;
  sample->y_fp_mm = value.y_fp_mm;
  sample->theta_target_deg = value.target_deg[0];
  sample->phi_target_deg = value.target_deg[1];
  sample->unit_id = value.unit.value;
  sample->serial = value.serial.value;
  sample->bound_serial = value.bound_serial.value;
  sample->bus_id = value.bus.value;
  sample->move = value.move.value;
  sample->node_id = value.node.value;
  sample->phase = Code(value.phase);
  sample->theta_witness = Code(value.witness[0]);
  sample->phi_witness = Code(value.witness[1]);
  sample->reported_state = Code(value.reported_state);
  sample->fault = Code(value.fault);
  sample->outcome = Code(value.outcome);
  sample->enabled = value.enabled;
}

void ToSample(const UnitOrientationValue& value, focalfleet_UnitOrientation* sample) {
  const FibreCarrierReading& carrier = value.carrier;
  const auto number = [&](double known) { return carrier.solved ? known : kNoNumber; };
  sample->time_ns = value.at.ns;
  sample->alpha_deg = number(carrier.angles_deg[0]);
  sample->beta_deg = number(carrier.angles_deg[1]);
  sample->gamma_deg = number(carrier.angles_deg[2]);
  sample->cov_aa_deg2 = number(carrier.covariance_deg2[0]);
  sample->cov_ab_deg2 = number(carrier.covariance_deg2[1]);
  sample->cov_ag_deg2 = number(carrier.covariance_deg2[2]);
  sample->cov_bb_deg2 = number(carrier.covariance_deg2[3]);
  sample->cov_bg_deg2 = number(carrier.covariance_deg2[4]);
  sample->cov_gg_deg2 = number(carrier.covariance_deg2[5]);
  sample->x_fp_mm = value.x_fp_mm;
  sample->y_fp_mm = value.y_fp_mm;
  sample->var_x_mm2 = value.covariance.xx;
  sample->cov_xy_mm2 = value.covariance.xy;
  sample->var_y_mm2 = value.covariance.yy;
  sample->unit_id = value.unit.value;
  sample->sensors_used = carrier.used;
  sample->witness = Code(carrier.trusted ? Witness::kMeasured : Witness::kUnknown);
  sample->source = Code(value.source);
  CopyText(carrier.verdict, sample->verdict);
}

void ToSample(const BusStatusValue& value, focalfleet_BusStatus* sample) {
  sample->time_ns = value.at.ns;
  sample->frames_sent = value.view.frames_sent;
  sample->frames_received = value.view.frames_received;
  sample->bits = value.view.bits;
  sample->malformed = value.view.malformed;
  sample->retries = value.view.retries;
  sample->load = value.view.load;
  sample->load_max = value.view.load_max;
  PutUpload(value.view.upload, sample);
  sample->bus_id = value.bus.value;
  sample->link = Code(value.view.link);
}

void ToSample(const FleetStatusValue& value, focalfleet_FleetStatus* sample) {
  sample->time_ns = value.at.ns;
  sample->started_ns = value.started.ns;
  sample->configuration = value.configuration;
  sample->bus_load_max = value.bus_load_max;
  sample->units = value.units;
  sample->enabled = value.enabled;
  std::memcpy(sample->units_by_phase, value.units_by_phase.data(), sizeof sample->units_by_phase);
  std::memcpy(sample->units_by_witness, value.units_by_witness.data(),
              sizeof sample->units_by_witness);
  sample->busy = value.busy;
  sample->store_failing = value.store_failing;
  CopyText(value.version, sample->version);
}

void ToSample(const ConfigurationProgressValue& value, focalfleet_ConfigurationProgress* sample) {
  sample->time_ns = value.at.ns;
  sample->id = value.view.id;
  sample->makespan_predicted_s = value.view.makespan_predicted_s;
  sample->makespan_s = value.view.makespan_s;
  sample->energy_J = value.view.energy_J;
  sample->peak_power_W = value.view.peak_power_W;
  const StartView& starts = value.view.starts;
  const bool known = starts.reported > 0;
  sample->start_skew_s = known ? starts.skew_s : kNoNumber;
  sample->start_skew_bound_s = known ? starts.bound_s : kNoNumber;
  sample->start_skew_allowed_s = known ? starts.allowed_s : kNoNumber;
  sample->starts = starts.begun;
  sample->starts_known = starts.reported;
  PutUpload(value.view.upload, sample);
  sample->frames = value.view.frames;
  sample->round = value.view.round;
  sample->targeted = value.view.counts.targeted;
  sample->arrived = value.view.counts.arrived;
  sample->refused = value.view.counts.refused;
  sample->failed = value.view.counts.failed;
  sample->stopped = value.view.counts.stopped;
  sample->unmeasured = value.view.counts.unmeasured;
  sample->state = Code(value.view.state);
  CopyText(value.view.source, sample->source);
}

void ToSample(const AlarmValue& value, focalfleet_NamedAlarm* sample) {
  sample->time_ns = value.at.ns;
  sample->alarm_id = value.row.id;
  sample->unit_id = value.row.unit ? value.row.unit->value : focalfleet_UNIT_NONE;
  sample->bus_id = value.row.bus ? value.row.bus->value : focalfleet_BUS_NONE;
  sample->severity = Code(value.row.severity);
  CopyText(Name(value.row.name), sample->name);
  CopyText(value.row.text, sample->text);
}

void ToSample(const AuditHeadValue& value, focalfleet_AuditHead* sample) {
  sample->time_ns = value.at.ns;
  CopyText(value.head, sample->head);
}

bool FromSample(const focalfleet_UnitStatus& sample, UnitStatusValue* value) {
  value->at = {sample.time_ns};
  value->low_deg = {sample.theta_low_deg, sample.phi_low_deg};
  value->high_deg = {sample.theta_high_deg, sample.phi_high_deg};
  value->x_fp_mm = sample.x_fp_mm;
  value->y_fp_mm = sample.y_fp_mm;
  value->target_deg = {sample.theta_target_deg, sample.phi_target_deg};
  value->unit = {sample.unit_id};
  value->serial = {sample.serial};
  value->bound_serial = {sample.bound_serial};
  value->bus = {sample.bus_id};
  value->node = {sample.node_id};
  value->move = {sample.move};
  value->enabled = sample.enabled;
  return Take(sample.phase, kLastPhase, &value->phase) &&
         Take(sample.theta_witness, kLastWitness, &value->witness[0]) &&
         Take(sample.phi_witness, kLastWitness, &value->witness[1]) &&
         Take(sample.reported_state, kLastUnitState, &value->reported_state) &&
         Take(sample.fault, kLastFault, &value->fault) &&
         Take(sample.outcome, kLastTargetOutcome, &value->outcome);
}

bool FromSample(const focalfleet_UnitOrientation& sample, UnitOrientationValue* value) {
  FibreCarrierReading& carrier = value->carrier;
  value->at = {sample.time_ns};
  carrier.solved = !std::isnan(sample.alpha_deg);
  carrier.angles_deg = {sample.alpha_deg, sample.beta_deg, sample.gamma_deg};
  carrier.covariance_deg2 = {sample.cov_aa_deg2, sample.cov_ab_deg2, sample.cov_ag_deg2,
                             sample.cov_bb_deg2, sample.cov_bg_deg2, sample.cov_gg_deg2};
  carrier.used = sample.sensors_used;
  carrier.verdict = TextOf(sample.verdict);
  value->x_fp_mm = sample.x_fp_mm;
  value->y_fp_mm = sample.y_fp_mm;
  value->covariance = {sample.var_x_mm2, sample.cov_xy_mm2, sample.var_y_mm2};
  value->unit = {sample.unit_id};
  Witness witness = Witness::kUnknown;
  if (!Take(sample.witness, kLastWitness, &witness)) return false;
  carrier.trusted = witness == Witness::kMeasured;
  return Take(sample.source, kLastSource, &value->source);
}

bool FromSample(const focalfleet_BusStatus& sample, BusStatusValue* value) {
  value->at = {sample.time_ns};
  value->view.frames_sent = sample.frames_sent;
  value->view.frames_received = sample.frames_received;
  value->view.bits = sample.bits;
  value->view.malformed = sample.malformed;
  value->view.retries = sample.retries;
  value->view.load = sample.load;
  value->view.load_max = sample.load_max;
  value->view.upload = UploadOf(sample);
  value->bus = {sample.bus_id};
  return Take(sample.link, kLastLink, &value->view.link);
}

bool FromSample(const focalfleet_FleetStatus& sample, FleetStatusValue* value) {
  value->at = {sample.time_ns};
  value->started = {sample.started_ns};
  value->configuration = sample.configuration;
  value->bus_load_max = sample.bus_load_max;
  value->units = sample.units;
  value->enabled = sample.enabled;
  std::memcpy(value->units_by_phase.data(), sample.units_by_phase, sizeof sample.units_by_phase);
  std::memcpy(value->units_by_witness.data(), sample.units_by_witness,
              sizeof sample.units_by_witness);
  value->busy = sample.busy;
  value->store_failing = sample.store_failing;
  value->version = TextOf(sample.version);
  return true;
}

bool FromSample(const focalfleet_ConfigurationProgress& sample, ConfigurationProgressValue* value) {
  value->at = {sample.time_ns};
  value->view.id = sample.id;
  value->view.makespan_predicted_s = sample.makespan_predicted_s;
  value->view.makespan_s = sample.makespan_s;
  value->view.energy_J = sample.energy_J;
  value->view.peak_power_W = sample.peak_power_W;
  value->view.starts = {.begun = sample.starts, .reported = sample.starts_known};
  if (sample.starts_known > 0) {
    value->view.starts.skew_s = sample.start_skew_s;
    value->view.starts.bound_s = sample.start_skew_bound_s;
    value->view.starts.allowed_s = sample.start_skew_allowed_s;
  }
  value->view.upload = UploadOf(sample);
  value->view.frames = sample.frames;
  value->view.round = sample.round;
  value->view.counts.targeted = sample.targeted;
  value->view.counts.arrived = sample.arrived;
  value->view.counts.refused = sample.refused;
  value->view.counts.failed = sample.failed;
  value->view.counts.stopped = sample.stopped;
  value->view.counts.unmeasured = sample.unmeasured;
  value->view.source = TextOf(sample.source);
  return Take(sample.state, kLastState, &value->view.state);
}

bool FromSample(const focalfleet_NamedAlarm& sample, AlarmValue* value) {
  value->at = {sample.time_ns};
  value->row.id = sample.alarm_id;
  value->row.unit.reset();
  value->row.bus.reset();
  if (sample.unit_id != focalfleet_UNIT_NONE) value->row.unit = UnitId{sample.unit_id};
  if (sample.bus_id != focalfleet_BUS_NONE) value->row.bus = BusId{sample.bus_id};
  value->row.text = TextOf(sample.text);
  value->row.name = AlarmNameOf(TextOf(sample.name));  // one of a later version has none here
  return Take(sample.severity, kLastSeverity, &value->row.severity);
}

bool FromSample(const focalfleet_AuditHead& sample, AuditHeadValue* value) {
  value->at = WallTime{sample.time_ns};
  value->head = TextOf(sample.head);
  return true;
}

}  // namespace focalfleet::dds_internal
