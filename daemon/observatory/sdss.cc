#include "daemon/observatory/sdss.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_map>
#include <utility>

#include "fleet/files/cell.h"

namespace focalfleet::observatory {
namespace {

constexpr double kAlphaEndDeg = 360;
constexpr double kBetaEndDeg = 180;
constexpr double kNoValue = -999;
constexpr AnglesDeg kFolded{0, 180};
constexpr const char* kOffsets[] = {"metX", "metY", "bossX", "bossY", "apX", "apY"};

struct Hole {
  PointFp at;
  double direction_deg = 0;
};
using Holes = std::unordered_map<std::string, Hole>;

Result<Holes> ReadHoles(const NamedTable& source) {
  Holes holes;
  FOCALFLEET_TRY(source.table.ReadRows([&](CsvRow& row) {
    const std::string id = row.Text("holeID");
    const double ix = row.Number("ix");
    const double iy = row.Number("iy");
    const Hole hole{{row.NumberIn("xWok", "mm"), row.NumberIn("yWok", "mm")},
                    std::atan2(iy, ix) * kDegPerRad};
    const double turned =
        ix * row.NumberIfAny("jy").value_or(ix) - iy * row.NumberIfAny("jx").value_or(-iy);
    if (row.error()) return;
    if (turned <= 0)
      return row.RejectRow("hole " + id + ": its axes i, j are mirrored", "mirrored");
    if (!holes.emplace(id, hole).second)
      return row.RejectRow("hole " + id + ": is there twice", "is there twice");
  }));
  return holes;
}

Status TakeSdssLayout(const NamedTable& source, const Holes& holes, const SourceFiles& files,
                      Plate* plate) {
  return source.table.ReadRows([&](CsvRow& row) {
    PlateUnit unit;
    unit.name = row.Text("positionerID");
    unit.unit.id =
        UnitId{static_cast<std::uint32_t>(row.Integer("positionerID", {0, UINT32_MAX - 1}))};
    const auto hole = holes.find(row.Text("holeID"));
    if (hole == holes.end())
      return row.Reject("holeID", Quoted(row.Text("holeID")) + " is no hole of the table of holes");
    const double met_x = row.NumberIn("metX", "mm");
    const double met_y = row.NumberIn("metY", "mm");
    unit.unit.base_fp = {hole->second.at.x_mm + row.NumberInIfAny("dx", "mm").value_or(0),
                         hole->second.at.y_mm + row.NumberInIfAny("dy", "mm").value_or(0)};
    unit.unit.axis[0] = {
        .arm_mm = row.NumberIn("alphaArmLen", "mm"),
        .zero_deg = row.NumberIn("alphaOffset", "deg") + hole->second.direction_deg,
        .min_deg = 0,
        .max_deg = kAlphaEndDeg};
    unit.unit.axis[1] = {
        .arm_mm = std::hypot(met_x, met_y),
        .zero_deg = row.NumberIn("betaOffset", "deg") + std::atan2(met_y, met_x) * kDegPerRad,
        .min_deg = 0,
        .max_deg = kBetaEndDeg};
    SetGears(files, kHexLayoutGear, &unit.unit);
    unit.ids["holeID"] = row.Text("holeID");
    for (const char* column : kOffsets)
      if (row.Has(column)) unit.ids[column] = row.Text(column);
    if (row.FlagIfAny("disabled").value_or(false)) Disable(&unit, "disabled");
    if (row.FlagIfAny("offline").value_or(false)) Disable(&unit, "offline");
    AddUnit(std::move(unit), &row, plate);
  });
}

bool IsGiven(std::optional<double> value) { return value && *value > kNoValue + 1; }

/// The unit of a row; null: it was left out.
PlateUnit* UnitOfRow(const NamedTable& source, CsvRow* row, const std::string& column,
                     const char* what, Plate* plate) {
  const auto number = row->IntegerIfAny(column, {0, UINT32_MAX - 1});
  PlateUnit* unit = number ? plate->Find(UnitId{static_cast<std::uint32_t>(*number)}) : nullptr;
  if (unit == nullptr && !row->error())
    LeaveOut(source, row->at(), row->Text(column), what, "not in the layout", plate);
  return unit;
}

Status TakeSdssState(const std::vector<NamedTable>& tables, Plate* plate) {
  if (tables.empty()) return {};
  const NamedTable* source = WithColumns(tables, {"positionerID", "alphaReport", "betaReport"});
  const bool reported = source != nullptr;
  if (!reported) {
    FOCALFLEET_TRY_ASSIGN(source, Need(tables, {"positionerId", "alpha", "beta"}, "the state"));
  }
  const char* key = reported ? "positionerID" : "positionerId";
  return source->table.ReadRows([&](CsvRow& row) {
    PlateUnit* unit = UnitOfRow(*source, &row, key, "state", plate);
    if (unit == nullptr || unit->stands) return;
    const auto alpha = row.NumberInIfAny(reported ? "alphaReport" : "alpha", "deg");
    const auto beta = row.NumberInIfAny(reported ? "betaReport" : "beta", "deg");
    if (!IsGiven(alpha) || !IsGiven(beta))
      return LeaveOut(*source, row.at(), unit->name, "state", "no angles (-999 or missing)", plate);
    unit->stands = AnglesDeg{*alpha, *beta};
  });
}

// A confSummary has a row for each of a robot's three fibres. Its angles are in all of them, the
// target is in the one that is assigned.
struct RowsOfRobot {
  std::size_t first = 0;
  std::optional<std::size_t> assigned;
};

Status TakeSdssTargets(const std::vector<NamedTable>& tables, Plate* plate) {
  FOCALFLEET_TRY_ASSIGN(const NamedTable* source,
                        Need(tables, {"positionerId", "alpha", "beta"}, "targets"));
  const CsvTable& table = source->table;
  plate->targets = Targets{.source = table.file(), .rows = {}};
  std::map<std::uint32_t, RowsOfRobot> robots;
  FOCALFLEET_TRY(table.ReadRows([&](CsvRow& row) {
    const auto id = static_cast<std::uint32_t>(row.Integer("positionerId", {0, UINT32_MAX - 1}));
    const bool assigned = row.FlagIfAny("assigned").value_or(false);
    if (row.error()) return;
    RowsOfRobot& rows =
        robots.try_emplace(id, RowsOfRobot{.first = row.at(), .assigned = {}}).first->second;
    if (assigned && !rows.assigned) rows.assigned = row.at();
  }));
  for (const auto& [id, rows] : robots) {
    CsvRow row(table, rows.assigned.value_or(rows.first));
    PlateUnit* unit = plate->Find(UnitId{id});
    const auto leave = [&](const char* reason) {
      LeaveOut(*source, row.at(), std::to_string(id), "target", reason, plate);
    };
    if (unit == nullptr) {
      leave("not in the layout");
      continue;
    }
    const auto alpha = row.NumberInIfAny("alpha", "deg");
    const auto beta = row.NumberInIfAny("beta", "deg");
    if (row.error()) return tl::unexpected<Error>(*row.error());
    if (!IsGiven(alpha) || !IsGiven(beta)) {
      leave("no angles (-999 or missing)");
      continue;
    }
    if (rows.assigned && row.Has("fiberType")) unit->ids["fiberType"] = row.Text("fiberType");
    const std::string catalogue = rows.assigned ? row.Text("catalogid") : "";
    TakeTarget({.unit = unit->unit.id,
                .place = TargetAngles{*alpha, *beta},
                .target_id = catalogue == "-999" ? "" : catalogue,
                .line = row.line()},
               *source, row.at(), unit, plate);
  }
  return {};
}

/// Places by robot as the camera found them.
using Places = std::unordered_map<std::uint32_t, PointFp>;

Result<Places> ReadPlaces(const NamedTable& source) {
  Places places;
  FOCALFLEET_TRY(source.table.ReadRows([&](CsvRow& row) {
    const auto id = static_cast<std::uint32_t>(row.Integer("positionerID", {0, UINT32_MAX - 1}));
    const auto x = row.NumberInIfAny("xWokMeasMetrology", "mm");
    const auto y = row.NumberInIfAny("yWokMeasMetrology", "mm");
    const bool doubted = row.FlagIfAny("wokErrWarn").value_or(false);
    if (!row.error() && !doubted && IsGiven(x) && IsGiven(y)) places[id] = {*x, *y};
  }));
  return places;
}

double TimeOf(const NamedTable& table) {
  for (const char* key : {"DATE-OBS", "DATE", "FVCTIME"})
    if (const std::string text = table.Key(key); !text.empty())
      if (const double time_s = SecondsOf(text); !std::isnan(time_s)) return time_s;
  return std::nan("");
}

Status TakeExposure(const std::vector<NamedTable>& tables, std::int64_t number, Plate* plate) {
  FOCALFLEET_TRY_ASSIGN(
      const NamedTable* angles,
      Need(tables, {"positionerID", "startAlpha", "startBeta", "cmdAlpha", "cmdBeta"}, "moves"));
  FOCALFLEET_TRY_ASSIGN(
      const NamedTable* measured,
      Need(tables, {"positionerID", "xWokMeasMetrology", "yWokMeasMetrology"}, "measured places"));
  FOCALFLEET_TRY_ASSIGN(const Places places, ReadPlaces(*measured));
  const double time_s = TimeOf(*angles);
  return angles->table.ReadRows([&](CsvRow& row) {
    const PlateUnit* unit = UnitOfRow(*angles, &row, "positionerID", "move", plate);
    if (unit == nullptr) return;
    MeasuredMove move{.unit = unit->unit.id.value, .move = number, .t_s = time_s};
    const auto given = [&](const char* column) { return row.NumberInIfAny(column, "deg"); };
    const auto from_alpha = given("startAlpha");
    const auto from_beta = given("startBeta");
    const auto alpha = given("cmdAlpha");
    const auto beta = given("cmdBeta");
    if (!IsGiven(from_alpha) || !IsGiven(from_beta) || !IsGiven(alpha) || !IsGiven(beta))
      return LeaveOut(*angles, row.at(), unit->name, "move", "no angles (-999 or missing)", plate);
    move.from = {*from_alpha, *from_beta};
    move.cmd = {*alpha, *beta};
    const auto place = places.find(unit->unit.id.value);
    const bool seen = place != places.end();
    move.x_mm = seen ? place->second.x_mm : std::nan("");
    move.y_mm = seen ? place->second.y_mm : std::nan("");
    if (const auto report = given("alphaReport")) move.more["alpha_report_deg"] = *report;
    if (const auto report = given("betaReport")) move.more["beta_report_deg"] = *report;
    if (const auto temperature = ParseNumber(angles->Key("TEMP")); temperature)
      move.more["temp_C"] = *temperature;
    plate->moves.push_back(std::move(move));
  });
}

Status TakeMoves(const std::vector<std::string>& files, Plate* plate) {
  std::vector<std::vector<NamedTable>> exposures;
  for (const std::string& file : files) {
    FOCALFLEET_TRY_ASSIGN(std::vector<NamedTable> tables, ReadTables(file));
    exposures.push_back(std::move(tables));
  }
  // In the order of their time where all have one, else as they were named.
  const auto time_of = [](const std::vector<NamedTable>& tables) { return TimeOf(tables.front()); };
  const bool timed = std::ranges::none_of(
      exposures, [&](const auto& tables) { return std::isnan(time_of(tables)); });
  if (timed)
    std::ranges::stable_sort(exposures,
                             [&](const auto& a, const auto& b) { return time_of(a) < time_of(b); });
  std::int64_t number = 0;
  for (const auto& tables : exposures) FOCALFLEET_TRY(TakeExposure(tables, ++number, plate));
  std::vector<NamedTable> all;
  for (auto& tables : exposures) std::ranges::move(tables, std::back_inserter(all));
  NotePassedOver({&all}, plate);
  double first_s = std::numeric_limits<double>::infinity();
  for (const MeasuredMove& move : plate->moves) first_s = std::min(first_s, move.t_s);
  if (std::isfinite(first_s))
    for (MeasuredMove& move : plate->moves) move.t_s -= first_s;
  return {};
}

}  // namespace

Result<Plate> ReadSdss(const SourceFiles& files) {
  Plate plate;
  plate.parked = kFolded;
  FOCALFLEET_TRY_ASSIGN(const auto layout, ReadAll(files.layout));
  FOCALFLEET_TRY_ASSIGN(
      const NamedTable* robots,
      Need(layout,
           {"positionerID", "holeID", "alphaArmLen", "metX", "metY", "alphaOffset", "betaOffset"},
           "the robots"));
  FOCALFLEET_TRY_ASSIGN(const NamedTable* wok,
                        Need(layout, {"holeID", "xWok", "yWok", "ix", "iy"}, "the holes"));
  FOCALFLEET_TRY_ASSIGN(const Holes holes, ReadHoles(*wok));
  FOCALFLEET_TRY(TakeSdssLayout(*robots, holes, files, &plate));
  FOCALFLEET_TRY_ASSIGN(const auto disabled, ReadAll(files.disabled));
  FOCALFLEET_TRY(TakeDisabled(disabled, "positionerID", &plate));
  FOCALFLEET_TRY_ASSIGN(const auto state, ReadAll(files.state));
  FOCALFLEET_TRY(TakeSdssState(state, &plate));
  DisableOutsiders(&plate);
  FOCALFLEET_TRY(TakeFiducials(files, &plate));
  FOCALFLEET_TRY_ASSIGN(const auto targets, ReadAll(files.targets));
  if (!targets.empty()) FOCALFLEET_TRY(TakeSdssTargets(targets, &plate));
  FOCALFLEET_TRY(TakeMoves(files.moves, &plate));
  NotePassedOver({&layout, &disabled, &state, &targets}, &plate);
  return plate;
}

}  // namespace focalfleet::observatory
