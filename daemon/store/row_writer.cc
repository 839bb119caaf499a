#include "daemon/store/row_writer.h"

#include "daemon/store/audit_rows.h"

namespace focalfleet::store_internal {
namespace {

template <class Enum>
std::int64_t Code(Enum value) {
  return static_cast<std::int64_t>(value);
}

/// Binds what an alarm and an open alarm have in common, from the first column on.
template <class Alarm>
void BindAlarm(Statement& s, const Alarm& row) {
  s.Bind(1, static_cast<std::int64_t>(row.id));
  s.Bind(2, Code(row.severity));
  row.unit ? s.Bind(3, row.unit->value) : s.BindNull(3);
  row.bus ? s.Bind(4, row.bus->value) : s.BindNull(4);
  s.BindText(5, row.text);
}

void BindName(Statement& s, int column, AlarmName name) {
  name == AlarmName::kUnnamed ? s.BindNull(column) : s.BindText(column, Name(name));
}

Status NoteCountedAnew(Statement& s, SerialNumber serial) {
  s.Bind(1, serial.value);
  return s.Run();
}

}  // namespace

RowWriter::RowWriter(Statements* statements, WallTime now) : statements_(*statements), now_(now) {
  statements_[Sql::kAxis].Bind(11, now.ns);  // a binding outlives the reset
}

Status RowWriter::Write(const Row& row) {
  return std::visit([this](const auto& what) { return Put(what); }, row);
}

Status RowWriter::Finish() {
  if (opened_ == 0) return {};
  Statement& s = statements_[Sql::kAddMeta];
  s.BindText(1, "open_intents");
  s.Bind(2, opened_);
  return s.Run();
}

Status RowWriter::Put(const VectorRow& row) {
  for (const Axis axis : kAxes) {
    // Motions are kept in intent, exposures in measurement. Vectors set in any other way would
    // leave no trace, so they go to the axis' history.
    if (row.origin != Origin::kMove && row.origin != Origin::kHoming &&
        row.origin != Origin::kCamera && row.origin != Origin::kSensors) {
      FOCALFLEET_TRY(KeepVector(row, axis));
    }
    FOCALFLEET_TRY(WriteAxis(row, axis));
  }
  if (row.origin == Origin::kOperator || row.origin == Origin::kFound)
    return NoteCountedAnew(statements_[Sql::kCountedAnew], row.serial);
  return {};
}

Status RowWriter::Put(const MeasurementRow& row) {
  const auto& [xx, xy, yy] = row.covariance;
  if (row.carrier) FOCALFLEET_TRY(WriteOrientation(row, *row.carrier));
  Statement& s = statements_[Sql::kMeasurement];
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
  return SetMeta(statements_[Sql::kRaiseMeta], "next_exposure", row.exposure + 1);
}

Status RowWriter::Put(const IntentRow& row) {
  Statement& s = statements_[Sql::kIntent];
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
  sqlite3* const db = sqlite3_db_handle(s.get());
  sqlite3_set_last_insert_rowid(db, 0);  // stays where an open row is updated
  FOCALFLEET_TRY(s.Run());
  if (sqlite3_last_insert_rowid(db) != 0) ++opened_;
  return {};
}

Status RowWriter::Put(const IntentEndRow& row) {
  Statement& s = statements_[Sql::kIntentEnd];
  s.Bind(1, row.serial.value);
  s.Bind(2, row.move.value);
  s.Bind(3, Code(row.end));
  s.Bind(4, now_.ns);
  FOCALFLEET_TRY(s.Run());
  opened_ -= sqlite3_changes64(sqlite3_db_handle(s.get()));
  return {};
}

Status RowWriter::NoteEnd(const IntentEndRow& row) {
  if (row.end != IntentEnd::kHomed) return {};
  return NoteCountedAnew(statements_[Sql::kCountedAnew], row.serial);
}

Status RowWriter::Put(const BindingRow& row) {
  Statement& replaced = statements_[Sql::kReplaced];
  replaced.Bind(1, row.unit.value);
  replaced.Bind(2, row.serial.value);
  FOCALFLEET_TRY(replaced.Run());
  // A serial number belongs to one place; the place that had it before is unbound.
  for (Statement* s : {&statements_[Sql::kUnboundElsewhere], &statements_[Sql::kUnbindElsewhere],
                       &statements_[Sql::kBind]}) {
    s->Bind(1, row.unit.value);
    s->Bind(2, row.serial.value);
    s->Bind(3, now_.ns);
    FOCALFLEET_TRY(s->Run());
  }
  return KeepUnit(row.unit);
}

Status RowWriter::Put(const EnableRow& row) {
  Statement& s = statements_[Sql::kEnable];
  s.Bind(1, row.unit.value);
  s.Bind(2, row.enabled ? 1 : 0);
  s.BindText(3, row.reason);
  s.Bind(4, now_.ns);
  FOCALFLEET_TRY(s.Run());
  return KeepUnit(row.unit);
}

Status RowWriter::Put(const ParameterRow& row) {
  for (Statement* s : {&statements_[Sql::kParameterChanged], &statements_[Sql::kParameter]}) {
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

Status RowWriter::Put(const TuningRow& row) {
  for (Statement* s : {&statements_[Sql::kTuningKept], &statements_[Sql::kTuning]}) {
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

Status RowWriter::Put(const ConfigurationRow& row) {
  Statement& s = statements_[Sql::kConfiguration];
  s.Bind(1, static_cast<std::int64_t>(row.id));
  s.BindText(2, row.source);
  s.Bind(3, Code(row.state));
  s.Bind(4, row.counts.targeted);
  s.Bind(5, row.counts.arrived);
  s.Bind(6, row.counts.refused);
  s.Bind(7, row.counts.failed);
  s.BindReal(8, row.makespan_predicted_s);
  s.BindReal(9, row.makespan_s);
  s.BindReal(10, row.energy_J);
  s.BindReal(11, row.peak_power_W);
  s.BindReal(12, row.start_skew_s);
  s.BindReal(13, row.start_skew_bound_s);
  s.Bind(14, now_.ns);
  s.Bind(15, row.counts.stopped);
  s.Bind(16, row.counts.unmeasured);
  FOCALFLEET_TRY(s.Run());
  return SetMeta(statements_[Sql::kRaiseMeta], "next_configuration", row.id + 1);
}

Status RowWriter::Put(const AlarmRow& row) {
  Statement& s = statements_[Sql::kAlarm];
  BindAlarm(s, row);
  s.Bind(6, now_.ns);
  BindName(s, 7, row.name);
  FOCALFLEET_TRY(s.Run());
  return SetMeta(statements_[Sql::kRaiseMeta], "next_alarm", row.id + 1);
}

Status RowWriter::Put(const OpenAlarmRow& row) {
  Statement& s = statements_[Sql::kOpenAlarm];
  BindAlarm(s, row);
  BindName(s, 6, row.name);
  s.Bind(7, row.count);
  s.Bind(8, Code(row.state));
  s.Bind(9, row.first_unix_ns);
  s.Bind(10, row.last_unix_ns);
  s.Bind(11, row.acknowledged_unix_ns);
  s.Bind(12, row.ended_unix_ns);
  s.BindText(13, row.acknowledged_by);
  return s.Run();
}

Status RowWriter::Put(const MuteRow& row) {
  Statement& s = statements_[Sql::kMute];
  s.BindText(1, Name(row.name));
  s.Bind(2, row.until_unix_ns);
  s.Bind(3, row.since_unix_ns);
  s.BindText(4, row.reason);
  s.BindText(5, row.by);
  return s.Run();
}

// The number is set, not raised: move ids have 16 bits and begin again.
Status RowWriter::Put(const NextMoveRow& row) {
  return SetMeta(statements_[Sql::kSetMeta], "next_move", row.next.value);
}

Status RowWriter::Put(const ModelRow& row) {
  if (row.text != nullptr && !row.sha256.empty()) {
    Statement& model = statements_[Sql::kModel];
    model.BindText(1, row.sha256);
    model.BindText(2, *row.text);
    model.Bind(3, now_.ns);
    FOCALFLEET_TRY(model.Run());
  }
  Statement& s = statements_[Sql::kModelChange];
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

Status RowWriter::Put(const AuditRow& row) {
  FOCALFLEET_TRY_ASSIGN(const AuditHead before, ReadAuditHead(&statements_[Sql::kAuditHead]));
  AuditEntry entry{.entry = before.entry + 1,
                   .at = now_,
                   .row = row,
                   .previous_sha256 = before.sha256,
                   .sha256 = {}};
  entry.sha256 = ChainedSha256(entry);
  BindAuditEntry(entry, &statements_[Sql::kAudit]);
  FOCALFLEET_TRY(statements_[Sql::kAudit].Run());
  return SetMeta(statements_[Sql::kSetMeta], "audit_entries", entry.entry);
}

Status RowWriter::WriteAxis(const VectorRow& row, Axis axis) {
  const AxisKnowledge& knowledge = row.knowledge[Index(axis)];
  const std::int32_t subdivision = row.subdivision[Index(axis)];
  Statement& s = statements_[Sql::kAxis];
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

Status RowWriter::WriteOrientation(const MeasurementRow& row, const FibreCarrierReading& carrier) {
  Statement& s = statements_[Sql::kOrientation];
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

Status RowWriter::KeepVector(const VectorRow& row, Axis axis) {
  const AxisKnowledge& knowledge = row.knowledge[Index(axis)];
  Statement& s = statements_[Sql::kAxisChanged];
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

Status RowWriter::KeepUnit(UnitId unit) {
  statements_[Sql::kUnitChanged].Bind(1, unit.value);
  return statements_[Sql::kUnitChanged].Run();
}

Status RowWriter::SetMeta(Statement& s, std::string_view key, std::uint64_t value) {
  s.BindText(1, key);
  s.Bind(2, static_cast<std::int64_t>(value));
  return s.Run();
}

}  // namespace focalfleet::store_internal
