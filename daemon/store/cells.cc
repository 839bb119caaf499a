#include "daemon/store/cells.h"

#include <cmath>

namespace focalfleet::store_internal {
namespace {

AxisKnowledge HullAt(Cells& cells, int column) {
  const AxisKnowledge hull{Witness::kInterval, cells.Whole<std::int32_t>(column),
                           cells.Whole<std::int32_t>(column + 1)};
  cells.Require(hull.low <= hull.high, "low is above high");
  return hull;
}

}  // namespace

void Cells::Fault(const std::string& what) {
  if (error_) return;
  std::string row;
  for (int i = 0; i < key_columns_; ++i) {
    const auto* value = sqlite3_column_text(statement_, i);
    row += std::string(i == 0 ? "" : ", ") + sqlite3_column_name(statement_, i) + " " +
           (value == nullptr ? "NULL" : reinterpret_cast<const char*>(value));
  }
  error_ = Error{ErrorCode::kInvalid, std::string(table_) + ", row " + row + ": " + what};
}

std::int64_t Cells::Integer(int column, std::int64_t low, std::int64_t high) {
  const std::int64_t value = sqlite3_column_int64(statement_, column);
  if (sqlite3_column_type(statement_, column) == SQLITE_INTEGER && value >= low && value <= high)
      [[likely]] {
    return error_ ? 0 : value;
  }
  const auto* text = sqlite3_column_text(statement_, column);
  Fault(std::string(sqlite3_column_name(statement_, column)) + " is " +
        (text == nullptr ? "NULL" : reinterpret_cast<const char*>(text)) + ", not in " +
        std::to_string(low) + ".." + std::to_string(high));
  return 0;
}

double Cells::Real(int column) {
  switch (sqlite3_column_type(statement_, column)) {
    case SQLITE_NULL:
      return std::numeric_limits<double>::quiet_NaN();
    case SQLITE_INTEGER:
    case SQLITE_FLOAT:
      return sqlite3_column_double(statement_, column);
    default:
      Fault(std::string(sqlite3_column_name(statement_, column)) + " is not a number");
      return 0;
  }
}

std::string Cells::Text(int column) {
  if (sqlite3_column_type(statement_, column) != SQLITE_TEXT) {
    Fault(std::string(sqlite3_column_name(statement_, column)) + " is not text");
    return {};
  }
  const auto* text = reinterpret_cast<const char*>(sqlite3_column_text(statement_, column));
  return {text, static_cast<std::size_t>(sqlite3_column_bytes(statement_, column))};
}

AxisKnowledge Cells::Knowledge(int column) {
  const AxisKnowledge knowledge{Code(column, Witness::kMeasured), Whole<std::int32_t>(column + 1),
                                Whole<std::int32_t>(column + 2)};
  if (const char* flaw = Flaw(knowledge)) Fault(flaw);
  return knowledge;
}

ConfigurationRow ReadConfiguration(Cells& cells) {
  return {.id = cells.Whole<std::uint64_t>(0),
          .source = cells.Text(1),
          .state = cells.Code(2, kLastConfigurationState),
          .counts = {.targeted = cells.Whole<std::uint32_t>(3),
                     .arrived = cells.Whole<std::uint32_t>(4),
                     .refused = cells.Whole<std::uint32_t>(5),
                     .failed = cells.Whole<std::uint32_t>(6),
                     .stopped = cells.Whole<std::uint32_t>(13),
                     .unmeasured = cells.Whole<std::uint32_t>(14)},
          .makespan_predicted_s = cells.Real(7),
          .makespan_s = cells.Real(8),
          .energy_J = cells.Real(9),
          .peak_power_W = cells.Real(10),
          .start_skew_s = cells.Real(11),
          .start_skew_bound_s = cells.Real(12)};
}

AlarmName Cells::AlarmNameAt(int column) {
  if (IsNull(column)) return AlarmName::kUnnamed;
  return AlarmNameOf(Text(column));  // a later version may know more names
}

AlarmRow ReadAlarm(Cells& cells) {
  AlarmRow row;
  row.id = cells.Whole<std::uint64_t>(0);
  row.severity = cells.Code(1, kLastSeverity);
  if (!cells.IsNull(2)) row.unit = UnitId{cells.Whole<std::uint32_t>(2)};
  if (!cells.IsNull(3)) row.bus = BusId{cells.Whole<std::uint32_t>(3)};
  row.text = cells.Text(4);
  row.name = cells.AlarmNameAt(5);
  return row;
}

OpenAlarmRow ReadOpenAlarm(Cells& cells) {
  AlarmRow alarm = ReadAlarm(cells);
  return {.id = alarm.id,
          .name = alarm.name,
          .severity = alarm.severity,
          .unit = alarm.unit,
          .bus = alarm.bus,
          .text = std::move(alarm.text),
          .count = static_cast<std::uint32_t>(cells.Integer(6, 1, UINT32_MAX)),
          .state = cells.Code(7, OpenAlarmRow::State::kOver),
          .first_unix_ns = cells.Whole<std::int64_t>(8),
          .last_unix_ns = cells.Whole<std::int64_t>(9),
          .acknowledged_unix_ns = cells.Whole<std::int64_t>(10),
          .ended_unix_ns = cells.Whole<std::int64_t>(11),
          .acknowledged_by = cells.Text(12)};
}

void Cells::Require(bool condition, const char* what) {
  if (!condition) Fault(what);
}

TuningRow ReadTuning(Cells& cells, int first) {
  TuningRow row;
  row.serial = cells.Serial(first);
  row.axis = cells.AxisAt(first + 1);
  row.critical = cells.Whole<std::uint16_t>(first + 2);
  row.repeat = cells.Whole<std::uint16_t>(first + 3);
  row.margin = cells.Real(first + 4);
  row.load_uNm = cells.Real(first + 5);
  row.v_bus_V = cells.Real(first + 6);
  row.counter1 = cells.Whole<std::uint16_t>(first + 7);
  row.subdivision = cells.Whole<std::uint16_t>(first + 8);
  row.mode = cells.Code(first + 9, kLastMode);
  row.origin = cells.Code(first + 10, kLastOrigin);
  if (!cells.error()) {
    const char* const flaw = Flaw(row);
    cells.Require(flaw == nullptr, flaw);
  }
  return row;
}

std::optional<FibreCarrierReading> ReadFibreCarrier(Cells& cells, int first) {
  if (cells.IsNull(first)) return std::nullopt;
  FibreCarrierReading carrier{.trusted = cells.Flag(first), .verdict = cells.Text(first + 1)};
  carrier.used = cells.Whole<std::uint16_t>(first + 2);
  carrier.solved = !cells.IsNull(first + 3);
  int column = first + 3;
  for (double& angle_deg : carrier.angles_deg) {
    if (carrier.solved) angle_deg = cells.Real(column);
    ++column;
  }
  for (double& covariance_deg2 : carrier.covariance_deg2) {
    if (carrier.solved) covariance_deg2 = cells.Real(column);
    ++column;
  }
  const char* flaw = Flaw(carrier);
  cells.Require(flaw == nullptr, flaw == nullptr ? "" : flaw);
  return carrier;
}

ConfigurationHistory ReadConfigurationHistory(Cells& cells) {
  ConfigurationHistory entry;
  entry.row = ReadConfiguration(cells);
  entry.began = cells.Time(15);
  entry.changed = cells.Time(16);
  return entry;
}

MoveHistory ReadMove(Cells& cells) {
  const auto vectors = [&cells](int column) { return cells.Whole<std::int32_t>(column); };
  MoveHistory move;
  move.entry = cells.Whole<std::uint64_t>(0);
  move.configuration = cells.Whole<std::uint64_t>(1);
  move.unit = {cells.Whole<std::uint32_t>(2)};
  move.serial = cells.Serial(3);
  move.move = {cells.Whole<std::uint16_t>(4)};
  move.from = {vectors(5), vectors(6)};
  move.to = {vectors(7), vectors(8)};
  move.hull = {HullAt(cells, 9), HullAt(cells, 11)};
  move.began = cells.Time(13);
  if (cells.IsNull(15)) return move;
  move.ended = cells.Time(14);
  move.end = cells.Code(15, kLastIntentEnd);
  // Where knowledge of the unit was never written, its place at the end is unknown.
  if (!cells.IsNull(16) && !cells.IsNull(19)) {
    move.ended_at = UnitKnowledge{cells.Knowledge(16), cells.Knowledge(19)};
  }
  return move;
}

}  // namespace focalfleet::store_internal
