#include "daemon/store/store.h"

#include <cstdlib>

#include "daemon/store/cells.h"
#include "daemon/store/lock_file.h"
#include "daemon/store/schema.h"
#include "daemon/store/sqlite.h"

namespace focalfleet {

namespace store_internal {

struct Statements {
  Statement begin, commit;
  Statement axis, axis_changed;
  Statement intent, intent_end;
  Statement unbound_elsewhere, unbind_elsewhere, bind, enable, unit_changed;
  Statement parameter_changed, parameter;
  Statement tuning_kept, tuning;
  Statement measurement, orientation;
  Statement configuration, alarm;
  Statement model, model_change;
  Statement raise_meta, set_meta;
};

namespace {

// Replaces the row as a whole: ON CONFLICT DO UPDATE reads it first, and costs a fifth more.
constexpr const char* kAxis =
    "INSERT OR REPLACE INTO axis_state(serial, axis, witness, low, high, vector, turns, "
    "subdivision, move, origin, at_ns, offset) VALUES(?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, "
    "?11, "
    "?12)";
constexpr const char* kAxisChanged =
    "INSERT INTO axis_history(serial, axis, witness, low, high, subdivision, origin, at_ns) "
    "SELECT ?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8 WHERE NOT EXISTS(SELECT 1 FROM axis_state WHERE serial "
    "= ?1 AND "
    "axis = ?2 AND witness = ?3 AND low = ?4 AND high = ?5 AND subdivision = ?6)";
constexpr const char* kIntent =
    "INSERT INTO intent(configuration, unit_id, serial, move, theta_from, phi_from, theta_to, "
    "phi_to, theta_low, "
    "theta_high, phi_low, phi_high, began_ns) VALUES(?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, "
    "?12, ?13) "
    "ON CONFLICT(serial, move) WHERE end IS NULL DO UPDATE SET configuration = ?1, unit_id = ?2, "
    "theta_from = ?5, phi_from = ?6, theta_to = ?7, phi_to = ?8, theta_low = ?9, theta_high = ?10, "
    "phi_low = ?11, "
    "phi_high = ?12";
constexpr const char* kIntentEnd =
    "UPDATE intent SET end = ?3, ended_ns = ?4, (theta_end_witness, theta_end_low, theta_end_high) "
    "= "
    "(SELECT witness, low, high FROM axis_state WHERE serial = ?1 AND axis = 0), "
    "(phi_end_witness, phi_end_low, phi_end_high) = "
    "(SELECT witness, low, high FROM axis_state WHERE serial = ?1 AND axis = 1) "
    "WHERE serial = ?1 AND move = ?2 AND end IS NULL";
constexpr const char* kUnboundElsewhere =
    "INSERT INTO unit_history(unit_id, serial, enabled, reason, at_ns) "
    "SELECT unit_id, 0, enabled, reason, ?3 FROM unit WHERE serial = ?2 AND unit_id <> ?1 AND ?2 "
    "<> 0";
constexpr const char* kUnbindElsewhere =
    "UPDATE unit SET serial = 0, at_ns = ?3 WHERE serial = ?2 AND unit_id <> ?1 AND ?2 <> 0";
constexpr const char* kBind =
    "INSERT INTO unit(unit_id, serial, enabled, reason, at_ns) VALUES(?1, ?2, 1, '', ?3) "
    "ON CONFLICT(unit_id) DO UPDATE SET serial = ?2, at_ns = ?3 WHERE serial <> ?2";
constexpr const char* kEnable =
    "INSERT INTO unit(unit_id, serial, enabled, reason, at_ns) VALUES(?1, 0, ?2, ?3, ?4) "
    "ON CONFLICT(unit_id) DO UPDATE SET enabled = ?2, reason = ?3, at_ns = ?4 "
    "WHERE enabled <> ?2 OR reason <> ?3";
// Runs straight after kBind or kEnable: what they left alone has an older or equal entry already.
constexpr const char* kUnitChanged =
    "INSERT INTO unit_history(unit_id, serial, enabled, reason, at_ns) "
    "SELECT unit_id, serial, enabled, reason, at_ns FROM unit WHERE unit_id = ?1 AND changes() > 0";
constexpr const char* kParameterChanged =
    "INSERT INTO parameter_history(serial, axis, parameter, value, origin, at_ns) "
    "SELECT ?1, ?2, ?3, ?4, ?5, ?6 WHERE NOT EXISTS(SELECT 1 FROM parameter WHERE serial = ?1 AND "
    "axis = ?2 AND "
    "parameter = ?3 AND value = ?4 AND origin = ?5)";
constexpr const char* kParameter =
    "INSERT INTO parameter(serial, axis, parameter, value, origin, at_ns) VALUES(?1, ?2, ?3, ?4, "
    "?5, ?6) "
    "ON CONFLICT(serial, axis, parameter) DO UPDATE SET value = ?4, origin = ?5, at_ns = ?6 "
    "WHERE value <> ?4 OR origin <> ?5";
constexpr const char* kTuningKept =
    "INSERT INTO tuning_history(serial, axis, critical, repeat, margin, load_uNm, v_bus_V, "
    "counter1, subdivision, mode, origin, at_ns) "
    "VALUES(?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12)";
constexpr const char* kTuning =
    "INSERT OR REPLACE INTO tuning(serial, axis, critical, repeat, margin, load_uNm, v_bus_V, "
    "counter1, subdivision, mode, origin, at_ns) "
    "VALUES(?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12)";
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
    "INSERT INTO alarm(id, severity, unit_id, bus_id, text, at_ns) VALUES(?1, ?2, ?3, ?4, ?5, ?6) "
    "ON CONFLICT(id) DO UPDATE SET severity = ?2, unit_id = ?3, bus_id = ?4, text = ?5";
constexpr const char* kRaiseMeta =
    "INSERT INTO meta(key, value) VALUES(?1, ?2) ON CONFLICT(key) DO UPDATE SET value = ?2 WHERE "
    "value < ?2";
constexpr const char* kSetMeta =
    "INSERT INTO meta(key, value) VALUES(?1, ?2) ON CONFLICT(key) DO UPDATE SET value = ?2";

Result<std::unique_ptr<Statements>> PrepareAll(Connection& connection) {
  auto statements = std::make_unique<Statements>();
  const struct {
    Statement Statements::*member;
    const char* sql;
  } list[] = {
      {&Statements::begin, "BEGIN IMMEDIATE"},
      {&Statements::commit, "COMMIT"},
      {&Statements::axis, kAxis},
      {&Statements::axis_changed, kAxisChanged},
      {&Statements::intent, kIntent},
      {&Statements::intent_end, kIntentEnd},
      {&Statements::unbound_elsewhere, kUnboundElsewhere},
      {&Statements::unbind_elsewhere, kUnbindElsewhere},
      {&Statements::bind, kBind},
      {&Statements::enable, kEnable},
      {&Statements::unit_changed, kUnitChanged},
      {&Statements::parameter_changed, kParameterChanged},
      {&Statements::parameter, kParameter},
      {&Statements::tuning_kept, kTuningKept},
      {&Statements::tuning, kTuning},
      {&Statements::measurement, kMeasurement},
      {&Statements::orientation, kOrientation},
      {&Statements::configuration, kConfiguration},
      {&Statements::alarm, kAlarm},
      {&Statements::model, kModel},
      {&Statements::model_change, kModelChange},
      {&Statements::raise_meta, kRaiseMeta},
      {&Statements::set_meta, kSetMeta},
  };
  for (const auto& [member, sql] : list) {
    FOCALFLEET_TRY_ASSIGN((*statements).*member, connection.Prepare(sql));
  }
  return statements;
}

template <class Enum>
std::int64_t Code(Enum value) {
  return static_cast<std::int64_t>(value);
}

// One batch's rows, one statement after the other.
class RowWriter {
 public:
  RowWriter(Statements& statements, WallTime now) : statements_(statements), now_(now) {
    statements_.axis.Bind(11, now.ns);  // a binding outlives the reset
  }

