#include "daemon/store/statements.h"

#include <iterator>

#include "daemon/store/audit_rows.h"

namespace focalfleet::store_internal {
namespace {

// The row is replaced as a whole: ON CONFLICT DO UPDATE reads it first, and costs a fifth more.
constexpr const char* kAxis =
    "INSERT OR REPLACE INTO axis_state(serial, axis, witness, low, high, vector, turns, "
    "subdivision, move, origin, at_ns, offset, checksum) VALUES(?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, "
    "?9, ?10, ?11, ?12, row_checksum(?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12))";
constexpr const char* kAxisChanged =
    "INSERT INTO axis_history(serial, axis, witness, low, high, subdivision, origin, at_ns) "
    "SELECT ?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8 WHERE NOT EXISTS(SELECT 1 FROM axis_state WHERE serial "
    "= ?1 AND "
    "axis = ?2 AND witness = ?3 AND low = ?4 AND high = ?5 AND subdivision = ?6)";
constexpr const char* kIntent =
    "INSERT INTO intent(configuration, unit_id, serial, move, theta_from, phi_from, theta_to, "
    "phi_to, theta_low, "
    "theta_high, phi_low, phi_high, began_ns, checksum) VALUES(?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, "
    "?10, ?11, ?12, ?13, row_checksum(?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12)) "
    "ON CONFLICT(serial, move) WHERE end IS NULL DO UPDATE SET configuration = ?1, unit_id = ?2, "
    "theta_from = ?5, phi_from = ?6, theta_to = ?7, phi_to = ?8, theta_low = ?9, theta_high = ?10, "
    "phi_low = ?11, "
    "phi_high = ?12, checksum = excluded.checksum";
constexpr const char* kIntentEnd =
    "UPDATE intent SET end = ?3, ended_ns = ?4, (theta_end_witness, theta_end_low, theta_end_high) "
    "= "
    "(SELECT witness, low, high FROM axis_state WHERE serial = ?1 AND axis = 0), "
    "(phi_end_witness, phi_end_low, phi_end_high) = "
    "(SELECT witness, low, high FROM axis_state WHERE serial = ?1 AND axis = 1) "
    "WHERE serial = ?1 AND move = ?2 AND end IS NULL";
// Where there was never a model there is nothing to remember.
constexpr const char* kCountedAnew =
    "INSERT INTO counted_anew(serial, model) SELECT ?1, entry FROM model_change "
    "WHERE entry = (SELECT max(entry) FROM model_change) "
    "ON CONFLICT(serial) DO UPDATE SET model = excluded.model";
// The same where the place had another serial number before.
constexpr const char* kReplaced =
    "INSERT INTO counted_anew(serial, model) SELECT ?2, entry FROM model_change "
    "WHERE entry = (SELECT max(entry) FROM model_change) AND ?2 <> 0 AND "
    "?2 <> (SELECT serial FROM unit_history WHERE unit_id = ?1 AND serial <> 0 "
    "ORDER BY entry DESC LIMIT 1) "
    "ON CONFLICT(serial) DO UPDATE SET model = excluded.model";
constexpr const char* kUnboundElsewhere =
    "INSERT INTO unit_history(unit_id, serial, enabled, reason, at_ns) "
    "SELECT unit_id, 0, enabled, reason, ?3 FROM unit WHERE serial = ?2 AND unit_id <> ?1 AND ?2 "
    "<> 0";
constexpr const char* kUnbindElsewhere =
    "UPDATE unit SET serial = 0, at_ns = ?3, checksum = row_checksum(unit_id, 0, enabled, reason, "
    "?3) WHERE serial = ?2 AND unit_id <> ?1 AND ?2 <> 0";
constexpr const char* kBind =
    "INSERT INTO unit(unit_id, serial, enabled, reason, at_ns, checksum) "
    "VALUES(?1, ?2, 1, '', ?3, row_checksum(?1, ?2, 1, '', ?3)) "
    "ON CONFLICT(unit_id) DO UPDATE SET serial = ?2, at_ns = ?3, "
    "checksum = row_checksum(?1, ?2, enabled, reason, ?3) WHERE serial <> ?2";
constexpr const char* kEnable =
    "INSERT INTO unit(unit_id, serial, enabled, reason, at_ns, checksum) "
    "VALUES(?1, 0, ?2, ?3, ?4, row_checksum(?1, 0, ?2, ?3, ?4)) "
    "ON CONFLICT(unit_id) DO UPDATE SET enabled = ?2, reason = ?3, at_ns = ?4, "
    "checksum = row_checksum(?1, serial, ?2, ?3, ?4) "
    "WHERE enabled <> ?2 OR reason <> ?3";
// This statement runs straight after kBind or kEnable, and adds an entry only where they changed a
// row.
constexpr const char* kUnitChanged =
    "INSERT INTO unit_history(unit_id, serial, enabled, reason, at_ns) "
    "SELECT unit_id, serial, enabled, reason, at_ns FROM unit WHERE unit_id = ?1 AND changes() > 0";
constexpr const char* kParameterChanged =
    "INSERT INTO parameter_history(serial, axis, parameter, value, origin, at_ns) "
    "SELECT ?1, ?2, ?3, ?4, ?5, ?6 WHERE NOT EXISTS(SELECT 1 FROM parameter WHERE serial = ?1 AND "
    "axis = ?2 AND "
    "parameter = ?3 AND value = ?4 AND origin = ?5)";
constexpr const char* kParameter =
    "INSERT INTO parameter(serial, axis, parameter, value, origin, at_ns, checksum) "
    "VALUES(?1, ?2, ?3, ?4, ?5, ?6, row_checksum(?1, ?2, ?3, ?4, ?5, ?6)) "
    "ON CONFLICT(serial, axis, parameter) DO UPDATE SET value = ?4, origin = ?5, at_ns = ?6, "
    "checksum = excluded.checksum "
    "WHERE value <> ?4 OR origin <> ?5";
constexpr const char* kTuningKept =
    "INSERT INTO tuning_history(serial, axis, critical, repeat, margin, load_uNm, v_bus_V, "
    "counter1, subdivision, mode, origin, at_ns) "
    "VALUES(?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12)";
constexpr const char* kTuning =
    "INSERT OR REPLACE INTO tuning(serial, axis, critical, repeat, margin, load_uNm, v_bus_V, "
    "counter1, subdivision, mode, origin, at_ns, checksum) "
    "VALUES(?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, "
    "row_checksum(?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12))";
constexpr const char* kMeasurement =
    "INSERT OR REPLACE INTO measurement(exposure, unit_id, serial, configuration, status, "
    "other, x_mm, y_mm, sigma_um, theta, phi, error_um, target_x_mm, target_y_mm, at_ns, "
    "var_x_mm2, cov_xy_mm2, var_y_mm2, target_id, delay_s, source) "
    "VALUES(?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13, ?14, ?15, ?16, ?17, ?18, ?19, "
    "?20, ?21)";
constexpr const char* kModel =
    "INSERT INTO model(sha256, text, at_ns) VALUES(?1, ?2, ?3) ON CONFLICT(sha256) DO NOTHING";
constexpr const char* kModelChange =
    "INSERT INTO model_change(entry, sha256, restores, name, campaign, campaign_sha256, "
    "rms_before_um, rms_after_um, at_ns) VALUES(?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9)";
constexpr const char* kOrientation =
    "INSERT OR REPLACE INTO orientation(exposure, unit_id, serial, trusted, verdict, used, "
    "alpha_deg, beta_deg, gamma_deg, cov_aa_deg2, cov_ab_deg2, cov_ag_deg2, cov_bb_deg2, "
    "cov_bg_deg2, cov_gg_deg2, at_ns) "
    "VALUES(?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13, ?14, ?15, ?16)";
constexpr const char* kConfiguration =
    "INSERT INTO configuration(id, source, state, targeted, arrived, refused, failed, "
    "makespan_predicted_s, "
    "makespan_s, energy_J, peak_power_W, start_skew_s, start_skew_bound_s, stopped, unmeasured, "
    "began_ns, changed_ns) "
    "VALUES(?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13, ?15, ?16, ?14, ?14) "
    "ON CONFLICT(id) DO UPDATE SET "
    "source = ?2, "
    "state = ?3, targeted = ?4, arrived = ?5, refused = ?6, failed = ?7, makespan_predicted_s = "
    "?8, "
    "makespan_s = ?9, energy_J = ?10, peak_power_W = ?11, start_skew_s = ?12, start_skew_bound_s = "
    "?13, stopped = ?15, unmeasured = ?16, "
    "changed_ns = ?14";
constexpr const char* kAlarm =
    "INSERT INTO alarm(id, severity, unit_id, bus_id, text, at_ns, name) "
    "VALUES(?1, ?2, ?3, ?4, ?5, ?6, ?7) "
    "ON CONFLICT(id) DO UPDATE SET severity = ?2, unit_id = ?3, bus_id = ?4, text = ?5, name = ?7";
constexpr const char* kOpenAlarm =
    "INSERT OR REPLACE INTO open_alarm(id, severity, unit_id, bus_id, text, name, count, state, "
    "first_ns, last_ns, acknowledged_ns, ended_ns, acknowledged_by) "
    "VALUES(?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13)";
constexpr const char* kMute =
    "INSERT OR REPLACE INTO mute(name, until_ns, since_ns, reason, by) VALUES(?1, ?2, ?3, ?4, ?5)";
constexpr const char* kRaiseMeta =
    "INSERT INTO meta(key, value, checksum) VALUES(?1, ?2, row_checksum(?1, ?2)) "
    "ON CONFLICT(key) DO UPDATE SET value = ?2, checksum = excluded.checksum WHERE value < ?2";
constexpr const char* kSetMeta =
    "INSERT INTO meta(key, value, checksum) VALUES(?1, ?2, row_checksum(?1, ?2)) "
    "ON CONFLICT(key) DO UPDATE SET value = ?2, checksum = excluded.checksum";
constexpr const char* kAddMeta =
    "UPDATE meta SET value = value + ?2, checksum = row_checksum(key, value + ?2) WHERE key = ?1";

}  // namespace

Result<std::unique_ptr<Statements>> PrepareAll(Connection& connection) {
  auto statements = std::make_unique<Statements>();
  static constexpr struct {
    Sql which;
    const char* text;
  } list[] = {
      {Sql::kBegin, "BEGIN IMMEDIATE"},
      {Sql::kCommit, "COMMIT"},
      {Sql::kAxis, kAxis},
      {Sql::kAxisChanged, kAxisChanged},
      {Sql::kIntent, kIntent},
      {Sql::kIntentEnd, kIntentEnd},
      {Sql::kCountedAnew, kCountedAnew},
      {Sql::kReplaced, kReplaced},
      {Sql::kUnboundElsewhere, kUnboundElsewhere},
      {Sql::kUnbindElsewhere, kUnbindElsewhere},
      {Sql::kBind, kBind},
      {Sql::kEnable, kEnable},
      {Sql::kUnitChanged, kUnitChanged},
      {Sql::kParameterChanged, kParameterChanged},
      {Sql::kParameter, kParameter},
      {Sql::kTuningKept, kTuningKept},
      {Sql::kTuning, kTuning},
      {Sql::kMeasurement, kMeasurement},
      {Sql::kOrientation, kOrientation},
      {Sql::kConfiguration, kConfiguration},
      {Sql::kAlarm, kAlarm},
      {Sql::kOpenAlarm, kOpenAlarm},
      {Sql::kMute, kMute},
      {Sql::kModel, kModel},
      {Sql::kModelChange, kModelChange},
      {Sql::kRaiseMeta, kRaiseMeta},
      {Sql::kSetMeta, kSetMeta},
      {Sql::kAddMeta, kAddMeta},
      {Sql::kAudit, kAuditInsert},
      {Sql::kAuditHead, kAuditHeadSql},
  };
  static_assert(std::size(list) == kSqlCount);
  for (const auto& [which, text] : list) {
    FOCALFLEET_TRY_ASSIGN((*statements)[which], connection.Prepare(text));
  }
  return statements;
}

}  // namespace focalfleet::store_internal
