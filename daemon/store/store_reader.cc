#include "daemon/store/store_reader.h"

#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "daemon/store/cells.h"
#include "daemon/store/schema.h"
#include "daemon/store/sqlite.h"
#include "protocol/base/limits.h"

namespace focalfleet {

using namespace store_internal;

namespace {

using Filters = std::vector<std::int64_t>;

/// `sql` ends in "LIMIT ?1" and may filter by ?2 and more; `read` makes one entry of one row.
template <class Entry, class Read>
Result<std::vector<Entry>> Query(Connection& connection, const char* table, const char* sql,
                                 std::uint32_t limit, const Filters& filters, Read read) {
  FOCALFLEET_TRY_ASSIGN(Statement statement, connection.Prepare(sql));
  statement.Bind(1, limit);
  int parameter = 2;
  for (const std::int64_t filter : filters) statement.Bind(parameter++, filter);
  std::vector<Entry> entries;
  for (;;) {
    const auto row = statement.Next();
    if (!row) return tl::unexpected<Error>(connection.Named(row.error()));
    if (!*row) return entries;
    Cells cells(statement, table, 1);
    entries.push_back(read(cells));
    if (cells.error()) return tl::unexpected<Error>(connection.Named(*cells.error()));
  }
}

/// Conditions of a query, joined by AND, with their parameters from ?2 on.
struct Conditions {
  std::string where;
  Filters filters;