  Status operator()(const VectorRow& row) {
    for (const Axis axis : kAxes) {
      // Motions are kept in intent, exposures in measurement; what sets a vector otherwise would
      // leave no trace.
      if (row.origin != Origin::kMove && row.origin != Origin::kHoming &&
          row.origin != Origin::kCamera && row.origin != Origin::kSensors) {
        FOCALFLEET_TRY(KeepVector(row, axis));
      }
      FOCALFLEET_TRY(WriteAxis(row, axis));
    }
    return {};
  }

  Status operator()(const MeasurementRow& row) {
    const auto& [xx, xy, yy] = row.covariance;
    if (row.carrier) FOCALFLEET_TRY(WriteOrientation(row, *row.carrier));
    Statement& s = statements_.measurement;
    s.Bind(1, static_cast<std::int64_t>(row.exposure));
    s.Bind(2, row.unit.value);
    s.Bind(3, row.serial.value);
    s.Bind(4, static_cast<std::int64_t>(row.configuration));
    s.Bind(5, Code(row.status));
    row.other ? s.Bind(6, row.other->value) : s.BindNull(6);
    s.BindReal(7, row.x_mm);
    s.BindReal(8, row.y_mm);
    s.BindReal(9, SigmaUm(row.covariance));
    row.place ? s.Bind(10, (*row.place)[0]) : s.BindNull(10);
    row.place ? s.Bind(11, (*row.place)[1]) : s.BindNull(11);
    row.error_um ? s.BindReal(12, *row.error_um) : s.BindNull(12);
    row.target_fp ? s.BindReal(13, row.target_fp->x_mm) : s.BindNull(13);
    row.target_fp ? s.BindReal(14, row.target_fp->y_mm) : s.BindNull(14);
    s.Bind(15, now_.ns);
    s.BindReal(16, xx);
    s.BindReal(17, xy);
    s.BindReal(18, yy);
    s.BindText(19, row.target_id);
    row.delay_s ? s.BindReal(20, *row.delay_s) : s.BindNull(20);
    s.Bind(21, Code(row.source));
    FOCALFLEET_TRY(s.Run());
    return Meta(statements_.raise_meta, "next_exposure", row.exposure + 1);
  }

