#include "daemon/observatory/export.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <filesystem>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "daemon/files/fits_table.h"
#include "daemon/files/text_file.h"
#include "daemon/observatory/moons.h"
#include "daemon/observatory/plate.h"
#include "daemon/tables/read_table.h"
#include "fleet/files/layout_file.h"
#include "fleet/files/targets_file.h"

namespace focalfleet::observatory {
namespace {

struct ExportRow {
  Unit unit;
  std::string name;
  std::map<std::string, std::string> ids;
  std::optional<AnglesDeg> pose;
  std::optional<PointFp> target;
  std::string target_id;
  double priority = 0;
  std::optional<PointFp> measured;

  [[nodiscard]] std::string Id(const std::string& column) const {
    const auto found = ids.find(column);
    return found == ids.end() ? std::string() : found->second;
  }
  /// Where the fibre is meant to be: its target, else where its axes stand.
  [[nodiscard]] std::optional<PointFp> Meant() const {
    if (target) return target;
    if (pose) return FibreOf(unit, *pose);
    return std::nullopt;
  }
};

/// Rows by unit id; an ordered map, so that files come out the same.
using Rows = std::map<std::uint32_t, ExportRow>;

Result<CsvTable> TableIn(const std::string& path) {
  FOCALFLEET_TRY_ASSIGN(const std::string text, ReadTableAsText(path, "unit_id"));
  return CsvTable::Parse(text, path);
}

ExportRow* RowOf(Rows* rows, CsvRow* row) {
  const auto id = static_cast<std::uint32_t>(row->Integer("unit_id", {0, UINT32_MAX - 1}));
  if (row->error()) return nullptr;
  const auto found = rows->find(id);
  if (found != rows->end()) return &found->second;
  row->Reject("unit_id", std::to_string(id) + " is no unit of the import");
  return nullptr;
}

Result<Rows> ReadUnitsOf(const std::string& folder, const std::string& project) {
  const std::string units_file = std::filesystem::path(folder) / "units.csv";
  const std::string origin_file = std::filesystem::path(folder) / "origin.csv";
  FOCALFLEET_TRY_ASSIGN(const std::string text, ReadTableAsText(units_file, "unit_id"));
  FOCALFLEET_TRY_ASSIGN(const UnitsFile units, ReadUnits(text, units_file));
  Rows rows;
  for (const Unit& unit : units.units) rows[unit.id.value].unit = unit;
  FOCALFLEET_TRY_ASSIGN(const CsvTable origin, TableIn(origin_file));
  FOCALFLEET_TRY(origin.Require({"unit_id", "project", "name"}));
  FOCALFLEET_TRY(origin.ReadRows([&](CsvRow& row) {
    ExportRow* of = RowOf(&rows, &row);
    if (of == nullptr) return;
    if (row.Text("project") != project)
      return row.Reject("project", "'" + row.Text("project") + "' is not " + project);
    of->name = row.Text("name");
    for (const std::string& column : origin.columns())
      if (row.Has(column)) of->ids[column] = row.Text(column);
  }));
  return rows;
}

Status TakeState(const std::string& path, Rows* rows) {
  FOCALFLEET_TRY_ASSIGN(const CsvTable state, TableIn(path));
  FOCALFLEET_TRY(state.Require({"unit_id", "theta_deg", "phi_deg"}));
  return state.ReadRows([&](CsvRow& row) {
    if (ExportRow* of = RowOf(rows, &row))
      of->pose = AnglesDeg{row.Number("theta_deg"), row.Number("phi_deg")};
  });
}

/// The pose at the plan's end: of each axis the row that ends last.
Status TakePlan(const std::string& path, Rows* rows) {
  FOCALFLEET_TRY_ASSIGN(const CsvTable plan, TableIn(path));
  FOCALFLEET_TRY(plan.Require({"unit_id", "axis", "t1_s", "to_deg"}));
  std::map<std::pair<std::uint32_t, std::string>, double> last_s;
  return plan.ReadRows([&](CsvRow& row) {
    ExportRow* of = RowOf(rows, &row);
    const std::string axis = row.Text("axis");
    const double end_s = row.Number("t1_s");
    const double to_deg = row.Number("to_deg");
    if (axis != "theta" && axis != "phi")
      row.Reject("axis", "'" + axis + "' is neither theta nor phi");
    if (row.error() || of == nullptr) return;
    if (!of->pose)
      return row.RejectRow(
          "unit " + std::to_string(of->unit.id.value) + " has no state to begin from", "no state");
    const auto [last, fresh] = last_s.try_emplace({of->unit.id.value, axis}, end_s);
    if (!fresh && end_s < last->second) return;
    last->second = end_s;
    (axis == "theta" ? of->pose->theta_deg : of->pose->phi_deg) = to_deg;
  });
}

Status TakeTargetsOf(const std::string& path, Rows* rows) {
  FOCALFLEET_TRY_ASSIGN(const std::string text, ReadTableAsText(path, "unit_id"));
  FOCALFLEET_TRY_ASSIGN(const Targets targets, ReadTargets(text, path));
  for (const TargetRow& target : targets.rows) {
    const auto found = rows->find(target.unit.value);
    if (found == rows->end())
      return Fail(ErrorCode::kInvalid,
                  fmt::format("{}: unit {} is no unit of the import", path, target.unit.value));
    ExportRow& row = found->second;
    row.target_id = target.target_id;
    row.priority = target.priority;
    if (const auto* place = std::get_if<PointFp>(&target.place)) {
      row.target = *place;
    } else {
      const auto& angles = std::get<TargetAngles>(target.place);
      row.target = FibreOf(row.unit, {angles.theta_deg, angles.phi_deg});
    }
  }
  return {};
}

Status TakeFibres(const std::string& path, Rows* rows) {
  FOCALFLEET_TRY_ASSIGN(const CsvTable fibres, TableIn(path));
  FOCALFLEET_TRY(fibres.Require({"unit_id", "x_mm", "y_mm"}));
  return fibres.ReadRows([&](CsvRow& row) {
    ExportRow* of = RowOf(rows, &row);
    const auto x = row.NumberIfAny("x_mm");
    const auto y = row.NumberIfAny("y_mm");
    if (of != nullptr && x && y) of->measured = PointFp{*x, *y};
  });
}

Result<Rows> ReadRows(const ExportRequest& request, const std::string& project) {
  const std::filesystem::path folder(request.folder);
  FOCALFLEET_TRY_ASSIGN(Rows rows, ReadUnitsOf(request.folder, project));
  const std::string state = request.state.empty() ? (folder / "state.csv").string() : request.state;
  FOCALFLEET_TRY(TakeState(state, &rows));
  if (!request.plan.empty()) FOCALFLEET_TRY(TakePlan(request.plan, &rows));
  std::string targets = request.targets;
  if (targets.empty() && std::filesystem::exists(folder / "targets.csv"))
    targets = folder / "targets.csv";
  if (!targets.empty()) FOCALFLEET_TRY(TakeTargetsOf(targets, &rows));
  if (!request.fibres.empty()) FOCALFLEET_TRY(TakeFibres(request.fibres, &rows));
  return rows;
}

/// The whole number in a text; -1: it is none.
std::int64_t WholeOf(const std::string& text) {
  std::int64_t value = 0;
  const auto read = std::from_chars(text.data(), text.data() + text.size(), value);
  return read.ec == std::errc() && read.ptr == text.data() + text.size() && !text.empty() ? value
                                                                                          : -1;
}

double XOf(const std::optional<PointFp>& place) { return place ? place->x_mm : std::nan(""); }
double YOf(const std::optional<PointFp>& place) { return place ? place->y_mm : std::nan(""); }

}  // namespace

Result<std::size_t> ExportDesi(const ExportRequest& request) {
  FOCALFLEET_TRY_ASSIGN(const Rows rows, ReadRows(request, "desi"));
  const bool measured = !request.fibres.empty();
  std::vector<std::string> names, targets;
  std::vector<std::int64_t> location, petal, device, fibre, target;
  std::vector<double> x, y, theta, phi, seen_x, seen_y, dx, dy;
  for (const auto& [id, row] : rows) {
    names.push_back(row.name);
    location.push_back(WholeOf(row.Id("location")));
    petal.push_back(WholeOf(row.Id("petal_loc")));
    device.push_back(WholeOf(row.Id("device_loc")));
    fibre.push_back(WholeOf(row.Id("fiber")));
    target.push_back(WholeOf(row.target_id));
    const auto meant = row.Meant();
    x.push_back(XOf(meant));
    y.push_back(YOf(meant));
    theta.push_back(row.pose ? row.pose->theta_deg : std::nan(""));
    phi.push_back(row.pose ? row.pose->phi_deg : std::nan(""));
    seen_x.push_back(XOf(row.measured));
    seen_y.push_back(YOf(row.measured));
    dx.push_back(seen_x.back() - x.back());
    dy.push_back(seen_y.back() - y.back());
  }
  FitsTable table{.name = measured ? "DATA" : "FIBERASSIGN",
                  .keys = {{"ORIGIN", std::string("focalfleet"), ""}},
                  .columns = {{"LOCATION", "", std::move(location)},
                              {"PETAL_LOC", "", std::move(petal)},
                              {"DEVICE_LOC", "", std::move(device)},
                              {"FIBER", "", std::move(fibre)},
                              {"POS_ID", "", std::move(names)},
                              {"TARGETID", "", std::move(target)},
                              {measured ? "FA_X" : "FIBERASSIGN_X", "mm", std::move(x)},
                              {measured ? "FA_Y" : "FIBERASSIGN_Y", "mm", std::move(y)},
                              {"POS_T", "deg", std::move(theta)},
                              {"POS_P", "deg", std::move(phi)}}};
  if (measured) {
    table.columns.push_back({"FIBER_X", "mm", std::move(seen_x)});
    table.columns.push_back({"FIBER_Y", "mm", std::move(seen_y)});
    table.columns.push_back({"FIBER_DX", "mm", std::move(dx)});
    table.columns.push_back({"FIBER_DY", "mm", std::move(dy)});
  }
  FOCALFLEET_TRY(WriteFitsTable(request.out, table));
  return rows.size();
}

namespace {

struct FibreOfRobot {
  const char* type;
  const char* x;
  const char* y;
};
constexpr FibreOfRobot kFibres[] = {
    {"APOGEE", "apX", "apY"}, {"BOSS", "bossX", "bossY"}, {"METROLOGY", "metX", "metY"}};

/// The place of a fibre of the robot, by its place on the beta arm; the metrology fibre is at the
/// arm's end.
PointFp PlaceOfFibre(const ExportRow& row, const FibreOfRobot& fibre, const AnglesDeg& pose) {
  const auto number = [&](const char* column) {
    const auto text = row.Id(column);
    double value = 0;
    std::from_chars(text.data(), text.data() + text.size(), value);
    return value;
  };
  const double met_deg = std::atan2(number("metY"), number("metX")) * kDegPerRad;
  const double x = number(fibre.x);
  const double y = number(fibre.y);
  Unit unit = row.unit;
  unit.axis[1].arm_mm = std::hypot(x, y);
  unit.axis[1].zero_deg += std::atan2(y, x) * kDegPerRad - met_deg;
  return FibreOf(unit, pose);
}

constexpr const char* kConfSummaryHead =
    "#%yanny\n"
    "# confSummary by focalfleet\n"
    "\n"
    "typedef enum {\n    BOSS,\n    APOGEE,\n    METROLOGY,\n    NONE\n} FIBERTYPE;\n"
    "\n"
    "typedef struct {\n"
    "    short positionerId;\n"
    "    char holeId[28];\n"
    "    FIBERTYPE fiberType;\n"
    "    short assigned;\n"
    "    short on_target;\n"
    "    short valid;\n"
    "    double xwok;\n"
    "    double ywok;\n"
    "    double alpha;\n"
    "    double beta;\n"
    "    long catalogid;\n"
    "} FIBERMAP;\n"
    "\n";

}  // namespace

Result<std::size_t> ExportSdss(const ExportRequest& request) {
  FOCALFLEET_TRY_ASSIGN(const Rows rows, ReadRows(request, "sdss"));
  constexpr int kNone = -999;
  std::string text = kConfSummaryHead;
  const bool says_which = std::ranges::any_of(
      rows, [](const auto& each) { return !each.second.Id("fiberType").empty(); });
  for (const auto& [id, row] : rows) {
    const std::string assigned = says_which ? row.Id("fiberType") : "BOSS";
    for (const FibreOfRobot& fibre : kFibres) {
      if (row.Id(fibre.x).empty() || row.Id(fibre.y).empty()) continue;
      PointFp place{kNone, kNone};
      if (row.pose) place = PlaceOfFibre(row, fibre, *row.pose);
      // The camera sees the metrology fibre; the others are as far off as it is.
      if (row.pose && row.measured) {
        const PointFp meant = FibreOf(row.unit, *row.pose);
        place.x_mm += row.measured->x_mm - meant.x_mm;
        place.y_mm += row.measured->y_mm - meant.y_mm;
      }
      const bool is_assigned = row.target.has_value() && assigned == fibre.type;
      const std::int64_t catalogue = is_assigned ? WholeOf(row.target_id) : -1;
      text += fmt::format("FIBERMAP {} {} {} {} {} {} {:.6f} {:.6f} {:.6f} {:.6f} {}\n", id,
                          row.Id("holeID"), fibre.type, is_assigned ? 1 : 0,
                          is_assigned && row.measured ? 1 : 0, row.unit.enabled ? 1 : 0, place.x_mm,
                          place.y_mm, row.pose ? row.pose->theta_deg : kNone,
                          row.pose ? row.pose->phi_deg : kNone, catalogue < 0 ? kNone : catalogue);
    }
  }
  FOCALFLEET_TRY(WriteFileAtomically(request.out, text));
  return rows.size();
}

Result<std::size_t> ExportPfs(const ExportRequest& request) {
  FOCALFLEET_TRY_ASSIGN(const Rows rows, ReadRows(request, "pfs"));
  const bool measured = !request.fibres.empty();
  constexpr std::int64_t kScience = 1;
  constexpr std::int64_t kUnassigned = 4;
  constexpr std::int64_t kGood = 1;
  constexpr std::int64_t kBroken = 2;
  std::vector<std::int64_t> fibre, cobra, object, type, status;
  std::vector<double> nominal, centre;
  for (const auto& [id, row] : rows) {
    fibre.push_back(WholeOf(row.Id("fiberId")));
    cobra.push_back(id);
    object.push_back(WholeOf(row.target_id));
    type.push_back(row.target ? kScience : kUnassigned);
    status.push_back(row.unit.enabled ? kGood : kBroken);
    const auto meant = row.Meant();
    nominal.insert(nominal.end(), {XOf(meant), YOf(meant)});
    centre.insert(centre.end(), {XOf(row.measured), YOf(row.measured)});
  }
  FitsTable table{.name = measured ? "CONFIG" : "DESIGN",
                  .keys = {{"ORIGIN", std::string("focalfleet"), ""}},
                  .columns = {{"fiberId", "", std::move(fibre)},
                              {"cobraId", "", std::move(cobra)},
                              {"objId", "", std::move(object)},
                              {"targetType", "", std::move(type)},
                              {"fiberStatus", "", std::move(status)},
                              {"pfiNominal", "mm", std::move(nominal), 2}}};
  if (measured) table.columns.push_back({"pfiCenter", "mm", std::move(centre), 2});
  FOCALFLEET_TRY(WriteFitsTable(request.out, table));
  return rows.size();
}

Result<std::size_t> ExportMoons(const ExportRequest& request) {
  FOCALFLEET_TRY_ASSIGN(const Rows rows, ReadRows(request, "moons"));
  std::string text;
  std::size_t count = 0;
  for (const auto& [id, row] : rows) {
    const auto place = row.measured ? row.measured : row.Meant();
    if (!place) continue;
    const auto [r_mm, theta_deg] = PolarOf(*place);
    const std::string parity = row.Id("parity").empty() ? "R" : row.Id("parity");
    text +=
        fmt::format("{:3} {:10.5f} {:10.5f} {} {:g}\n", id, r_mm, theta_deg, parity, row.priority);
    ++count;
  }
  FOCALFLEET_TRY(WriteFileAtomically(request.out, text));
  return count;
}

}  // namespace focalfleet::observatory
