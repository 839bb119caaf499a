#include "daemon/observatory/desi.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <unordered_map>
#include <unordered_set>
#include <utility>

#include "fleet/files/cell.h"

namespace focalfleet::observatory {
namespace {

constexpr double kDesiGear = 337.36;
constexpr double kPhiEndDeg = 185;  // of the hard stop that phi is counted from
constexpr double kNominalArm_mm = 3;
constexpr double kNominalThetaRangeDeg = 390;
constexpr double kNominalPhiRangeDeg = 190;
constexpr AnglesDeg kParked{0, 150};

std::optional<std::uint32_t> WholeIfAny(CsvRow* row, const std::string& column) {
  if (column.empty()) return std::nullopt;
  const auto value = row->IntegerIfAny(column, {0, UINT32_MAX - 1});
  if (!value) return std::nullopt;
  return static_cast<std::uint32_t>(*value);
}

/// A petal's turn about the axis. Petal 3 of the ten has none.
double TurnOf(std::uint32_t petal) {
  constexpr double kPetal_deg = 36;
  constexpr std::uint32_t kPetals = 10;
  return kPetal_deg * ((petal + 7) % kPetals);
}

/// Where a table has its columns; both generations of files are read.
struct LayoutColumns {
  explicit LayoutColumns(const CsvTable& table)
      : name(FirstColumnOf(table, {"pos_id", "device_id"})),
        petal(FirstColumnOf(table, {"petal_loc", "petal"})),
        device(FirstColumnOf(table, {"device_loc", "device"})),
        is_global(table.Find("offset_x_cs5").has_value() || table.Find("min_t").has_value()),
        x(FirstColumnOf(table, {"offset_x_cs5", "offset_x"})),
        y(FirstColumnOf(table, {"offset_y_cs5", "offset_y"})) {}
  std::string name, petal, device;
  bool is_global;
  std::string x, y;
};

void TakeGeometry(const LayoutColumns& columns, std::uint32_t petal, bool may_be_nominal,
                  CsvRow* row, Unit* unit) {
  const double turn = TurnOf(petal);
  const auto or_nominal = [&](const char* column, const char* in, double nominal) {
    if (may_be_nominal) return row->NumberInIfAny(column, in).value_or(nominal);
    return row->NumberIn(column, in);
  };
  const double x = row->NumberIn(columns.x, "mm");
  const double y = row->NumberIn(columns.y, "mm");
  constexpr double kRad = std::numbers::pi / 180;
  const double c = columns.is_global ? 1 : std::cos(turn * kRad);
  const double s = columns.is_global ? 0 : std::sin(turn * kRad);
  unit->base_fp = {c * x - s * y, s * x + c * y};
  AxisGeometry& theta = unit->axis[0];
  AxisGeometry& phi = unit->axis[1];
  theta.arm_mm = or_nominal("length_r1", "mm", kNominalArm_mm);
  phi.arm_mm = or_nominal("length_r2", "mm", kNominalArm_mm);
  theta.zero_deg = or_nominal("offset_t", "deg", 0) + turn;
  phi.zero_deg = or_nominal("offset_p", "deg", 0);
  if (row->Has("min_t")) {
    theta.min_deg = row->NumberIn("min_t", "deg");
    theta.max_deg = row->NumberIn("max_t", "deg");
    phi.min_deg = row->NumberIn("min_p", "deg");
    phi.max_deg = row->NumberIn("max_p", "deg");
    return;
  }
  const double range_t = or_nominal("physical_range_t", "deg", kNominalThetaRangeDeg);
  theta.min_deg = -range_t / 2;
  theta.max_deg = range_t / 2;
  phi.min_deg = kPhiEndDeg - or_nominal("physical_range_p", "deg", kNominalPhiRangeDeg);
  phi.max_deg = kPhiEndDeg;
}

std::string ReasonOf(CsvRow* row) {
  std::string reason;
  const auto add = [&](const char* text) {
    reason += (reason.empty() ? "" : "; ") + std::string(text);
  };
  if (row->FlagIfAny("device_classified_nonfunctional").value_or(false))
    add("classified nonfunctional");
  if (!row->FlagIfAny("fiber_intact").value_or(true)) add("fibre broken");
  if (!row->FlagIfAny("ctrl_enabled").value_or(true)) add("control disabled");
  return reason;
}

/// Rows of one robot at several times: the newest counts. Shape: (rows); false: another one does.
std::vector<bool> Newest(const CsvTable& table, const std::string& name) {
  std::vector<bool> newest(table.size(), true);
  const std::string time = FirstColumnOf(table, {"time_recorded", "time"});
  const auto time_column = table.Find(time);
  const auto name_column = table.Find(name);
  if (!time_column || !name_column) return newest;
  std::unordered_map<std::string, std::pair<std::size_t, double>> best;
  for (std::size_t row = 0; row < table.size(); ++row) {
    const double time_s = SecondsOf(table.cell(row, *time_column));
    const auto [it, fresh] = best.try_emplace(table.cell(row, *name_column), row, time_s);
    if (fresh) continue;
    if (!(time_s != it->second.second)) continue;  // of one time: AddUnit refuses the second
    const bool later = std::isnan(it->second.second) || time_s > it->second.second;
    newest[later ? it->second.first : row] = false;
    if (later) it->second = {row, time_s};
  }
  return newest;
}

Status TakeDesiLayout(const NamedTable& source, const SourceFiles& files, Plate* plate) {
  const CsvTable& table = source.table;
  const LayoutColumns columns(table);
  FOCALFLEET_TRY(table.Require({"length_r1", "length_r2", "offset_t", "offset_p"}));
  if (columns.x.empty() || columns.y.empty() || columns.petal.empty() || columns.name.empty())
    FOCALFLEET_TRY(table.Require({"pos_id", "petal_loc", "device_loc", "offset_x", "offset_y"}));
  const std::vector<bool> newest = Newest(table, columns.name);
  return table.ReadRows([&](CsvRow& row) {
    if (!newest[row.at()]) return;
    const std::string type = row.Text("device_type");
    if (!type.empty() && type != "POS") return;  // fiducials and sky monitors
    PlateUnit unit;
    unit.name = row.Text(columns.name);
    const auto number = NumberInName(unit.name);
    if (!number) return row.Reject(columns.name, Quoted(unit.name) + " holds no number");
    unit.unit.id = UnitId{*number};
    const auto petal = WholeIfAny(&row, columns.petal);
    if (!petal) return row.Reject(columns.petal, "the petal's place is missing");
    const std::string reason = ReasonOf(&row);
    if (!reason.empty()) Disable(&unit, reason);
    TakeGeometry(columns, *petal, !reason.empty(), &row, &unit.unit);
    SetGears(files, kDesiGear, &unit.unit);
    unit.unit.rail = RailId{*petal};
    constexpr std::uint32_t kBusesOfAPetal = 100;
    if (const auto bus = NumberInName(row.Text("bus_id")); bus && *bus < kBusesOfAPetal)
      unit.unit.bus = BusId{*petal * kBusesOfAPetal + *bus};
    const auto device = WholeIfAny(&row, columns.device);
    constexpr std::uint32_t kPlacesOfAPetal = 1000;
    if (device) unit.ids["location"] = std::to_string(*petal * kPlacesOfAPetal + *device);
    unit.ids["petal_loc"] = std::to_string(*petal);
    if (device) unit.ids["device_loc"] = std::to_string(*device);
    if (row.Has("fiber")) unit.ids["fiber"] = row.Text("fiber");
    AddUnit(std::move(unit), &row, plate);
  });
}

/// The unit of a row: by the robot's name, else by its place.
PlateUnit* UnitOfRow(CsvRow* row, Plate* plate) {
  for (const char* column : {"pos_id", "device_id"})
    if (row->Has(column)) {
      const auto number = NumberInName(row->Text(column));
      return number ? plate->Find(UnitId{*number}) : nullptr;
    }
  return plate->FindBy("location", row->Text("location"));
}

// Bits of the column STATE of desimodel.
struct StateBit {
  std::int64_t bit;
  const char* reason;
};
constexpr StateBit kStateBits[] = {{2, "stuck"}, {4, "fibre broken"}};

Status TakeDesiState(const std::vector<NamedTable>& tables, Plate* plate) {
  for (const NamedTable& each : tables) {
    const CsvTable& table = each.table;
    FOCALFLEET_TRY(table.Require({"pos_t", "pos_p"}));
    const std::string key = FirstColumnOf(table, {"pos_id", "location"});
    if (key.empty()) FOCALFLEET_TRY(table.Require({"pos_id"}));
    const std::vector<bool> newest = Newest(table, key);
    std::unordered_set<std::uint32_t> taken;
    FOCALFLEET_TRY(table.ReadRows([&](CsvRow& row) {
      if (!newest[row.at()]) return;
      PlateUnit* unit = UnitOfRow(&row, plate);
      if (unit == nullptr)
        return LeaveOut(each, row.at(), row.Text(key), "state", "not in the layout", plate);
      if (!taken.insert(unit->unit.id.value).second)
        return row.RejectRow(unit->name + " is there twice, and no time tells which row counts",
                             "a robot twice");
      const std::int64_t bits = row.IntegerIfAny("state", {0, 1 << 20}).value_or(0);
      for (const StateBit& known : kStateBits)
        if ((bits & known.bit) != 0) Disable(unit, known.reason);
      if (const std::string reason = ReasonOf(&row); !reason.empty() && unit->unit.enabled)
        Disable(unit, reason);
      const auto theta = row.NumberInIfAny("pos_t", "deg");
      const auto phi = row.NumberInIfAny("pos_p", "deg");
      if (theta && phi) unit->stands = AnglesDeg{*theta, *phi};
    }));
  }
  return {};
}

Status TakeDesiTargets(const std::vector<NamedTable>& tables, Plate* plate) {
  FOCALFLEET_TRY_ASSIGN(const NamedTable* source,
                        Need(tables, {"fiberassign_x", "fiberassign_y"}, "targets"));
  const CsvTable& table = source->table;
  const bool by_location = table.Find("location").has_value();
  if (!by_location) FOCALFLEET_TRY(table.Require({"petal_loc", "device_loc"}));
  plate->targets = Targets{.source = table.file(), .rows = {}};
  std::unordered_map<std::uint32_t, std::size_t> row_of;
  return table.ReadRows([&](CsvRow& row) {
    const auto leave = [&](const std::string& unit, const char* reason) {
      LeaveOut(*source, row.at(), unit, "target", reason, plate);
    };
    const std::string location = by_location
                                     ? row.Text("location")
                                     : std::to_string(row.Integer("petal_loc", {0, 9}) * 1000 +
                                                      row.Integer("device_loc", {0, 999}));
    if (row.Has("device_type") && row.Text("device_type") != "POS")
      return leave(location, "no positioner");
    PlateUnit* unit = plate->FindBy("location", location);
    if (unit == nullptr) return leave(location, "no robot of the layout is at this location");
    if (row.Has("fiber")) unit->ids["fiber"] = row.Text("fiber");
    const auto x = row.NumberInIfAny("fiberassign_x", "mm");
    const auto y = row.NumberInIfAny("fiberassign_y", "mm");
    if (row.error()) return;
    const bool is_assigned = row.NumberIfAny("targetid").value_or(0) >= 0;
    if (is_assigned && row.Text("targetid").find_first_not_of("0123456789") != std::string::npos)
      return row.Reject("targetid", Quoted(row.Text("targetid")) +
                                        " is no whole number: was it written as a fraction?");
    if (!is_assigned) return leave(unit->name, "no target is assigned (TARGETID below 0)");
    if (!x || !y) return leave(unit->name, "it has no place");
    if (!row_of.emplace(unit->unit.id.value, row.at()).second)
      return row.RejectRow("location " + location + ": named twice", "named twice");
    TakeTarget({.unit = unit->unit.id,
                .place = PointFp{*x, *y},
                .target_id = row.Text("targetid"),
                .line = row.line()},
               *source, row.at(), unit, plate);
  });
}

// ---- moves

struct MoveRow {
  std::size_t at = 0;
  double time_s = 0;
  std::int64_t move = 0;
  AnglesDeg pos;
  std::optional<AnglesDeg> requested;
  std::optional<AnglesDeg> seen;
  double x_mm = 0;
  double y_mm = 0;
  std::map<std::string, double> more;
};

/// The two angles in a note such as `req_posintTP=(12.5, 150.0); ...`.
std::optional<AnglesDeg> RequestIn(std::string_view note) {
  constexpr std::string_view kKey = "req_posintTP=(";
  const std::size_t begin = note.find(kKey);
  if (begin == std::string_view::npos) return std::nullopt;
  note.remove_prefix(begin + kKey.size());
  const std::size_t comma = note.find(',');
  const std::size_t close = note.find(')');
  if (close == std::string_view::npos || comma > close) return std::nullopt;
  const auto theta = ParseNumber(Trimmed(note.substr(0, comma)));
  const auto phi = ParseNumber(Trimmed(note.substr(comma + 1, close - comma - 1)));
  if (!theta || !phi) return std::nullopt;
  return AnglesDeg{*theta, *phi};
}

MoveRow ReadMoveRow(CsvRow* row) {
  constexpr IntegerBounds kExposures{0, 9'000'000};
  constexpr IntegerBounds kIterations{0, 99};
  MoveRow move;
  move.at = row->at();
  move.move = row->Integer("exposure_id", kExposures) * 100 +
              row->IntegerIfAny("exposure_iter", kIterations).value_or(0);
  move.time_s = SecondsOf(row->Text("time_recorded"));
  move.pos = {row->NumberIn("pos_t", "deg"), row->NumberIn("pos_p", "deg")};
  move.requested = RequestIn(row->Text("log_note"));
  const auto fvc_t = row->NumberInIfAny("fvc_t", "deg");
  const auto fvc_p = row->NumberInIfAny("fvc_p", "deg");
  if (fvc_t && fvc_p) move.seen = AnglesDeg{*fvc_t, *fvc_p};
  move.x_mm = row->NumberInIfAny("obs_x", "mm").value_or(std::nan(""));
  move.y_mm = row->NumberInIfAny("obs_y", "mm").value_or(std::nan(""));
  const bool off = !row->FlagIfAny("ctrl_enabled").value_or(true);
  if (off || std::isnan(move.x_mm) || std::isnan(move.y_mm)) move.x_mm = move.y_mm = std::nan("");
  for (const char* column : {"flags", "submove", "elevation_deg", "temp_C"})
    if (const auto value = row->NumberIfAny(column)) move.more[column] = *value;
  return move;
}

void AddMovesOf(const PlateUnit& unit, std::vector<MoveRow> rows, bool from_camera,
                const NamedTable& source, Plate* plate) {
  // Where a single time is missing, times order nothing.
  const bool timed =
      std::ranges::none_of(rows, [](const MoveRow& row) { return std::isnan(row.time_s); });
  std::ranges::sort(
      rows, {}, [&](const MoveRow& row) { return std::pair(timed ? row.time_s : 0, row.move); });
  const MoveRow* before = nullptr;
  std::int64_t last = -1;
  for (const MoveRow& row : rows) {
    const auto leave = [&](const char* reason) {
      LeaveOut(source, row.at, unit.name, "move", reason, plate);
    };
    if (before == nullptr) {
      leave("the first row of its robot: where it began is not known");
    } else if (row.move == last) {
      leave("another row of this robot has the same exposure and iteration");
    } else {
      const bool seen = from_camera && before->seen.has_value();
      MeasuredMove move{.unit = unit.unit.id.value,
                        .move = row.move,
                        .from = seen ? *before->seen : before->pos,
                        .cmd = row.requested.value_or(row.pos),
                        .x_mm = row.x_mm,
                        .y_mm = row.y_mm,
                        .t_s = row.time_s,
                        .from_measured = seen,
                        .more = row.more};
      plate->moves.push_back(std::move(move));
    }
    last = row.move;
    before = &row;
  }
}

Status TakeMoves(const std::vector<NamedTable>& tables, bool from_camera, Plate* plate) {
  for (const NamedTable& each : tables) {
    const CsvTable& table = each.table;
    FOCALFLEET_TRY(table.Require({"pos_id", "exposure_id", "pos_t", "pos_p"}));
    if (!table.Find("obs_x") || !table.Find("obs_y"))
      FOCALFLEET_TRY(table.Require({"obs_x", "obs_y"}));
    std::map<std::uint32_t, std::vector<MoveRow>> rows_of;
    FOCALFLEET_TRY(table.ReadRows([&](CsvRow& row) {
      const MoveRow move = ReadMoveRow(&row);
      if (row.error()) return;
      const auto number = NumberInName(row.Text("pos_id"));
      if (!number) return row.Reject("pos_id", Quoted(row.Text("pos_id")) + " holds no number");
      rows_of[*number].push_back(move);
    }));
    for (auto& [number, rows] : rows_of) {
      const PlateUnit* unit = plate->Find(UnitId{number});
      if (unit == nullptr) {
        LeaveOut(each, rows.front().at, std::to_string(number), "move",
                 "not in the layout: " + std::to_string(rows.size()) + " rows", plate);
        continue;
      }
      AddMovesOf(*unit, std::move(rows), from_camera, each, plate);
    }
  }
  double first_s = std::numeric_limits<double>::infinity();
  for (const MeasuredMove& move : plate->moves)
    if (!std::isnan(move.t_s)) first_s = std::min(first_s, move.t_s);
  for (MeasuredMove& move : plate->moves) move.t_s -= std::isfinite(first_s) ? first_s : 0;
  return {};
}

}  // namespace

Result<Plate> ReadDesi(const SourceFiles& files) {
  Plate plate;
  plate.parked = kParked;
  FOCALFLEET_TRY_ASSIGN(const auto layout, ReadAll(files.layout));
  for (const NamedTable& each : layout) FOCALFLEET_TRY(TakeDesiLayout(each, files, &plate));
  FOCALFLEET_TRY_ASSIGN(const auto disabled, ReadAll(files.disabled));
  FOCALFLEET_TRY(TakeDisabled(disabled, "pos_id", &plate));
  FOCALFLEET_TRY_ASSIGN(const auto state, ReadAll(files.state));
  FOCALFLEET_TRY(TakeDesiState(state, &plate));
  DisableOutsiders(&plate);
  FOCALFLEET_TRY(TakeFiducials(files, &plate));
  FOCALFLEET_TRY_ASSIGN(const auto targets, ReadAll(files.targets));
  if (!targets.empty()) FOCALFLEET_TRY(TakeDesiTargets(targets, &plate));
  FOCALFLEET_TRY_ASSIGN(const auto moves, ReadAll(files.moves));
  if (!moves.empty()) FOCALFLEET_TRY(TakeMoves(moves, files.from_camera, &plate));
  NotePassedOver({&layout, &disabled, &state, &targets, &moves}, &plate);
  return plate;
}

}  // namespace focalfleet::observatory