  Status operator()(const IntentRow& row) {
    Statement& s = statements_.intent;
    s.Bind(1, static_cast<std::int64_t>(row.configuration));
    s.Bind(2, row.unit.value);
    s.Bind(3, row.serial.value);
    s.Bind(4, row.move.value);
    s.Bind(5, row.from[0]);
    s.Bind(6, row.from[1]);
    s.Bind(7, row.to[0]);
    s.Bind(8, row.to[1]);
    s.Bind(9, row.hull[0].low);
    s.Bind(10, row.hull[0].high);
    s.Bind(11, row.hull[1].low);
    s.Bind(12, row.hull[1].high);
    s.Bind(13, now_.ns);
    return s.Run();
  }

  Status operator()(const IntentEndRow& row) {
    Statement& s = statements_.intent_end;
    s.Bind(1, row.serial.value);
    s.Bind(2, row.move.value);
    s.Bind(3, Code(row.end));
    s.Bind(4, now_.ns);
    return s.Run();
  }

  Status operator()(const BindingRow& row) {
    // A serial number sits at one place: where it was before, nothing is bound any more.
    for (Statement* s :
         {&statements_.unbound_elsewhere, &statements_.unbind_elsewhere, &statements_.bind}) {
      s->Bind(1, row.unit.value);
      s->Bind(2, row.serial.value);
      s->Bind(3, now_.ns);
      FOCALFLEET_TRY(s->Run());
    }
    return KeepUnit(row.unit);
  }

  Status operator()(const EnableRow& row) {
    Statement& s = statements_.enable;
    s.Bind(1, row.unit.value);
    s.Bind(2, row.enabled ? 1 : 0);
    s.BindText(3, row.reason);
    s.Bind(4, now_.ns);
    FOCALFLEET_TRY(s.Run());
    return KeepUnit(row.unit);
  }

  Status operator()(const ParameterRow& row) {
    for (Statement* s : {&statements_.parameter_changed, &statements_.parameter}) {
      s->Bind(1, row.serial.value);
      s->Bind(2, Code(row.axis));
      s->Bind(3, Code(row.parameter));
      s->Bind(4, row.value);
      s->Bind(5, Code(row.origin));
      s->Bind(6, now_.ns);
      FOCALFLEET_TRY(s->Run());
    }
    return {};
  }

