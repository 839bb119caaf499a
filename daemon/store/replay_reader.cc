// The part of StoreReader that reads what one configuration left. Neither moves nor measurements
// have an index by configuration. Their keys grow with the configurations' numbers, so the first
// row of a configuration is found by halving.

#include "daemon/store/cells.h"
#include "daemon/store/store_reader.h"
#include "protocol/base/limits.h"

namespace focalfleet {

using namespace store_internal;

namespace {

/// A table whose keys grow with its column `configuration`.
struct KeyedTable {
  const char* name;
  const char* key_max;   // SQL: its largest key
  const char* row_from;  // SQL: key and configuration of the first row at or after key ?1
};
constexpr KeyedTable kMoves = {
    "intent", "SELECT coalesce(max(entry), 0) FROM intent",
    "SELECT entry, configuration FROM intent WHERE entry >= ?1 ORDER BY entry LIMIT 1"};
constexpr KeyedTable kExposures = {
    "measurement", "SELECT coalesce(max(exposure), 0) FROM measurement",
    "SELECT exposure, configuration FROM measurement WHERE exposure >= ?1 ORDER BY exposure LIMIT "
    "1"};

/// The least key from which on no row belongs to a configuration before `configuration`. Cost: some
/// 40 look-ups, however many rows there are.
Result<std::int64_t> FirstKeyOf(Connection& connection, const KeyedTable& table,
                                std::uint64_t configuration) {
  FOCALFLEET_TRY_ASSIGN(const std::int64_t last, connection.Integer(table.key_max));
  FOCALFLEET_TRY_ASSIGN(Statement statement, connection.Prepare(table.row_from));
  std::int64_t low = 0;
  std::int64_t high = last + 1;
  while (low < high) {
    const std::int64_t middle = low + (high - low) / 2;
    statement.Bind(1, middle);
    const auto row = statement.Next();
    if (!row) return tl::unexpected<Error>(connection.Named(row.error()));
    if (!*row) {
      high = middle;
      continue;
    }
    Cells cells(statement, table.name, 1);
    const auto key = cells.Whole<std::int64_t>(0);
    const auto found = cells.Whole<std::uint64_t>(1);
    if (cells.error()) return tl::unexpected<Error>(connection.Named(*cells.error()));
    sqlite3_reset(statement.get());
    if (found < configuration)
      low = key + 1;
    else
      high = middle;
  }
  return low;
}

Result<std::optional<ConfigurationHistory>> FindConfiguration(Connection& connection,
                                                              std::uint64_t id) {
  FOCALFLEET_TRY_ASSIGN(Statement statement,
                        connection.Prepare(std::string(kConfigurationColumns) + "WHERE id = ?1"));
  statement.Bind(1, static_cast<std::int64_t>(id));
  const auto row = statement.Next();
  if (!row) return tl::unexpected<Error>(connection.Named(row.error()));
  if (!*row) return std::optional<ConfigurationHistory>();
  Cells cells(statement, "configuration", 1);
  ConfigurationHistory found = ReadConfigurationHistory(cells);
  if (cells.error()) return tl::unexpected<Error>(connection.Named(*cells.error()));
  return std::optional(std::move(found));
}

/// At most `limit` moves of the configuration from entry `first` on.
Status AddMoves(Connection& connection, std::uint64_t configuration, std::int64_t first,
                std::uint32_t limit, ReplayPage* page) {
  FOCALFLEET_TRY_ASSIGN(
      Statement statement,
      connection.Prepare(std::string(kMoveColumns) + "WHERE entry >= ?1 ORDER BY entry"));
  statement.Bind(1, first);
  for (;;) {
    const auto row = statement.Next();
    if (!row) return tl::unexpected<Error>(connection.Named(row.error()));
    if (!*row) return {};
    Cells cells(statement, "intent", 1);
    MoveHistory move = ReadMove(cells);
    if (cells.error()) return tl::unexpected<Error>(connection.Named(*cells.error()));
    if (move.configuration != configuration) return {};
    page->more = page->moves.size() == limit;
    if (page->more) return {};
    page->moves.push_back(std::move(move));
  }
}

/// The last exposure of the configuration.
Status AddErrors(Connection& connection, std::uint64_t configuration, ReplayPage* page) {
  FOCALFLEET_TRY_ASSIGN(const std::int64_t next,
                        FirstKeyOf(connection, kExposures, configuration + 1));
  FOCALFLEET_TRY_ASSIGN(
      Statement statement,
      connection.Prepare("SELECT unit_id, exposure, configuration, error_um FROM measurement WHERE "
                         "exposure = (SELECT max(exposure) FROM measurement WHERE exposure < ?1) "
                         "ORDER BY unit_id LIMIT ?2"));
  statement.Bind(1, next);
  statement.Bind(2, limits::kUnits);
  for (;;) {
    const auto row = statement.Next();
    if (!row) return tl::unexpected<Error>(connection.Named(row.error()));
    if (!*row) return {};
    Cells cells(statement, "measurement", 2);
    const UnitId unit{cells.Whole<std::uint32_t>(0)};
    const auto exposure = cells.Whole<std::uint64_t>(1);
    if (cells.Whole<std::uint64_t>(2) != configuration && !cells.error()) return {};
    page->exposure = exposure;
    if (!cells.IsNull(3)) page->errors.push_back({unit, cells.Real(3)});
    if (cells.error()) return tl::unexpected<Error>(connection.Named(*cells.error()));
  }
}

/// The exposures from ?1 on and before ?2, one after the other by the key, and unit ?3 in each.
constexpr const char* kUnitInExposures =
    "WITH RECURSIVE exposed(exposure) AS ("
    "SELECT min(exposure) FROM measurement WHERE exposure >= ?1 "
    "UNION ALL SELECT (SELECT min(exposure) FROM measurement WHERE exposure > exposed.exposure) "
    "FROM exposed WHERE exposure < ?2) "
    "SELECT unit_id, exposure, configuration, status, error_um, at_ns FROM exposed "
    "JOIN measurement USING (exposure) WHERE exposure < ?2 AND unit_id = ?3 "
    "ORDER BY exposure DESC";

}  // namespace

Result<std::vector<UnitMeasured>> StoreReader::MeasurementsOf(UnitId unit,
                                                              std::uint64_t configuration) {
  FOCALFLEET_TRY_ASSIGN(const std::int64_t first,
                        FirstKeyOf(*connection_, kExposures, configuration));
  FOCALFLEET_TRY_ASSIGN(const std::int64_t next,
                        FirstKeyOf(*connection_, kExposures, configuration + 1));
  FOCALFLEET_TRY_ASSIGN(Statement statement, connection_->Prepare(kUnitInExposures));
  statement.Bind(1, first);
  statement.Bind(2, next);
  statement.Bind(3, unit.value);
  std::vector<UnitMeasured> all;
  for (;;) {
    const auto row = statement.Next();
    if (!row) return tl::unexpected<Error>(connection_->Named(row.error()));
    if (!*row) return all;
    Cells cells(statement, "measurement", 2);
    UnitMeasured measured;
    measured.exposure = cells.Whole<std::uint64_t>(1);
    measured.configuration = cells.Whole<std::uint64_t>(2);
    measured.status = cells.Code(3, kLastMeasurementStatus);
    if (!cells.IsNull(4)) measured.error_um = cells.Real(4);
    measured.at = cells.Time(5);
    all.push_back(measured);
    if (cells.error()) return tl::unexpected<Error>(connection_->Named(*cells.error()));
  }
}

Result<ReplayPage> StoreReader::Replay(std::uint64_t configuration, std::uint64_t after,
                                       std::uint32_t limit) {
  ReplayPage page;
  FOCALFLEET_TRY_ASSIGN(page.configuration, FindConfiguration(*connection_, configuration));
  if (!page.configuration) return page;
  auto first = static_cast<std::int64_t>(after) + 1;
  if (after == 0) {
    FOCALFLEET_TRY_ASSIGN(first, FirstKeyOf(*connection_, kMoves, configuration));
    FOCALFLEET_TRY(AddErrors(*connection_, configuration, &page));
  }
  FOCALFLEET_TRY(AddMoves(*connection_, configuration, first, limit, &page));
  return page;
}

}  // namespace focalfleet
