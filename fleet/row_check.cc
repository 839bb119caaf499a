#include "fleet/row_check.h"

#include <cmath>
#include <cstdint>
#include <limits>

#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

constexpr const char* kNoSerial = "it has no serial number";

/// The store counts in signed 64-bit numbers, and keeps the next free one.
bool IsNumber(std::uint64_t id) { return id < static_cast<std::uint64_t>(INT64_MAX); }

/// A count is stored as turns and vector: the turns must be a 32-bit number.
bool FitsTurns(std::int64_t count, std::int64_t subdivision) {
  const std::int64_t turns = (count < 0 ? count - subdivision + 1 : count) / subdivision;
  return turns >= INT32_MIN && turns <= INT32_MAX;
}

struct FlawOf {
  const char* operator()(const VectorRow& row) const {
    if (row.serial.value == 0) return kNoSerial;
    if (row.origin > kLastOrigin) return "its origin does not exist";
    for (std::size_t a = 0; a < kAxisCount; ++a) {
      const AxisKnowledge& knowledge = row.knowledge[a];
      if (const char* flaw = Flaw(knowledge)) return flaw;
      if (knowledge.witness >= Witness::kPredicted && row.subdivision[a] != 0 &&
          !FitsTurns(std::int64_t{knowledge.low} - row.offset[a], row.subdivision[a]))
        return "its turns are no 32-bit number";
    }
    return nullptr;
  }

  const char* operator()(const MeasurementRow& row) const {
    if (row.serial.value == 0) return kNoSerial;
    if (!IsNumber(row.exposure) || !IsNumber(row.configuration)) return "its number is too large";
    if (row.status > kLastMeasurementStatus) return "its status does not exist";
    if (row.source > kLastMeasurementSource) return "its source does not exist";
    const auto& [xx, xy, yy] = row.covariance;
    for (const double value :
         {row.x_mm, row.y_mm, xx, xy, yy, row.delay_s.value_or(0), row.error_um.value_or(0),
          row.target_fp ? row.target_fp->x_mm : 0, row.target_fp ? row.target_fp->y_mm : 0})
      if (!std::isfinite(value)) return "it is not finite";
    if (xx < 0 || yy < 0) return "its variance is negative";
    return row.carrier ? Flaw(*row.carrier) : nullptr;
  }

  const char* operator()(const IntentRow& row) const {
    if (row.serial.value == 0) return kNoSerial;
    for (const AxisKnowledge& hull : row.hull)
      if (hull.low > hull.high) return "low is above high";
    return IsNumber(row.configuration) ? nullptr : "its configuration is too large";
  }

  const char* operator()(const IntentEndRow& row) const {
    return row.end > kLastIntentEnd ? "its end does not exist" : nullptr;
  }

  const char* operator()(const BindingRow&) const { return nullptr; }
  const char* operator()(const EnableRow&) const { return nullptr; }

  const char* operator()(const ParameterRow& row) const {
    if (row.serial.value == 0) return kNoSerial;
    return row.parameter > kLastParameter || row.axis > Axis::kPhi || row.origin > kLastOrigin
               ? "its axis, parameter or origin does not exist"
               : nullptr;
  }

  const char* operator()(const TuningRow& row) const { return Flaw(row); }

  const char* operator()(const ConfigurationRow& row) const {
    return row.state > kLastConfigurationState || !IsNumber(row.id)
               ? "its state or id does not exist"
               : nullptr;
  }

  const char* operator()(const AlarmRow& row) const {
    return row.severity > kLastSeverity || row.name > kLastAlarmName || !IsNumber(row.id)
               ? "its severity, name or id does not exist"
               : nullptr;
  }

  const char* operator()(const AlarmEndRow& row) const {
    return row.name > kLastAlarmName ? "its name does not exist" : nullptr;
  }

  const char* operator()(const OpenAlarmRow& row) const {
    return row.severity > kLastSeverity || row.name > kLastAlarmName ||
                   row.state > OpenAlarmRow::State::kOver || !IsNumber(row.id) || row.count == 0
               ? "its severity, name, state, count or id does not exist"
               : nullptr;
  }

  const char* operator()(const MuteRow& row) const {
    return row.name == AlarmName::kUnnamed || row.name > kLastAlarmName || row.until_unix_ns < 0
               ? "its name or end does not exist"
               : nullptr;
  }

  const char* operator()(const NextMoveRow&) const { return nullptr; }