  Status operator()(const TuningRow& row) {
    for (Statement* s : {&statements_.tuning_kept, &statements_.tuning}) {
      s->Bind(1, row.serial.value);
      s->Bind(2, Code(row.axis));
      s->Bind(3, row.critical);
      s->Bind(4, row.repeat);
      s->BindReal(5, row.margin);
      s->BindReal(6, row.load_uNm);
      s->BindReal(7, row.v_bus_V);
      s->Bind(8, row.counter1);
      s->Bind(9, row.subdivision);
      s->Bind(10, Code(row.mode));
      s->Bind(11, Code(row.origin));
      s->Bind(12, now_.ns);
      FOCALFLEET_TRY(s->Run());
    }
    return {};
  }

  Status operator()(const ConfigurationRow& row) {
    Statement& s = statements_.configuration;
    s.Bind(1, static_cast<std::int64_t>(row.id));
    s.BindText(2, row.source);
    s.Bind(3, Code(row.state));
    s.Bind(4, row.targeted);
    s.Bind(5, row.arrived);
    s.Bind(6, row.refused);
    s.Bind(7, row.failed);
    s.BindReal(8, row.makespan_predicted_s);
    s.BindReal(9, row.makespan_s);
    s.BindReal(10, row.energy_J);
    s.BindReal(11, row.peak_power_W);
    s.BindReal(12, row.start_skew_s);
    s.BindReal(13, row.start_skew_bound_s);
    s.Bind(14, now_.ns);
    s.Bind(15, row.stopped);
    s.Bind(16, row.unmeasured);
    FOCALFLEET_TRY(s.Run());
    return Meta(statements_.raise_meta, "next_configuration", row.id + 1);
  }

  Status operator()(const AlarmRow& row) {
    Statement& s = statements_.alarm;
    s.Bind(1, static_cast<std::int64_t>(row.id));
    s.Bind(2, Code(row.severity));
    if (row.unit) {
      s.Bind(3, row.unit->value);
    } else {
      s.BindNull(3);
    }
    if (row.bus) {
      s.Bind(4, row.bus->value);
    } else {
      s.BindNull(4);
    }
    s.BindText(5, row.text);
    s.Bind(6, now_.ns);
    FOCALFLEET_TRY(s.Run());
    return Meta(statements_.raise_meta, "next_alarm", row.id + 1);
  }

  // Not raised but set: move ids are 16 bits and begin again.
  Status operator()(const NextMoveRow& row) {
    return Meta(statements_.set_meta, "next_move", row.next.value);
  }

  Status operator()(const ModelRow& row) {
    if (row.text != nullptr && !row.sha256.empty()) {
      Statement& model = statements_.model;
      model.BindText(1, row.sha256);
      model.BindText(2, *row.text);
      model.Bind(3, now_.ns);
      FOCALFLEET_TRY(model.Run());
    }
    Statement& s = statements_.model_change;
    s.Bind(1, static_cast<std::int64_t>(row.entry));
    if (row.sha256.empty()) {
      s.BindNull(2);
    } else {
      s.BindText(2, row.sha256);
    }
    if (row.restores == 0) {
      s.BindNull(3);
    } else {
      s.Bind(3, static_cast<std::int64_t>(row.restores));
    }
    s.BindText(4, row.name);
    s.BindText(5, row.campaign);
    s.BindText(6, row.campaign_sha256);
    s.BindReal(7, row.rms_before_um);
    s.BindReal(8, row.rms_after_um);
    s.Bind(9, now_.ns);
    return s.Run();
  }

 private:
  Status WriteAxis(const VectorRow& row, Axis axis) {
    const AxisKnowledge& knowledge = row.knowledge[Index(axis)];
    const std::int32_t subdivision = row.subdivision[Index(axis)];
    Statement& s = statements_.axis;
    s.Bind(1, row.serial.value);
    s.Bind(2, Code(axis));
    s.Bind(3, Code(knowledge.witness));
    s.Bind(4, knowledge.low);
    s.Bind(5, knowledge.high);
    const std::int32_t offset = row.offset[Index(axis)];
    if (knowledge.witness >= Witness::kPredicted && subdivision != 0) {
      const std::int64_t count = std::int64_t{knowledge.low} - offset;
      const auto remainder = static_cast<std::int32_t>(count % subdivision);
      const std::int32_t vector = remainder < 0 ? remainder + subdivision : remainder;
      s.Bind(6, vector);
      s.Bind(7, (count - vector) / subdivision);
    } else {
      s.BindNull(6);
      s.BindNull(7);
    }
    s.Bind(8, subdivision);
    s.Bind(9, row.move.value);
    s.Bind(10, Code(row.origin));
    s.Bind(12, offset);
    return s.Run();
  }

