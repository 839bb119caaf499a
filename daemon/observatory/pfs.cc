#include "daemon/observatory/pfs.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_map>
#include <utility>

#include "fleet/files/cell.h"

namespace focalfleet::observatory {
namespace {

constexpr std::int64_t kCobrasOfAModule = 57;
constexpr double kLongestArm_mm = 10;  // an arm is 2.4 mm; longer ones are in pixels
constexpr AnglesDeg kHome{0, 0};

// Bits of Status; bit 0 alone: in order.
struct StatusBit {
  std::int64_t bit;
  const char* reason;
};
constexpr StatusBit kStatusBits[] = {
    {2, "fibre not visible"}, {4, "theta motor broken"}, {8, "phi motor broken"}};
constexpr std::int64_t kInOrder = 1;

std::string ReasonOf(std::int64_t status) {
  std::string reason;
  for (const StatusBit& known : kStatusBits)
    if ((status & known.bit) != 0)
      reason += (reason.empty() ? "" : "; ") + std::string(known.reason);
  if (reason.empty() && (status & kInOrder) == 0)
    reason = "Status " + std::to_string(status) + " is not in order";
  return reason;
}

/// Millimetres for a unit of the file. 1: the file is in mm.
double ScaleOf(const NamedTable& source, CsvRow* row) {
  const double link = row->Number("Link1_Link_Length");
  if (row->error() || link <= kLongestArm_mm) return 1;
  const auto pixel_um = row->NumberIfAny("Pixel_scale");
  if (!pixel_um || *pixel_um <= 0 || link * *pixel_um * 1e-3 > kLongestArm_mm) {
    row->Reject("Link1_Link_Length", row->Text("Link1_Link_Length") +
                                         " is no length in mm, and no Pixel_scale (um) in " +
                                         source.table.file() + " makes it one");
    return 1;
  }
  return *pixel_um * 1e-3;
}

void TakeRanges(CsvRow* row, Unit* unit) {
  constexpr double kTurn = 360;
  AxisGeometry& theta = unit->axis[0];
  AxisGeometry& phi = unit->axis[1];
  theta.min_deg = 0;
  phi.min_deg = 0;
  phi.max_deg = row->Number("Joint2_CW_limit_angle") - row->Number("Joint2_CCW_limit_angle");
  const auto ccw = row->NumberIfAny("Joint1_CCW_limit_angle");
  const auto cw = row->NumberIfAny("Joint1_CW_limit_angle");
  if (ccw && cw && *cw > *ccw) {
    theta.max_deg = *cw - *ccw;
    return;
  }
  // The two stops overlap: the axis turns by one turn and the way from the one to the other.
  const double way =
      row->NumberIfAny("CW_Global_base_ori_z").value_or(theta.zero_deg) - theta.zero_deg;
  theta.max_deg = kTurn / 2 + way + kTurn / 2 - kTurn * std::floor((way + kTurn / 2) / kTurn);
}

Status TakePfsLayout(const NamedTable& source, const SourceFiles& files, Plate* plate) {
  FOCALFLEET_TRY(
      source.table.Require({"Module_Id", "Positioner_Id", "Global_base_pos_x", "Global_base_pos_y",
                            "Link1_Link_Length", "Link2_Link_Length", "CCW_Global_base_ori_z",
                            "Joint2_CCW_limit_angle", "Joint2_CW_limit_angle"}));
  return source.table.ReadRows([&](CsvRow& row) {
    const std::int64_t module = row.Integer("Module_Id", {1, 1000});
    const std::int64_t place = row.Integer("Positioner_Id", {1, kCobrasOfAModule});
    PlateUnit unit;
    unit.unit.id = UnitId{static_cast<std::uint32_t>((module - 1) * kCobrasOfAModule + place)};
    unit.name = "SC" + std::to_string(module) + " PID" + std::to_string(place);
    const double scale = ScaleOf(source, &row);
    const double stop = row.Number("Joint2_CCW_limit_angle");
    unit.unit.base_fp = {row.Number("Global_base_pos_x") * scale,
                         row.Number("Global_base_pos_y") * scale};
    unit.unit.axis[0].arm_mm = row.Number("Link1_Link_Length") * scale;
    unit.unit.axis[1].arm_mm = row.Number("Link2_Link_Length") * scale;
    unit.unit.axis[0].zero_deg = row.Number("CCW_Global_base_ori_z");
    unit.unit.axis[1].zero_deg = stop - 180;
    TakeRanges(&row, &unit.unit);
    SetGears(files, kHexLayoutGear, &unit.unit);
    unit.unit.rail = RailId{static_cast<std::uint32_t>(module)};
    unit.unit.bus = BusId{static_cast<std::uint32_t>(module)};
    unit.ids["cobraId"] = std::to_string(unit.unit.id.value);
    if (row.Has("Serial_Number")) unit.ids["Serial_Number"] = row.Text("Serial_Number");
    const auto status = row.IntegerIfAny("Status", {0, 1 << 20});
    if (status)
      if (const std::string reason = ReasonOf(*status); !reason.empty()) Disable(&unit, reason);
    AddUnit(std::move(unit), &row, plate);
  });
}

Status TakeFibreMap(const std::vector<NamedTable>& tables, Plate* plate) {
  for (const NamedTable& each : tables) {
    FOCALFLEET_TRY(each.table.Require({"cobraId", "fiberId"}));
    FOCALFLEET_TRY(each.table.ReadRows([&](CsvRow& row) {
      const auto cobra = row.IntegerIfAny("cobraId", {0, UINT32_MAX - 1});
      const std::int64_t fibre = row.Integer("fiberId", {0, 1 << 20});
      if (row.error() || !cobra) return;
      PlateUnit* unit = plate->Find(UnitId{static_cast<std::uint32_t>(*cobra)});
      if (unit == nullptr)
        return;  // fibres of the engineers, and modules that are not in the layout
      const std::string text = std::to_string(fibre);
      unit->ids["fiberId"] = text;
      if (!plate->index
               .emplace("fiberId=" + text, plate->index.at("unit_id=" + std::to_string(*cobra)))
               .second)
        row.Reject("fiberId", text + " is there twice");
    }));
  }
  return {};
}

/// An angle of a motor: radians, unless the table declares another unit.
std::optional<double> MotorAngle_deg(CsvRow* row, const CsvTable& table, const std::string& name) {
  const auto column = table.Find(name);
  if (column && !table.declared_unit(*column).empty()) return row->NumberInIfAny(name, "deg");
  const auto angle_rad = row->NumberIfAny(name);
  return angle_rad ? std::optional(*angle_rad * kDegPerRad) : std::nullopt;
}

/// The latest row of a cobra by visit and iteration counts.
Status TakePfsState(const std::vector<NamedTable>& tables, Plate* plate) {
  using Order = std::pair<std::int64_t, std::int64_t>;
  std::unordered_map<std::uint32_t, std::optional<Order>> taken;
  for (const NamedTable& each : tables) {
    FOCALFLEET_TRY(each.table.Require({"cobra_id", "motor_target_theta", "motor_target_phi"}));
    const bool has_order =
        each.table.Find("pfs_visit_id").has_value() && each.table.Find("iteration").has_value();
    FOCALFLEET_TRY(each.table.ReadRows([&](CsvRow& row) {
      const auto cobra = static_cast<std::uint32_t>(row.Integer("cobra_id", {0, UINT32_MAX - 1}));
      PlateUnit* unit = plate->Find(UnitId{cobra});
      if (unit == nullptr)
        return LeaveOut(each, row.at(), row.Text("cobra_id"), "state", "not in the layout", plate);
      const auto theta = MotorAngle_deg(&row, each.table, "motor_target_theta");
      const auto phi = MotorAngle_deg(&row, each.table, "motor_target_phi");
      std::optional<Order> order;
      if (has_order)
        order = Order{row.Integer("pfs_visit_id", {0, INT64_MAX}),
                      row.Integer("iteration", {0, INT64_MAX})};
      if (row.error() || !theta || !phi) return;
      const auto [before, fresh] = taken.try_emplace(cobra, order);
      if (!fresh && (!order || !before->second || *order == *before->second))
        return row.RejectRow("cobra " + row.Text("cobra_id") +
                                 " is there twice, and no visit and iteration tell which counts",
                             "a cobra twice");
      if (!fresh && *order < *before->second) return;
      before->second = order;
      unit->stands = AnglesDeg{*theta, *phi};
    }));
  }
  return {};
}

Status TakePfsTargets(const std::vector<NamedTable>& tables, Plate* plate) {
  FOCALFLEET_TRY_ASSIGN(const NamedTable* source,
                        Need(tables, {"fiberId", "pfiNominal_0", "pfiNominal_1"}, "targets"));
  const CsvTable& table = source->table;
  const bool by_cobra = table.Find("cobraId").has_value();
  const bool mapped = std::ranges::any_of(
      plate->units, [](const PlateUnit& unit) { return unit.ids.contains("fiberId"); });
  if (!by_cobra && !mapped)
    return Fail(ErrorCode::kInvalid, table.file() +
                                         ": fibres are named by fiberId, so a table of "
                                         "cobraId and fiberId is needed (--fibre-map)");
  plate->targets = Targets{.source = table.file(), .rows = {}};
  std::unordered_map<std::uint32_t, std::size_t> row_of;
  return table.ReadRows([&](CsvRow& row) {
    const std::string fibre = row.Text("fiberId");
    PlateUnit* unit =
        by_cobra ? plate->FindBy("cobraId", row.Text("cobraId")) : plate->FindBy("fiberId", fibre);
    const auto leave = [&](const char* reason) {
      LeaveOut(*source, row.at(), "fibre " + fibre, "target", reason, plate);
    };
    if (unit == nullptr) return leave("no cobra of the layout has this fibre");
    const auto x = row.NumberInIfAny("pfiNominal_0", "mm");
    const auto y = row.NumberInIfAny("pfiNominal_1", "mm");
    constexpr std::int64_t kGood = 1;
    const auto status = row.IntegerIfAny("fiberStatus", {0, 1000});
    if (row.error()) return;
    if (!x || !y) return leave("it has no place");
    if (status && *status != kGood) return leave("its fibreStatus is not good");
    if (!row_of.emplace(unit->unit.id.value, row.at()).second)
      return row.RejectRow("fibre " + fibre + ": its cobra is named twice", "named twice");
    const std::string object = row.Text("objId");
    TakeTarget({.unit = unit->unit.id,
                .place = PointFp{*x, *y},
                .target_id = object == "-1" ? "" : object,
                .line = row.line()},
               *source, row.at(), unit, plate);
  });
}

// ---- moves

using Key = std::tuple<std::int64_t, std::int64_t, std::int64_t>;  // visit, iteration, cobra

Key KeyOf(CsvRow* row) {
  return {row->Integer("pfs_visit_id", {0, 9'000'000}), row->Integer("iteration", {0, 99}),
          row->Integer("cobra_id", {0, UINT32_MAX - 1})};
}

struct Match {
  PointFp at;
  std::string frame;
};

Result<std::map<Key, Match>> ReadMatches(const NamedTable& source) {
  std::map<Key, Match> matches;
  FOCALFLEET_TRY(source.table.ReadRows([&](CsvRow& row) {
    const Key key = KeyOf(&row);
    const auto x = row.NumberIfAny("pfi_center_x_mm");
    const auto y = row.NumberIfAny("pfi_center_y_mm");
    const auto spot = row.NumberIfAny("spot_id");
    if (row.error()) return;
    const bool seen = x && y && (!spot || *spot >= 0);
    const PointFp nowhere{std::nan(""), std::nan("")};
    matches[key] = {seen ? PointFp{*x, *y} : nowhere, row.Text("mcs_frame_id")};
  }));
  return matches;
}

struct Exposure {
  double t_s = std::nan("");
  std::map<std::string, double> more;
};

Result<std::unordered_map<std::string, Exposure>> ReadExposures(const NamedTable* source) {
  std::unordered_map<std::string, Exposure> exposures;
  if (source == nullptr) return exposures;
  FOCALFLEET_TRY(source->table.ReadRows([&](CsvRow& row) {
    Exposure exposure;
    exposure.t_s = SecondsOf(row.Text("taken_at"));
    constexpr std::pair<const char*, const char*> kMore[] = {
        {"altitude", "elevation_deg"}, {"insrot", "insrot_deg"}, {"mcs_m1_temperature", "temp_C"}};
    for (const auto& [column, ours] : kMore)
      if (const auto value = row.NumberIfAny(column)) exposure.more[ours] = *value;
    exposures[row.Text("mcs_frame_id")] = std::move(exposure);
  }));
  return exposures;
}

struct Sent {
  std::size_t at = 0;
  AnglesDeg cmd;
};

Status TakeMoves(const std::vector<NamedTable>& tables, Plate* plate) {
  FOCALFLEET_TRY_ASSIGN(const NamedTable* sent, Need(tables,
                                                     {"pfs_visit_id", "iteration", "cobra_id",
                                                      "motor_target_theta", "motor_target_phi"},
                                                     "moves"));
  FOCALFLEET_TRY_ASSIGN(
      const NamedTable* seen,
      Need(tables, {"pfs_visit_id", "iteration", "cobra_id", "pfi_center_x_mm", "pfi_center_y_mm"},
           "measured places"));
  FOCALFLEET_TRY_ASSIGN(const auto matches, ReadMatches(*seen));
  FOCALFLEET_TRY_ASSIGN(const auto exposures,
                        ReadExposures(WithColumns(tables, {"mcs_frame_id", "taken_at"})));
  std::map<Key, Sent> moves;
  FOCALFLEET_TRY(sent->table.ReadRows([&](CsvRow& row) {
    const Key key = KeyOf(&row);
    const auto theta = MotorAngle_deg(&row, sent->table, "motor_target_theta");
    const auto phi = MotorAngle_deg(&row, sent->table, "motor_target_phi");
    if (row.error()) return;
    if (!theta || !phi)
      return LeaveOut(*sent, row.at(), row.Text("cobra_id"), "move", "no angles", plate);
    if (!moves.emplace(key, Sent{row.at(), {*theta, *phi}}).second)
      row.RejectRow("cobra " + row.Text("cobra_id") + " has this visit and iteration twice",
                    "a move twice");
  }));
  std::unordered_map<std::int64_t, AnglesDeg> last;
  for (const auto& [key, move] : moves) {
    const auto& [visit, iteration, cobra] = key;
    const auto leave = [&](const char* reason) {
      LeaveOut(*sent, move.at, std::to_string(cobra), "move", reason, plate);
    };
    const auto [before, first] = last.try_emplace(cobra, move.cmd);
    const AnglesDeg from = before->second;
    before->second = move.cmd;
    if (plate->Find(UnitId{static_cast<std::uint32_t>(cobra)}) == nullptr) {
      leave("not in the layout");
      continue;
    }
    if (first) {
      leave("the first row of its cobra: where it began is not known");
      continue;
    }
    MeasuredMove made{.unit = static_cast<std::uint32_t>(cobra),
                      .move = visit * 100 + iteration,
                      .from = from,
                      .cmd = move.cmd,
                      .x_mm = std::nan(""),
                      .y_mm = std::nan(""),
                      .t_s = std::nan("")};
    if (const auto match = matches.find(key); match != matches.end()) {
      made.x_mm = match->second.at.x_mm;
      made.y_mm = match->second.at.y_mm;
      if (const auto exposure = exposures.find(match->second.frame); exposure != exposures.end()) {
        made.t_s = exposure->second.t_s;
        made.more = exposure->second.more;
      }
    }
    plate->moves.push_back(std::move(made));
  }
  double first_s = std::numeric_limits<double>::infinity();
  for (const MeasuredMove& move : plate->moves)
    if (!std::isnan(move.t_s)) first_s = std::min(first_s, move.t_s);
  if (std::isfinite(first_s))
    for (MeasuredMove& move : plate->moves) move.t_s -= first_s;
  return {};
}

}  // namespace

Result<Plate> ReadPfs(const SourceFiles& files) {
  Plate plate;
  plate.parked = kHome;
  FOCALFLEET_TRY_ASSIGN(const auto layout, ReadAll(files.layout));
  for (const NamedTable& each : layout) FOCALFLEET_TRY(TakePfsLayout(each, files, &plate));
  FOCALFLEET_TRY_ASSIGN(const auto disabled, ReadAll(files.disabled));
  FOCALFLEET_TRY(TakeDisabled(disabled, "cobraId", &plate));
  FOCALFLEET_TRY_ASSIGN(const auto fibres, ReadAll(files.fibre_map));
  FOCALFLEET_TRY(TakeFibreMap(fibres, &plate));
  FOCALFLEET_TRY_ASSIGN(const auto state, ReadAll(files.state));
  FOCALFLEET_TRY(TakePfsState(state, &plate));
  DisableOutsiders(&plate);
  FOCALFLEET_TRY(TakeFiducials(files, &plate));
  FOCALFLEET_TRY_ASSIGN(const auto targets, ReadAll(files.targets));
  if (!targets.empty()) FOCALFLEET_TRY(TakePfsTargets(targets, &plate));
  FOCALFLEET_TRY_ASSIGN(const auto moves, ReadAll(files.moves));
  if (!moves.empty()) FOCALFLEET_TRY(TakeMoves(moves, &plate));
  NotePassedOver({&layout, &disabled, &fibres, &state, &targets, &moves}, &plate);
  return plate;
}

}  // namespace focalfleet::observatory
