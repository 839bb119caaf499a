// The records that must not be lost, as rows. The coordinator hands them out as effects. The store
// writes them in order in one transaction a batch, and returns its content at the start. Vectors
// and parameters belong to the serial number; the place on the plate (unit) only binds one.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "fleet/alarm_name.h"
#include "fleet/drive.h"
#include "fleet/knowledge.h"
#include "fleet/measurement.h"
#include "protocol/base/ids.h"
#include "protocol/wire/messages.h"

namespace focalfleet {

enum class Origin : std::uint8_t {
  kFactory,
  kTuning,
  kCampaign,
  kOperator,
  kMove,
  kHoming,
  kCamera,
  kSensors,
  kFound  // a unit of unknown place, where the camera found it; its count was set anew
};
inline constexpr Origin kLastOrigin = Origin::kFound;
constexpr const char* Name(Origin origin) {
  constexpr const char* kNames[] = {"factory", "tuning", "campaign", "operator", "move",
                                    "homing",  "camera", "sensors",  "found"};
  return kNames[static_cast<std::size_t>(origin)];
}

/// The place of a unit now: the mirror of its FLASH and the witness. FLASH has the count of the
/// vectors that were applied. The true place of the axis is `offset` more than that, as a camera
/// last found it. 0: never measured since the count began anew.
struct VectorRow {
  SerialNumber serial;
  UnitKnowledge knowledge;
  Pose offset{};
  std::array<std::uint16_t, kAxisCount> subdivision{};
  MoveId move;  // the last one begun, as the unit reports
  Origin origin = Origin::kFactory;
  bool operator==(const VectorRow&) const = default;
};

/// The intent of a unit's move: durable before any start signal; low..high is all that it may pass.
struct IntentRow {
  std::uint64_t configuration = 0;
  SerialNumber serial;
  UnitId unit;
  MoveId move;
  Pose from{};
  Pose to{};
  std::array<AxisKnowledge, kAxisCount> hull;  // kInterval
  bool operator==(const IntentRow&) const = default;
};

/// The end of an intent, kept as history.
enum class IntentEnd : std::uint8_t {
  kArrived,
  kStopped,
  kFault,
  kNeverBegan,
  kInterrupted,
  kHomed
};
constexpr const char* Name(IntentEnd end) {
  constexpr const char* kNames[] = {"arrived",     "stopped",     "fault",
                                    "never_began", "interrupted", "homed"};
  return kNames[static_cast<std::size_t>(end)];
}
struct IntentEndRow {
  SerialNumber serial;
  MoveId move;
  IntentEnd end = IntentEnd::kArrived;
};

/// The finding of one exposure for one unit.
struct MeasurementRow {
  std::uint64_t exposure = 0;
  std::uint64_t configuration = 0;
  SerialNumber serial;
  UnitId unit;
  MeasurementStatus status = MeasurementStatus::kMissing;
  std::optional<UnitId> other;  // the unit that it is confused with
  double x_mm = 0;              // focal-plane frame
  double y_mm = 0;
  CovarianceFp covariance;
  std::optional<Pose> place;         // vectors; empty: it was given no place
  std::optional<PointFp> target_fp;  // where it had one
  std::optional<double> error_um;    // distance from the target
  std::string target_id;             // as the configuration named it; empty: not named
  std::optional<double> delay_s;     // end of its motion to the exposure; none: not known
  MeasurementSource source = MeasurementSource::kCamera;
  std::optional<FibreCarrierReading> carrier =
      {};  // reading of its own sensors, whatever the source
};

struct BindingRow {  // the hardware that sits at a place
  UnitId unit;
  SerialNumber serial;
  /// the serial that sat there before; 0: none. Not stored: the history has it.
  SerialNumber replaced = {};
};

struct EnableRow {
  UnitId unit;
  bool enabled = true;
  std::string reason;
};

struct ParameterRow {
  SerialNumber serial;
  Axis axis = Axis::kTheta;
  Parameter parameter = Parameter::kCounter1;
  std::int32_t value = 0;
  Origin origin = Origin::kOperator;
  bool operator==(const ParameterRow&) const = default;
};

/// Applies what the row changes of its unit's drive, if anything. A unit has one mode; a tuning
/// writes it for both axes.
void TakeParameter(const ParameterRow& row, UnitDrive* drive);

/// The result of a tuning of an axis: the reason why its parameters are what they are. The
/// parameters themselves are rows of their own, which may be changed later.
struct TuningRow {
  SerialNumber serial;
  Axis axis = Axis::kTheta;
  std::uint16_t critical = 0;  // least n that starts the load from rest
  std::uint16_t repeat = 0;    // the n that was chosen
  double margin = 0;           // growth of the load until that n is critical, as a share
  double load_uNm = 0;         // mean, at the motor shaft
  double v_bus_V = 0;
  std::uint16_t counter1 = 0;
  std::uint16_t subdivision = 0;
  WaveMode mode = WaveMode::kAsymmetric;
  Origin origin = Origin::kTuning;
  bool operator==(const TuningRow&) const = default;
};

enum class ConfigurationState : std::uint8_t {
  kPlanning,
  kUploading,
  kMoving,
  kDone,
  kStopped,
  kFailed
};
constexpr const char* Name(ConfigurationState state) {
  constexpr const char* kNames[] = {"planning", "uploading", "moving", "done", "stopped", "failed"};
  return kNames[static_cast<std::size_t>(state)];
}

constexpr bool IsOver(ConfigurationState state) { return state >= ConfigurationState::kDone; }

/// Units by the outcome of their targets. Units whose outcome is open are in `targeted` alone.
struct OutcomeCounts {
  std::uint32_t targeted = 0;
  std::uint32_t arrived = 0;
  std::uint32_t refused = 0;
  std::uint32_t failed = 0;
  std::uint32_t stopped = 0;
  std::uint32_t unmeasured = 0;
  bool operator==(const OutcomeCounts&) const = default;
};

struct ConfigurationRow {
  std::uint64_t id = 0;
  std::string source;
  ConfigurationState state = ConfigurationState::kPlanning;
  OutcomeCounts counts;
  double makespan_predicted_s = 0;
  double makespan_s = 0;
  double energy_J = 0;
  double peak_power_W = 0;
  // Skew of the starts of its units, where they are known; otherwise NaN.
  double start_skew_s = std::numeric_limits<double>::quiet_NaN();
  double start_skew_bound_s = std::numeric_limits<double>::quiet_NaN();
  bool operator==(const ConfigurationRow&) const = default;
};

struct AlarmRow {
  std::uint64_t id = 0;
  Severity severity = Severity::kWarning;
  std::optional<UnitId> unit;
  std::optional<BusId> bus;
  std::string text;
  AlarmName name = AlarmName::kUnnamed;
  std::uint32_t times = 1;  // equal ones that are folded into it; 0: a new text alone. Not stored
};

/// The condition of an alarm has ended. The shell closes the open alarm; the store has no row.
struct AlarmEndRow {
  AlarmName name = AlarmName::kUnnamed;
  std::optional<UnitId> unit;
  std::optional<BusId> bus;
  std::string reason = {};  // for people, where nobody has seen the condition end
};

/// An alarm from its first raise to its end. Equal alarms (of one name, unit and bus) that are
/// raised meanwhile are counted in it.
struct OpenAlarmRow {
  enum class State : std::uint8_t { kOpen, kAcknowledged, kOver };
  std::uint64_t id = 0;  // of the alarm that opened it
  AlarmName name = AlarmName::kUnnamed;
  Severity severity = Severity::kWarning;
  std::optional<UnitId> unit = {};
  std::optional<BusId> bus = {};
  std::string text = {};  // of the newest
  std::uint32_t count = 1;
  State state = State::kOpen;
  // Times since the Unix epoch; 0: not yet.
  std::int64_t first_unix_ns = 0;
  std::int64_t last_unix_ns = 0;
  std::int64_t acknowledged_unix_ns = 0;
  std::int64_t ended_unix_ns = 0;
  std::string acknowledged_by = {};
  bool operator==(const OpenAlarmRow&) const = default;
};

/// Alarms of this name are not shown as open until then; log and store have them as ever.
struct MuteRow {
  AlarmName name = AlarmName::kUnnamed;
  std::int64_t until_unix_ns = 0;  // 0: no longer muted
  std::int64_t since_unix_ns = 0;
  std::string reason = {};
  std::string by = {};
  bool operator==(const MuteRow&) const = default;
};

/// A command or a refusal, as it is kept for years: the caller, the request and the answer. The
/// store numbers and dates it, and chains it to the one before.
struct AuditRow {
  static constexpr std::size_t kRequestBytesMax = 4096;
  static constexpr std::size_t kReasonBytesMax = 1024;
  /// The process at the control socket.
  struct Process {
    std::uint32_t pid = 0;
    std::uint32_t uid = 0;
    std::uint32_t gid = 0;
    std::string program = {};
    bool operator==(const Process&) const = default;
  };
  std::string door;  // socket, http
  std::string name;  // uid 1000, token NAME
  std::string role;
  std::optional<Process> process = {};
  std::string address = {};  // of HTTP
  std::string boot_id = {};
  std::string verb;
  std::string request = {};         // as it came, at most kRequestBytesMax of it
  std::string request_sha256 = {};  // of all of it, in hex
  std::uint64_t request_bytes = 0;  // of all of it
  bool taken = false;               // false: refused
  std::string code = {};            // of the error, where it was refused
  std::string reason = {};          // likewise, or a remark
  std::uint64_t configuration = 0;  // that was under way then; 0: none, or it is none's affair
  bool operator==(const AuditRow&) const = default;
};

/// The next move id to give out; written with the first intent that uses one.
struct NextMoveRow {
  MoveId next;
};

/// The extended model that blind commands go through from here on, or none.
struct ModelRow {
  std::uint64_t entry = 0;     // of this change, ascending
  std::string sha256;          // of the model's text, in hex; empty: none is in force
  std::uint64_t restores = 0;  // the change that it restores; 0: none
  std::string name;
  std::string campaign;  // the campaign that it was found in
  std::string campaign_sha256;
  double rms_before_um = 0;  // on moves that no fit has used; NaN: not known
  double rms_after_um = 0;
  std::shared_ptr<const std::string> text;  // null: the store has it under its sha256
};

using Row = std::variant<VectorRow, MeasurementRow, IntentRow, IntentEndRow, BindingRow, EnableRow,
                         ParameterRow, TuningRow, ConfigurationRow, AlarmRow, AlarmEndRow,
                         OpenAlarmRow, MuteRow, NextMoveRow, ModelRow, AuditRow>;

/// A row that the store can never keep. The row was set aside, and the rest of its batch was kept.
struct RefusedRow {
  // Batches that the store may have written together with it, both included.
  std::uint64_t first_batch = 0;
  std::uint64_t last_batch = 0;
  Row row;
  std::string why;
};

/// The state that the coordinator needs to go on after a restart.
struct StoredFleet {
  struct StoredUnit {
    UnitId unit;
    SerialNumber serial;
    bool enabled = true;
    std::string reason;
    bool operator==(const StoredUnit&) const = default;
  };
  std::vector<StoredUnit> units;   // places that have a binding or were disabled
  std::vector<VectorRow> vectors;  // by serial
  std::vector<IntentRow> open_intents;
  std::vector<ParameterRow> parameters;
  std::vector<TuningRow> tunings;
  /// Configurations by id: those that never ended, and the newest.
  std::vector<ConfigurationRow> configurations;
  std::vector<OpenAlarmRow> open_alarms;  // by id; those that are not over
  std::vector<MuteRow> mutes;             // by name
  MoveId next_move{1};
  std::uint64_t next_configuration = 1;
  std::uint64_t next_alarm = 1;
  std::uint64_t next_exposure = 1;
};

}  // namespace focalfleet