  Status WriteOrientation(const MeasurementRow& row, const FibreCarrierReading& carrier) {
    Statement& s = statements_.orientation;
    s.Bind(1, static_cast<std::int64_t>(row.exposure));
    s.Bind(2, row.unit.value);
    s.Bind(3, row.serial.value);
    s.Bind(4, carrier.trusted ? 1 : 0);
    s.BindText(5, carrier.verdict);
    s.Bind(6, carrier.used);
    int column = 7;
    for (const double angle_deg : carrier.angles_deg) {
      carrier.solved ? s.BindReal(column, angle_deg) : s.BindNull(column);
      ++column;
    }
    for (const double covariance_deg2 : carrier.covariance_deg2) {
      carrier.solved ? s.BindReal(column, covariance_deg2) : s.BindNull(column);
      ++column;
    }
    s.Bind(column, now_.ns);
    return s.Run();
  }

  Status KeepVector(const VectorRow& row, Axis axis) {
    const AxisKnowledge& knowledge = row.knowledge[Index(axis)];
    Statement& s = statements_.axis_changed;
    s.Bind(1, row.serial.value);
    s.Bind(2, Code(axis));
    s.Bind(3, Code(knowledge.witness));
    s.Bind(4, knowledge.low);
    s.Bind(5, knowledge.high);
    s.Bind(6, row.subdivision[Index(axis)]);
    s.Bind(7, Code(row.origin));
    s.Bind(8, now_.ns);
    return s.Run();
  }

  Status KeepUnit(UnitId unit) {
    statements_.unit_changed.Bind(1, unit.value);
    return statements_.unit_changed.Run();
  }

  static Status Meta(Statement& s, std::string_view key, std::uint64_t value) {
    s.BindText(1, key);
    s.Bind(2, static_cast<std::int64_t>(value));
    return s.Run();
  }

  Statements& statements_;
  WallTime now_;
};

// The name under which every path to this file locks the same lock.
std::string Canonical(const std::string& path) {
  const std::unique_ptr<char, void (*)(void*)> file(realpath(path.c_str(), nullptr), std::free);
  if (file != nullptr) return file.get();
  const std::size_t slash = path.rfind('/');
  const std::string folder = slash == std::string::npos ? "." : path.substr(0, slash + 1);
  const std::unique_ptr<char, void (*)(void*)> place(realpath(folder.c_str(), nullptr), std::free);
  if (place == nullptr) return path;
  return std::string(place.get()) + "/" + path.substr(slash == std::string::npos ? 0 : slash + 1);
}

Status SetUp(Connection& connection) {
  const auto version_max = static_cast<std::int32_t>(Migrations().size());
  // Until it is known to be ours, closing it must not tidy its WAL away.
  sqlite3_db_config(connection.db(), SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 1, nullptr);
  FOCALFLEET_TRY_ASSIGN(const std::int32_t version, InspectSchema(connection, version_max));
  sqlite3_db_config(connection.db(), SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 0, nullptr);
  FOCALFLEET_TRY(connection.Execute("PRAGMA journal_mode = WAL"));
  FOCALFLEET_TRY(connection.Execute("PRAGMA synchronous = FULL"));
  FOCALFLEET_TRY(connection.Execute("PRAGMA journal_size_limit = 16777216"));
  FOCALFLEET_TRY(connection.Execute("PRAGMA cell_size_check = ON"));
  return Migrate(connection, version, Migrations());
}

}  // namespace
}  // namespace store_internal

using namespace store_internal;

Store::Store() = default;
Store::~Store() = default;

Result<std::unique_ptr<Store>> Store::Open(const std::string& path, const StoreOptions& options) {
  auto store = std::unique_ptr<Store>(new Store);
  store->path_ = Canonical(path);
  // The lock comes first: to open and close the file would drop this process's own locks on it, if
  // it had any.
  FOCALFLEET_TRY_ASSIGN(store->lock_, LockFile::Acquire(store->path_ + ".lock"));
  FOCALFLEET_TRY(InspectHeader(store->path_, static_cast<std::int32_t>(Migrations().size())));
  FOCALFLEET_TRY_ASSIGN(store->connection_,
                        Connection::Open(store->path_, Connection::Mode::kWrite, options.vfs,
                                         static_cast<int>(options.busy_wait.count())));
  FOCALFLEET_TRY(SetUp(*store->connection_));
  FOCALFLEET_TRY_ASSIGN(store->statements_, PrepareAll(*store->connection_));
  return store;
}

Result<StoredFleet> Store::Load() { return LoadFleet(*connection_); }

Status Store::Reject(Error why) {
  ++counters_.failed;
  return tl::unexpected<Error>(connection_->Named(std::move(why)));
}

Status Store::Rollback(Error why) {
  connection_->Rollback();
  return Reject(std::move(why));
}

Status Store::Commit(std::span<const Row> rows, WallTime now, std::size_t* refused) {
  if (refused != nullptr) *refused = rows.size();
  const auto refuse = [&](std::size_t row, const Error& why) {
    if (refused != nullptr) *refused = row;
    return Error{why.code, Describe(rows[row]) + ": " + why.text};
  };
  if (rows.empty()) return {};
  for (std::size_t k = 0; k < rows.size(); ++k)
    if (const char* const flaw = Flaw(rows[k]))
      return Reject(refuse(k, {ErrorCode::kInvalid, flaw}));
  if (auto begun = statements_->begin.Run(); !begun) return Rollback(begun.error());
  RowWriter writer(*statements_, now);
  const auto write = [&](std::size_t k) -> Status {
    const Status written = std::visit(writer, rows[k]);
    if (written || written.error().code != ErrorCode::kInvalid) return written;
    return tl::unexpected<Error>(refuse(k, written.error()));
  };
  bool ends = false;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    if (std::holds_alternative<IntentEndRow>(rows[k])) {
      ends = true;
    } else if (auto written = write(k); !written) {
      return Rollback(written.error());
    }
  }
  for (std::size_t k = 0; ends && k < rows.size(); ++k) {
    if (!std::holds_alternative<IntentEndRow>(rows[k])) continue;
    if (auto written = write(k); !written) return Rollback(written.error());
  }
  if (auto done = statements_->commit.Run(); !done) return Rollback(done.error());
  ++counters_.transactions;
  counters_.rows += rows.size();
  return {};
}