  const char* operator()(const ModelRow& row) const {
    return row.entry == 0 || !IsNumber(row.entry) || row.restores >= row.entry
               ? "its entry, or the one that it restores, does not exist"
               : nullptr;
  }
  const char* operator()(const AuditRow& row) const {
    return row.verb.size() > limits::kVerbBytes || row.request.size() > AuditRow::kRequestBytesMax
               ? "its verb or request is too long"
               : nullptr;
  }
};

std::string OfSerial(const char* what, SerialNumber serial) {
  return std::string(what) + " of serial " + std::to_string(serial.value);
}

struct DescriptionOf {
  std::string operator()(const VectorRow& row) const { return OfSerial("vectors", row.serial); }
  std::string operator()(const MeasurementRow& row) const {
    return OfSerial("measurement", row.serial);
  }
  std::string operator()(const IntentRow& row) const { return OfSerial("intent", row.serial); }
  std::string operator()(const IntentEndRow& row) const {
    return OfSerial("end of an intent", row.serial);
  }
  std::string operator()(const BindingRow& row) const {
    return "binding of unit " + std::to_string(row.unit.value) + " to serial " +
           std::to_string(row.serial.value);
  }
  std::string operator()(const EnableRow& row) const {
    return std::string(row.enabled ? "enabling" : "disabling") + " of unit " +
           std::to_string(row.unit.value);
  }
  std::string operator()(const ParameterRow& row) const {
    return OfSerial("parameter", row.serial);
  }
  std::string operator()(const TuningRow& row) const { return OfSerial("tuning", row.serial); }
  std::string operator()(const ConfigurationRow& row) const {
    return "configuration " + std::to_string(row.id);
  }
  std::string operator()(const AlarmRow& row) const { return "alarm " + std::to_string(row.id); }
  std::string operator()(const AlarmEndRow& row) const {
    return std::string("end of ") + Name(row.name);
  }
  std::string operator()(const OpenAlarmRow& row) const {
    return "open alarm " + std::to_string(row.id);
  }
  std::string operator()(const MuteRow& row) const {
    return std::string("muting of ") + Name(row.name);
  }
  std::string operator()(const NextMoveRow&) const { return "next move"; }
  std::string operator()(const ModelRow& row) const {
    return "model change " + std::to_string(row.entry);
  }
  std::string operator()(const AuditRow& row) const { return "audit of " + row.verb; }
};

}  // namespace

const char* Flaw(const AxisKnowledge& knowledge) {
  if (knowledge.witness > Witness::kMeasured) return "its witness does not exist";
  if (knowledge.witness == Witness::kUnknown) return nullptr;
  if (knowledge.low > knowledge.high) return "low is above high";
  if (knowledge.witness != Witness::kInterval && knowledge.low != knowledge.high)
    return "it claims one place and has two";
  return nullptr;
}

const char* Flaw(const TuningRow& row) {
  if (row.serial.value == 0) return kNoSerial;
  if (row.axis > Axis::kPhi || row.mode > kLastMode || row.origin > kLastOrigin)
    return "its axis, mode or origin does not exist";
  if (row.critical < 1 || row.repeat < row.critical || row.repeat > 255)
    return "its n are not 1 <= critical <= repeat <= 255";
  if (row.counter1 == 0 || row.subdivision == 0) return "V_counter1 or subdivision is 0";
  if (!std::isfinite(row.margin) || !(row.load_uNm > 0) || !std::isfinite(row.load_uNm) ||
      !(row.v_bus_V > 0) || !std::isfinite(row.v_bus_V))
    return "margin, load or V_bus is no possible number";
  return nullptr;
}

const char* Flaw(const FibreCarrierReading& carrier) {
  if (carrier.trusted && !carrier.solved) return "it is trusted, and there is none";
  if (!carrier.solved) return nullptr;
  for (const double angle_deg : carrier.angles_deg)
    if (!(std::abs(angle_deg) <= 360)) return "its angle is no angle";
  for (const double covariance_deg2 : carrier.covariance_deg2)
    if (!std::isfinite(covariance_deg2)) return "its covariance is not finite";
  const auto& c = carrier.covariance_deg2;
  return c[0] >= 0 && c[3] >= 0 && c[5] >= 0 ? nullptr : "its variance is negative";
}

const char* Flaw(const Row& row) { return std::visit(FlawOf{}, row); }

std::string Describe(const Row& row) { return std::visit(DescriptionOf{}, row); }

}  // namespace focalfleet
