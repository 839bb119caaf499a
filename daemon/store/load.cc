#include <algorithm>

#include "daemon/store/cells.h"

namespace focalfleet::store_internal {
namespace {

/// Steps `sql` to its end; `read` takes each row and leaves its faults in the cells.
template <class Read>
Status ForEach(Connection& connection, const char* table, int key_columns, const char* sql,
               Read read) {
  FOCALFLEET_TRY_ASSIGN(Statement statement, connection.Prepare(sql));
  for (;;) {
    const auto row = statement.Next();
    if (!row) return tl::unexpected<Error>(connection.Named(row.error()));
    if (!*row) return {};
    Cells cells(statement, table, key_columns);
    read(cells);
    if (cells.error()) return tl::unexpected<Error>(connection.Named(*cells.error()));
  }
}

/// The column holds whether the row's checksum is right.
void CheckSum(Cells& cells, int column) {
  if (!cells.error())
    cells.Require(!cells.IsNull(column) && cells.Flag(column),
                  "it is not as it was written: its checksum is another");
}

Status LoadUnits(Connection& connection, StoredFleet* fleet) {
  return ForEach(
      connection, "unit", 1,
      "SELECT unit_id, serial, enabled, reason, checksum = row_checksum(unit_id, serial, "
      "enabled, reason, at_ns) FROM unit ORDER BY unit_id",
      [fleet](Cells& cells) {
        StoredFleet::StoredUnit unit;
        unit.unit = {cells.Whole<std::uint32_t>(0)};
        unit.serial = {cells.Whole<std::uint32_t>(1)};
        unit.enabled = cells.Flag(2);
        unit.reason = cells.Text(3);
        CheckSum(cells, 4);
        fleet->units.push_back(std::move(unit));
      });
}

/// Checks a row against itself: vector and turns repeat low, less the offset. A row that
/// contradicts itself is an error.
void CheckVector(Cells& cells, const AxisKnowledge& knowledge, std::uint16_t subdivision,
                 std::int32_t offset) {
  const bool place = knowledge.witness >= Witness::kPredicted && subdivision != 0;
  cells.Require(cells.IsNull(7) != place && cells.IsNull(8) != place,
                "vector and turns do not belong to its witness");
  if (!place || cells.error()) return;
  const std::int64_t vector = cells.Integer(7, 0, subdivision - 1);
  const std::int64_t turns = cells.Whole<std::int32_t>(8);
  cells.Require(turns * subdivision + vector == std::int64_t{knowledge.low} - offset,
                "vector and turns disagree with low");
}

Status LoadVectors(Connection& connection, StoredFleet* fleet) {
  bool half = false;  // theta of the last serial was read, phi not yet
  FOCALFLEET_TRY(ForEach(connection, "axis_state", 2,
                         "SELECT serial, axis, witness, low, high, move, subdivision, vector, "
                         "turns, origin, offset, "
                         "checksum = row_checksum(serial, axis, witness, low, high, vector, turns, "
                         "subdivision, move, origin, at_ns, offset) FROM axis_state "
                         "ORDER BY serial, axis",
                         [fleet, &half](Cells& cells) {
                           const SerialNumber serial = cells.Serial(0);
                           const Axis axis = cells.AxisAt(1);
                           const AxisKnowledge knowledge = cells.Knowledge(2);
                           const MoveId move{cells.Whole<std::uint16_t>(5)};
                           const auto subdivision = cells.Whole<std::uint16_t>(6);
                           const Origin origin = cells.Code(9, kLastOrigin);
                           const auto offset = cells.Whole<std::int32_t>(10);
                           if (cells.error()) return;
                           CheckVector(cells, knowledge, subdivision, offset);
                           if (axis == Axis::kTheta) {
                             cells.Require(!half, "the serial number before it has no phi");
                             fleet->vectors.push_back({serial, {}, {}, {}, move, origin});
                           }
                           cells.Require(
                               !fleet->vectors.empty() && fleet->vectors.back().serial == serial,
                               "there is no theta of this serial number");
                           if (cells.error()) return;
                           VectorRow& row = fleet->vectors.back();
                           cells.Require(row.move == move && row.origin == origin,
                                         "theta and phi are of different moves");
                           row.knowledge[Index(axis)] = knowledge;
                           row.subdivision[Index(axis)] = subdivision;
                           row.offset[Index(axis)] = offset;
                           CheckSum(cells, 11);
                           half = axis == Axis::kTheta;
                         }));
  if (!half) return {};
  return tl::unexpected<Error>(connection.Named(
      {ErrorCode::kInvalid, "axis_state, row serial " +
                                std::to_string(fleet->vectors.back().serial.value) +
                                ", axis 0: there is no phi of this serial number"}));
}

Status LoadOpenIntents(Connection& connection, StoredFleet* fleet) {
  std::int64_t last = INT64_MIN;
  return ForEach(
      connection, "intent", 1,
      "SELECT entry, configuration, serial, unit_id, move, theta_from, phi_from, theta_to, phi_to, "
      "theta_low, theta_high, phi_low, phi_high, checksum = row_checksum(configuration, unit_id, "
      "serial, move, theta_from, phi_from, theta_to, phi_to, theta_low, theta_high, phi_low, "
      "phi_high), end FROM intent INDEXED BY intent_open WHERE end IS NULL ORDER BY entry",
      [fleet, &last](Cells& cells) {
        const std::int64_t entry = cells.Whole<std::int64_t>(0);
        // Two entries of a damaged index may lead to one row, in place of another.
        cells.Require(entry > last, "it is there twice");
        last = entry;
        const auto vectors = [&cells](int column) { return cells.Whole<std::int32_t>(column); };
        IntentRow row;
        row.configuration = cells.Whole<std::uint64_t>(1);
        row.serial = cells.Serial(2);
        row.unit = {cells.Whole<std::uint32_t>(3)};
        row.move = {cells.Whole<std::uint16_t>(4)};
        row.from = {vectors(5), vectors(6)};
        row.to = {vectors(7), vectors(8)};
        row.hull[0] = {Witness::kInterval, vectors(9), vectors(10)};
        row.hull[1] = {Witness::kInterval, vectors(11), vectors(12)};
        cells.Require(row.hull[0].low <= row.hull[0].high && row.hull[1].low <= row.hull[1].high,
                      "low is above high");
        cells.Require(cells.IsNull(14), "it is open and has ended");
        CheckSum(cells, 13);
        fleet->open_intents.push_back(row);
      });
}

Status LoadParameters(Connection& connection, StoredFleet* fleet) {
  return ForEach(
      connection, "parameter", 3,
      "SELECT serial, axis, parameter, value, origin, checksum = row_checksum(serial, axis, "
      "parameter, value, origin, at_ns) FROM parameter ORDER BY serial, axis, parameter",
      [fleet](Cells& cells) {
        ParameterRow row;
        row.serial = cells.Serial(0);
        row.axis = cells.AxisAt(1);
        row.parameter = cells.Code(2, kLastParameter);
        row.value = cells.Whole<std::int32_t>(3);
        row.origin = cells.Code(4, kLastOrigin);
        CheckSum(cells, 5);
        fleet->parameters.push_back(row);
      });
}

Status LoadTunings(Connection& connection, StoredFleet* fleet) {
  return ForEach(
      connection, "tuning", 2,
      "SELECT serial, axis, critical, repeat, margin, load_uNm, v_bus_V, counter1, subdivision, "
      "mode, origin, checksum = row_checksum(serial, axis, critical, repeat, margin, load_uNm, "
      "v_bus_V, counter1, subdivision, mode, origin, at_ns) FROM tuning ORDER BY serial, axis",
      [fleet](Cells& cells) {
        fleet->tunings.push_back(ReadTuning(cells, 0));
        CheckSum(cells, 11);
      });
}

Status LoadConfigurations(Connection& connection, StoredFleet* fleet) {
  return ForEach(
      connection, "configuration", 1,
      "SELECT id, source, state, targeted, arrived, refused, failed, makespan_predicted_s, "
      "makespan_s, energy_J, peak_power_W, start_skew_s, start_skew_bound_s, stopped, unmeasured "
      "FROM configuration "
      "WHERE state < 3 OR id = (SELECT max(id) FROM configuration) ORDER BY id",
      [fleet](Cells& cells) { fleet->configurations.push_back(ReadConfiguration(cells)); });
}
static_assert(ConfigurationState::kDone == ConfigurationState{3});

Status LoadOpenAlarms(Connection& connection, StoredFleet* fleet) {
  return ForEach(
      connection, "open_alarm", 1,
      "SELECT id, severity, unit_id, bus_id, text, name, count, state, first_ns, last_ns, "
      "acknowledged_ns, ended_ns, acknowledged_by FROM open_alarm WHERE state < 2 ORDER BY id",
      [fleet](Cells& cells) { fleet->open_alarms.push_back(ReadOpenAlarm(cells)); });
}
static_assert(OpenAlarmRow::State::kOver == OpenAlarmRow::State{2});

Status LoadMutes(Connection& connection, StoredFleet* fleet) {
  return ForEach(connection, "mute", 1,
                 "SELECT name, until_ns, since_ns, reason, by FROM mute ORDER BY name",
                 [fleet](Cells& cells) {
                   MuteRow row;
                   row.name = cells.AlarmNameAt(0);
                   row.until_unix_ns = cells.Integer(1, 0, INT64_MAX);
                   row.since_unix_ns = cells.Whole<std::int64_t>(2);
                   row.reason = cells.Text(3);
                   row.by = cells.Text(4);
                   fleet->mutes.push_back(std::move(row));
                 });
}

Status LoadMeta(Connection& connection, StoredFleet* fleet) {
  const std::uint64_t open = fleet->open_intents.size();
  bool counted = false;
  FOCALFLEET_TRY(ForEach(connection, "meta", 1,
                         "SELECT key, value, checksum = row_checksum(key, value) FROM meta",
                         [fleet, open, &counted](Cells& cells) {
                           const std::string key = cells.Text(0);
                           if (key == "next_move") {
                             fleet->next_move = {cells.Whole<std::uint16_t>(1)};
                           } else if (key == "next_configuration") {
                             fleet->next_configuration = cells.Whole<std::uint64_t>(1);
                           } else if (key == "next_exposure") {
                             fleet->next_exposure = cells.Whole<std::uint64_t>(1);
                           } else if (key == "next_alarm") {
                             fleet->next_alarm = cells.Whole<std::uint64_t>(1);
                           } else if (key == "audit_entries") {
                             cells.Whole<std::uint64_t>(1);  // CheckAudit compares it
                           } else if (key == "open_intents") {
                             cells.Require(cells.Whole<std::uint64_t>(1) == open,
                                           "so many moves are not open: rows are lost");
                             counted = true;
                           } else {
                             cells.Require(false, "nobody reads this key");
                           }
                           CheckSum(cells, 2);
                         }));
  if (counted) return {};
  return tl::unexpected<Error>(
      connection.Named({ErrorCode::kInvalid, "meta: the row open_intents is not there"}));
}

/// No row is lost by a wrong bit in a page's header, which no row's checksum covers. Pages of
/// `intent` are not read, since these are all motions of years: `meta` counts its open rows.
Status CheckPages(Connection& connection) {
  for (const char* const table : {"unit", "axis_state", "parameter", "tuning", "meta"}) {
    FOCALFLEET_TRY_ASSIGN(const std::string flaw, connection.QuickCheck(table));
    if (!flaw.empty())
      return tl::unexpected<Error>(
          connection.Named({ErrorCode::kInvalid, "table " + std::string(table) + ": " + flaw}));
  }
  return {};
}

Status LoadAll(Connection& connection, StoredFleet* fleet) {
  FOCALFLEET_TRY(LoadUnits(connection, fleet));
  FOCALFLEET_TRY(LoadVectors(connection, fleet));
  FOCALFLEET_TRY(LoadOpenIntents(connection, fleet));
  FOCALFLEET_TRY(LoadParameters(connection, fleet));
  FOCALFLEET_TRY(LoadTunings(connection, fleet));
  FOCALFLEET_TRY(LoadConfigurations(connection, fleet));
  FOCALFLEET_TRY(LoadOpenAlarms(connection, fleet));
  FOCALFLEET_TRY(LoadMutes(connection, fleet));
  FOCALFLEET_TRY(LoadMeta(connection, fleet));
  return CheckPages(connection);
}

}  // namespace

Result<StoredFleet> LoadFleet(Connection& connection) {
  StoredFleet fleet;
  connection.Rollback();
  FOCALFLEET_TRY(connection.Execute("BEGIN"));
  const Status loaded = LoadAll(connection, &fleet);
  connection.Rollback();  // nothing was written
  if (!loaded) return tl::unexpected<Error>(loaded.error());
  return fleet;
}

}  // namespace focalfleet::store_internal