Result<std::uint64_t> Store::Prune(WallTime before, std::uint32_t rows_max) {
  constexpr const char* kDelete[] = {
      "DELETE FROM intent WHERE entry IN (SELECT entry FROM intent WHERE end IS NOT NULL AND "
      "ended_ns < ?1 "
      "ORDER BY entry LIMIT ?2)",
      "DELETE FROM configuration WHERE id IN (SELECT id FROM configuration WHERE changed_ns < ?1 "
      "AND state >= 3 "
      "ORDER BY id LIMIT ?2)",
      "DELETE FROM measurement WHERE (exposure, unit_id) IN (SELECT exposure, unit_id FROM "
      "measurement WHERE at_ns < ?1 ORDER BY exposure LIMIT ?2)",
      "DELETE FROM orientation WHERE (exposure, unit_id) IN (SELECT exposure, unit_id FROM "
      "orientation WHERE at_ns < ?1 ORDER BY exposure LIMIT ?2)",
      "DELETE FROM alarm WHERE id IN (SELECT id FROM alarm WHERE at_ns < ?1 ORDER BY id LIMIT ?2)",
  };
  static_assert(ConfigurationState::kDone == ConfigurationState{3});
  std::uint64_t deleted = 0;
  if (auto begun = statements_->begin.Run(); !begun) {
    return tl::unexpected<Error>(Rollback(begun.error()).error());
  }
  for (const char* sql : kDelete) {
    auto statement = connection_->Prepare(sql);
    if (!statement) return tl::unexpected<Error>(Rollback(statement.error()).error());
    statement->Bind(1, before.ns);
    statement->Bind(2, rows_max);
    if (auto done = statement->Run(); !done) {
      return tl::unexpected<Error>(Rollback(done.error()).error());
    }
    deleted += static_cast<std::uint64_t>(sqlite3_changes64(connection_->db()));
  }
  if (auto done = statements_->commit.Run(); !done) {
    return tl::unexpected<Error>(Rollback(done.error()).error());
  }
  return deleted;
}

}  // namespace focalfleet