  /// `condition` ends before the parameter.
  void Add(const std::string& condition, std::int64_t parameter) {
    filters.push_back(parameter);
    where += (where.empty() ? "WHERE " : "AND ") + condition + " ?" +
             std::to_string(filters.size() + 1) + " ";
  }
  void Add(std::optional<UnitId> unit) {
    if (unit) Add("unit_id =", unit->value);
  }
  void Add(const Period& period, const std::string& column) {
    Add(column + " >=", period.since.ns);
    Add(column + " <", period.until.ns);
  }
};

static_assert(IsOver(ConfigurationState{3}) && !IsOver(ConfigurationState{2}));
constexpr const char* kIsOver = "AND state >= 3 ";
constexpr const char* kLastEnded =
    "SELECT coalesce(max(id), 0) FROM configuration WHERE state >= 3";

Result<std::vector<ConfigurationHistory>> QueryConfigurations(Connection& connection,
                                                              const Conditions& conditions,
                                                              const std::string& order,
                                                              std::uint32_t limit) {
  const std::string sql =
      std::string(kConfigurationColumns) + conditions.where + "ORDER BY id " + order + " LIMIT ?1";
  return Query<ConfigurationHistory>(connection, "configuration", sql.c_str(), limit,
                                     conditions.filters, ReadConfigurationHistory);
}

Result<std::vector<AlarmHistory>> QueryAlarms(Connection& connection, const Conditions& conditions,
                                              const std::string& order, std::uint32_t limit) {
  const std::string sql = "SELECT id, severity, unit_id, bus_id, text, name, at_ns FROM alarm " +
                          conditions.where + "ORDER BY " + order + " LIMIT ?1";
  return Query<AlarmHistory>(connection, "alarm", sql.c_str(), limit, conditions.filters,
                             [](Cells& cells) {
                               return AlarmHistory{ReadAlarm(cells), cells.Time(6)};
                             });
}

Result<std::vector<UnitHistory>> QueryUnits(Connection& connection, const Conditions& conditions,
                                            const std::string& order, std::uint32_t limit) {
  const std::string sql =
      "SELECT entry, unit_id, serial, enabled, reason, at_ns FROM unit_history " +
      conditions.where + "ORDER BY entry " + order + " LIMIT ?1";
  return Query<UnitHistory>(connection, "unit_history", sql.c_str(), limit, conditions.filters,
                            [](Cells& cells) {
                              UnitHistory entry;
                              entry.entry = cells.Whole<std::uint64_t>(0);
                              entry.unit = {cells.Whole<std::uint32_t>(1)};
                              entry.serial = {cells.Whole<std::uint32_t>(2)};
                              entry.enabled = cells.Flag(3);
                              entry.reason = cells.Text(4);
                              entry.at = cells.Time(5);
                              return entry;
                            });
}

}  // namespace

StoreReader::StoreReader() = default;
StoreReader::~StoreReader() = default;

Result<std::unique_ptr<StoreReader>> StoreReader::Open(const std::string& path,
                                                       const StoreOptions& options) {
  struct stat status {};
  if (!options.vfs_has_files && stat(path.c_str(), &status) != 0) {
    return Fail(ErrorCode::kUnavailable, "store " + path + ": " + std::strerror(errno));
  }
  auto reader = std::unique_ptr<StoreReader>(new StoreReader);
  FOCALFLEET_TRY_ASSIGN(reader->connection_,
                        Connection::Open(path, Connection::Mode::kRead, options.vfs,
                                         static_cast<int>(options.busy_wait.count())));
  const auto version_max = static_cast<std::int32_t>(Migrations().size());
  FOCALFLEET_TRY_ASSIGN(const std::int32_t version,
                        InspectSchema(*reader->connection_, version_max));
  if (version < version_max) {
    return Fail(ErrorCode::kUnavailable, "store " + path + " has version " +
                                             std::to_string(version) +
                                             ": the daemon carries it over when it starts");
  }
  return reader;
}

Result<StoredFleet> StoreReader::Load() { return LoadFleet(*connection_); }

Result<std::vector<MoveHistory>> StoreReader::Moves(std::optional<UnitId> unit, std::uint32_t limit,
                                                    const Period& period,
                                                    std::optional<IntentEnd> end) {
  Conditions conditions;
  conditions.Add(unit);
  conditions.Add(period, "began_ns");
  if (end) conditions.Add("end =", static_cast<std::int64_t>(*end));
  const std::string sql =
      std::string(kMoveColumns) + conditions.where + "ORDER BY entry DESC LIMIT ?1";
  return Query<MoveHistory>(*connection_, "intent", sql.c_str(), limit, conditions.filters,
                            ReadMove);
}

Result<std::vector<ConfigurationHistory>> StoreReader::Configurations(
    std::uint32_t limit, const Period& period, std::optional<ConfigurationState> state) {
  Conditions conditions;
  conditions.Add(period, "changed_ns");
  if (state) conditions.Add("state =", static_cast<std::int64_t>(*state));
  return QueryConfigurations(*connection_, conditions, "DESC", limit);
}

Result<std::vector<ParameterHistory>> StoreReader::Parameters(SerialNumber serial,
                                                              std::uint32_t limit) {
  return Query<ParameterHistory>(*connection_, "parameter_history",
                                 "SELECT entry, serial, axis, parameter, value, origin, at_ns FROM "
                                 "parameter_history WHERE serial = ?2 "
                                 "ORDER BY entry DESC LIMIT ?1",
                                 limit, {serial.value}, [](Cells& cells) {
                                   ParameterHistory entry;
                                   entry.row.serial = cells.Serial(1);
                                   entry.row.axis = cells.AxisAt(2);
                                   entry.row.parameter = cells.Code(3, kLastParameter);
                                   entry.row.value = cells.Whole<std::int32_t>(4);
                                   entry.row.origin = cells.Code(5, kLastOrigin);
                                   entry.at = cells.Time(6);
                                   return entry;
                                 });
}

Result<std::vector<TuningHistory>> StoreReader::Tunings(SerialNumber serial, std::uint32_t limit) {
  return Query<TuningHistory>(
      *connection_, "tuning_history",
      "SELECT entry, serial, axis, critical, repeat, margin, load_uNm, v_bus_V, counter1, "
      "subdivision, mode, origin, at_ns FROM tuning_history WHERE serial = ?2 "
      "ORDER BY entry DESC LIMIT ?1",
      limit, {serial.value}, [](Cells& cells) {
        TuningHistory entry;
        entry.row = ReadTuning(cells, 1);
        entry.at = cells.Time(12);
        return entry;
      });
}

Result<std::vector<AlarmHistory>> StoreReader::Alarms(std::uint32_t limit, const Period& period) {
  Conditions conditions;
  conditions.Add(period, "at_ns");
  return QueryAlarms(*connection_, conditions, "at_ns DESC, id DESC", limit);
}

Result<std::vector<OpenAlarmRow>> StoreReader::EarlierAlarms(std::uint32_t limit,
                                                             const Period& period) {
  return Query<OpenAlarmRow>(
      *connection_, "open_alarm",
      "SELECT id, severity, unit_id, bus_id, text, name, count, state, first_ns, last_ns, "
      "acknowledged_ns, ended_ns, acknowledged_by FROM open_alarm "
      "WHERE state = 2 AND last_ns >= ?2 AND last_ns < ?3 ORDER BY last_ns DESC LIMIT ?1",
      limit, {period.since.ns, period.until.ns}, [](Cells& cells) { return ReadOpenAlarm(cells); });
}

Result<std::vector<MeasurementHistory>> StoreReader::Measurements(std::uint64_t exposure) {
  return Query<MeasurementHistory>(
      *connection_, "measurement",
      "SELECT exposure, unit_id, m.serial, configuration, status, other, x_mm, y_mm, sigma_um, "
      "theta, phi, error_um, target_x_mm, target_y_mm, m.at_ns, var_x_mm2, cov_xy_mm2, var_y_mm2, "
      "target_id, delay_s, source, trusted, verdict, used, alpha_deg, beta_deg, gamma_deg, "
      "cov_aa_deg2, cov_ab_deg2, cov_ag_deg2, cov_bb_deg2, cov_bg_deg2, cov_gg_deg2, "
      "coalesce((SELECT began_ns >= m.at_ns FROM intent WHERE unit_id = m.unit_id AND "
      "configuration = m.configuration AND (end IS NULL OR end <> 3) ORDER BY entry DESC LIMIT 1), "
      "0) "
      "FROM measurement AS m LEFT JOIN orientation USING (exposure, unit_id) WHERE exposure = ?2 "
      "ORDER BY unit_id LIMIT ?1",
      limits::kUnits, {static_cast<std::int64_t>(exposure)}, [](Cells& cells) {
        MeasurementHistory history;
        MeasurementRow& row = history.row;
        row.exposure = cells.Whole<std::uint64_t>(0);
        row.unit = {cells.Whole<std::uint32_t>(1)};
        row.serial = cells.Serial(2);
        row.configuration = cells.Whole<std::uint64_t>(3);
        row.status = cells.Code(4, kLastMeasurementStatus);
        if (!cells.IsNull(5)) row.other = UnitId{cells.Whole<std::uint32_t>(5)};
        row.x_mm = cells.Real(6);
        row.y_mm = cells.Real(7);
        cells.Require(cells.IsNull(9) == cells.IsNull(10), "it has a place on one axis alone");
        if (!cells.IsNull(9))
          row.place = Pose{cells.Whole<std::int32_t>(9), cells.Whole<std::int32_t>(10)};
        if (!cells.IsNull(11)) row.error_um = cells.Real(11);
        cells.Require(cells.IsNull(12) == cells.IsNull(13), "it has a target on one axis alone");
        if (!cells.IsNull(12)) row.target_fp = PointFp{cells.Real(12), cells.Real(13)};
        history.at = {cells.Whole<std::int64_t>(14)};
        row.covariance = {cells.Real(15), cells.Real(16), cells.Real(17)};
        cells.Require(row.covariance.xx >= 0 && row.covariance.yy >= 0, "its variance is negative");
        row.target_id = cells.Text(18);
        if (!cells.IsNull(19)) row.delay_s = cells.Real(19);
        row.source = cells.Code(20, kLastMeasurementSource);
        row.carrier = ReadFibreCarrier(cells, 21);
        history.moved_since = cells.Whole<std::int64_t>(33) != 0;
        return history;
      });
}

Result<std::optional<std::uint64_t>> StoreReader::LastExposure(std::uint64_t configuration) {
  FOCALFLEET_TRY_ASSIGN(
      const auto found,
      Query<std::uint64_t>(*connection_, "measurement",
                           "SELECT exposure FROM measurement WHERE configuration = ?2 "
                           "ORDER BY exposure DESC LIMIT ?1",
                           1, {static_cast<std::int64_t>(configuration)},
                           [](Cells& cells) { return cells.Whole<std::uint64_t>(0); }));
  if (found.empty()) return std::optional<std::uint64_t>();
  return std::optional<std::uint64_t>(found.front());
}

Result<std::vector<ModelHistory>> StoreReader::Models(std::uint32_t limit) {
  return Query<ModelHistory>(
      *connection_, "model_change",
      "SELECT entry, sha256, restores, name, campaign, campaign_sha256, rms_before_um, "
      "rms_after_um, at_ns FROM model_change ORDER BY entry DESC LIMIT ?1",
      limit, Filters{}, [](Cells& cells) {
        ModelHistory entry;
        ModelRow& row = entry.row;
        row.entry = cells.Whole<std::uint64_t>(0);
        if (!cells.IsNull(1)) row.sha256 = cells.Text(1);
        if (!cells.IsNull(2)) row.restores = cells.Whole<std::uint64_t>(2);
        cells.Require(row.restores < row.entry, "it restores what came after it");
        row.name = cells.Text(3);
        row.campaign = cells.Text(4);
        row.campaign_sha256 = cells.Text(5);
        row.rms_before_um = cells.Real(6);
        row.rms_after_um = cells.Real(7);
        entry.at = cells.Time(8);
        return entry;
      });
}

Result<std::vector<UnitId>> StoreReader::CountedAnewSince(std::uint64_t change) {
  return Query<UnitId>(
      *connection_, "counted_anew",
      "SELECT unit_id FROM unit JOIN counted_anew USING (serial) WHERE model >= ?2 "
      "ORDER BY unit_id LIMIT ?1",
      limits::kUnits, {static_cast<std::int64_t>(change)},
      [](Cells& cells) { return UnitId{cells.Whole<std::uint32_t>(0)}; });
}

Result<std::vector<std::pair<UnitId, SerialNumber>>> StoreReader::Bindings() {
  return Query<std::pair<UnitId, SerialNumber>>(
      *connection_, "unit",
      "SELECT unit_id, serial FROM unit WHERE serial <> 0 ORDER BY unit_id LIMIT ?1",
      limits::kUnits, Filters{}, [](Cells& cells) {
        return std::pair{UnitId{cells.Whole<std::uint32_t>(0)}, cells.Serial(1)};
      });
}

Result<std::string> StoreReader::ModelText(const std::string& sha256) {
  FOCALFLEET_TRY_ASSIGN(Statement statement,
                        connection_->Prepare("SELECT text FROM model WHERE sha256 = ?1"));
  statement.BindText(1, sha256);
  const auto row = statement.Next();
  if (!row) return tl::unexpected<Error>(connection_->Named(row.error()));
  if (!*row) return Fail(ErrorCode::kRefused, "the store has no model " + sha256);
  Cells cells(statement, "model", 1);
  std::string text = cells.Text(0);
  if (cells.error()) return tl::unexpected<Error>(connection_->Named(*cells.error()));
  return text;
}

Result<std::vector<UnitHistory>> StoreReader::Units(std::optional<UnitId> unit, std::uint32_t limit,
                                                    const Period& period) {
  Conditions conditions;
  conditions.Add(unit);
  conditions.Add(period, "at_ns");
  return QueryUnits(*connection_, conditions, "DESC", limit);
}

Result<EntryNumbers> StoreReader::NewestEntries() {
  EntryNumbers newest;
  const std::pair<const char*, std::uint64_t*> kinds[] = {
      {"SELECT coalesce(max(id), 0) FROM alarm", &newest.alarm},
      {"SELECT coalesce(max(entry), 0) FROM unit_history", &newest.unit},
      {"SELECT coalesce(max(id), 0) FROM configuration", &newest.begun},
      {kLastEnded, &newest.ended}};
  for (const auto& [sql, number] : kinds) {
    FOCALFLEET_TRY_ASSIGN(const std::int64_t found, connection_->Integer(sql));
    *number = static_cast<std::uint64_t>(found);
  }
  return newest;
}

Result<EntriesAfter> StoreReader::After(const EntryNumbers& numbers, std::uint32_t limit) {
  const auto after = [](const char* column, std::uint64_t number) {
    Conditions conditions;
    conditions.Add(std::string(column) + " >", static_cast<std::int64_t>(number));
    return conditions;
  };
  EntriesAfter entries;
  FOCALFLEET_TRY_ASSIGN(entries.alarms,
                        QueryAlarms(*connection_, after("id", numbers.alarm), "id ASC", limit));
  FOCALFLEET_TRY_ASSIGN(entries.units,
                        QueryUnits(*connection_, after("entry", numbers.unit), "ASC", limit));
  FOCALFLEET_TRY_ASSIGN(
      entries.begun, QueryConfigurations(*connection_, after("id", numbers.begun), "ASC", limit));
  Conditions over = after("id", numbers.ended);
  over.where += kIsOver;
  FOCALFLEET_TRY_ASSIGN(entries.ended, QueryConfigurations(*connection_, over, "ASC", limit));
  return entries;
}

void StoreReader::EndWith(const std::atomic<bool>* ending) {
  // Some 100 us between two looks: an end does not wait for a question.
  constexpr int kInstructions = 10'000;
  const auto ends = [](void* flag) {
    return static_cast<const std::atomic<bool>*>(flag)->load() ? 1 : 0;
  };
  sqlite3_progress_handler(connection_->db(), kInstructions, ends,
                           const_cast<std::atomic<bool>*>(ending));
}

}  // namespace focalfleet
