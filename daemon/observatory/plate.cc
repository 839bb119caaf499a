#include "daemon/observatory/plate.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <set>
#include <utility>

#include "daemon/files/text_file.h"
#include "fleet/files/cell.h"
#include "fleet/files/fiducials_file.h"
#include "fleet/files/layout_file.h"
#include "fleet/files/obstacles_file.h"
#include "fleet/files/place.h"
#include "fleet/files/spots_file.h"
#include "fleet/files/targets_file.h"

namespace focalfleet::observatory {
namespace {

constexpr double kDeg = std::numbers::pi / 180;
constexpr double kTurnDeg = 360;

bool InRange(double angle_deg, const AxisGeometry& axis) {
  return angle_deg >= axis.min_deg && angle_deg <= axis.max_deg;
}

std::string OriginText(const Plate& plate, const std::string& project) {
  std::set<std::string> more;
  for (const PlateUnit& unit : plate.units)
    for (const auto& [column, value] : unit.ids) more.insert(column);
  std::vector<std::string_view> columns = {"unit_id", "project", "name"};
  columns.insert(columns.end(), more.begin(), more.end());
  CsvWriter csv(columns);
  for (const PlateUnit& unit : plate.units) {
    csv.Integer(unit.unit.id.value).Text(project).Text(unit.name);
    for (const std::string& column : more) {
      const auto found = unit.ids.find(column);
      csv.Text(found == unit.ids.end() ? std::string() : found->second);
    }
    csv.EndRow();
  }
  return csv.Take();
}

std::string StateText(const Plate& plate) {
  CsvWriter csv({"unit_id", "theta_deg", "phi_deg", "known"});
  for (const PlateUnit& unit : plate.units) {
    const AnglesDeg& at = unit.stands ? *unit.stands : plate.parked;
    const auto into = [&](double angle, const AxisGeometry& axis) {
      return unit.stands ? angle : std::clamp(angle, axis.min_deg, axis.max_deg);
    };
    csv.Integer(unit.unit.id.value).Number(into(at.theta_deg, unit.unit.theta()));
    csv.Number(into(at.phi_deg, unit.unit.phi())).Integer(unit.stands ? 1 : 0).EndRow();
  }
  return csv.Take();
}

std::string DisabledText(const Plate& plate) {
  CsvWriter csv({"unit_id", "name", "reason"});
  for (const PlateUnit& unit : plate.units)
    if (!unit.reason.empty())
      csv.Integer(unit.unit.id.value).Text(unit.name).Text(unit.reason).EndRow();
  return csv.Take();
}

std::string LeftOutText(const Plate& plate) {
  CsvWriter csv({"place", "what", "unit", "reason"});
  for (const LeftOut& row : plate.left_out)
    csv.Text(row.place).Text(row.what).Text(row.unit).Text(row.reason).EndRow();
  return csv.Take();
}

std::string MovesText(const Plate& plate) {
  std::set<std::string> more;
  for (const MeasuredMove& move : plate.moves)
    for (const auto& [column, value] : move.more) more.insert(column);
  std::vector<std::string_view> columns = {
      "unit_id",     "move_id", "theta_from_deg", "theta_cmd_deg", "phi_from_deg",
      "phi_cmd_deg", "x_mm",    "y_mm",           "t_s",           "from_measured"};
  columns.insert(columns.end(), more.begin(), more.end());
  CsvWriter csv(columns);
  for (const MeasuredMove& move : plate.moves) {
    csv.Integer(move.unit).Integer(move.move);
    csv.Number(move.from.theta_deg).Number(move.cmd.theta_deg);
    csv.Number(move.from.phi_deg).Number(move.cmd.phi_deg);
    csv.Number(move.x_mm).Number(move.y_mm).Number(move.t_s).Integer(move.from_measured ? 1 : 0);
    for (const std::string& column : more) {
      const auto found = move.more.find(column);
      csv.Number(found == move.more.end() ? std::nan("") : found->second);
    }
    csv.EndRow();
  }
  return csv.Take();
}

}  // namespace

PlateUnit* Plate::Find(UnitId id) { return FindBy("unit_id", std::to_string(id.value)); }

PlateUnit* Plate::FindBy(const std::string& column, const std::string& value) {
  const auto found = index.find(column + "=" + value);
  return found == index.end() ? nullptr : &units[found->second];
}

Result<std::vector<NamedTable>> ReadAll(const std::vector<std::string>& files) {
  std::vector<NamedTable> all;
  for (const std::string& file : files) {
    FOCALFLEET_TRY_ASSIGN(std::vector<NamedTable> tables, ReadTables(file));
    std::move(tables.begin(), tables.end(), std::back_inserter(all));
  }
  return all;
}

void NotePassedOver(std::initializer_list<const std::vector<NamedTable>*> lists, Plate* plate) {
  std::vector<std::pair<std::string, std::vector<std::string>>> notes;  // text and files
  for (const std::vector<NamedTable>* tables : lists)
    for (const NamedTable& each : *tables) {
      const std::vector<std::string> never = each.table.NeverAsked();
      if (never.empty()) continue;
      std::string text = "columns passed over: ";
      for (const std::string& column : never) text += (&column == &never[0] ? "" : ", ") + column;
      if (never.size() == each.table.columns().size())
        text = "table " + each.name + (each.name.empty() ? "" : " ") + "passed over";
      auto note = std::ranges::find(notes, text, &decltype(notes)::value_type::first);
      if (note == notes.end()) note = notes.insert(note, {text, {}});
      note->second.push_back(each.table.file());
    }
  for (const auto& [text, files] : notes)
    plate->notes.push_back(
        files.front() +
        (files.size() > 1 ? " and " + std::to_string(files.size() - 1) + " more" : "") + ": " +
        text);
}

const NamedTable* WithColumns(const std::vector<NamedTable>& tables,
                              std::initializer_list<std::string_view> columns) {
  const auto found = std::ranges::find_if(tables, [&](const NamedTable& each) {
    return std::ranges::all_of(
        columns, [&](std::string_view column) { return each.table.Find(column).has_value(); });
  });
  return found == tables.end() ? nullptr : &*found;
}

Result<const NamedTable*> Need(const std::vector<NamedTable>& tables,
                               std::initializer_list<std::string_view> columns,
                               const std::string& what) {
  if (const NamedTable* found = WithColumns(tables, columns)) return found;
  if (tables.empty()) return Fail(ErrorCode::kInvalid, "no file is given for " + what);
  FOCALFLEET_TRY(tables.front().table.Require(columns));
  return &tables.front();
}

std::optional<std::uint32_t> NumberInName(std::string_view name) {
  const std::size_t begin = name.find_first_of("0123456789");
  if (begin == std::string_view::npos) return std::nullopt;
  std::uint32_t number = 0;
  const char* end = name.data() + name.size();
  const auto read = std::from_chars(name.data() + begin, end, number);
  if (read.ec != std::errc() || read.ptr != end || number == UINT32_MAX) return std::nullopt;
  return number;
}

double SecondsOf(std::string_view time) {
  std::string text(Trimmed(time));
  if (const std::size_t blank = text.find(' '); blank != std::string::npos) text[blank] = 'T';
  double zone_s = 0;
  constexpr std::size_t kTime = 19;  // of 2026-03-03T01:02:03
  if (const std::size_t sign = text.find_first_of("+-", std::min(kTime, text.size()));
      sign != std::string::npos) {
    constexpr double kHour = 3600;
    const auto hours = ParseNumber(std::string_view(text).substr(sign + 1, 2));
    if (!hours) return std::nan("");
    zone_s = (text[sign] == '-' ? -kHour : kHour) * *hours;
    text.resize(sign);
  }
  const auto unix_ns = UnixNsOf(text);
  return unix_ns ? static_cast<double>(*unix_ns) * 1e-9 - zone_s : std::nan("");
}

PointFp FibreOf(const Unit& unit, const AnglesDeg& angles) {
  const double elbow = (angles.theta_deg + unit.theta().zero_deg) * kDeg;
  const double fibre = elbow + (angles.phi_deg + unit.phi().zero_deg) * kDeg;
  return {unit.base_fp.x_mm + unit.theta().arm_mm * std::cos(elbow) +
              unit.phi().arm_mm * std::cos(fibre),
          unit.base_fp.y_mm + unit.theta().arm_mm * std::sin(elbow) +
              unit.phi().arm_mm * std::sin(fibre)};
}

double TurnedInto(double angle_deg, const AxisGeometry& axis) {
  const double middle = (axis.min_deg + axis.max_deg) / 2;
  return angle_deg + kTurnDeg * std::round((middle - angle_deg) / kTurnDeg);
}

std::optional<AnglesDeg> AnglesAt(const Unit& unit, PointFp place) {
  constexpr double kTolerance_mm = 1e-3;  // tables are rounded
  const double dx = place.x_mm - unit.base_fp.x_mm;
  const double dy = place.y_mm - unit.base_fp.y_mm;
  const double a = unit.theta().arm_mm;
  const double b = unit.phi().arm_mm;
  double distance = std::hypot(dx, dy);
  if (distance > a + b + kTolerance_mm || distance < std::abs(a - b) - kTolerance_mm)
    return std::nullopt;
  distance = std::clamp(distance, std::abs(a - b), a + b);
  const double bend =
      std::acos(std::clamp((distance * distance - a * a - b * b) / (2 * a * b), -1.0, 1.0));
  for (const double fold : {bend, -bend}) {
    const double elbow =
        std::atan2(dy, dx) - std::atan2(b * std::sin(fold), a + b * std::cos(fold));
    const AnglesDeg angles{TurnedInto(elbow / kDeg - unit.theta().zero_deg, unit.theta()),
                           TurnedInto(fold / kDeg - unit.phi().zero_deg, unit.phi())};
    if (InRange(angles.theta_deg, unit.theta()) && InRange(angles.phi_deg, unit.phi()))
      return angles;
  }
  return std::nullopt;
}

void Disable(PlateUnit* unit, const std::string& reason) {
  unit->unit.enabled = false;
  unit->reason += (unit->reason.empty() ? "" : "; ") + reason;
}

void AddUnit(PlateUnit unit, CsvRow* row, Plate* plate) {
  if (row->error()) return;
  const std::string named = "unit " + unit.name + ": ";
  if (const std::string fault = FaultOf(unit.unit); !fault.empty())
    return row->RejectRow(named + fault, fault.substr(0, fault.find(' ')) + " out of bounds");
  if (plate->Find(unit.unit.id) != nullptr)
    return row->RejectRow(named + "is there twice", "is there twice");
  const std::size_t at = plate->units.size();
  plate->index.emplace("unit_id=" + std::to_string(unit.unit.id.value), at);
  for (const auto& [column, value] : unit.ids) plate->index.emplace(column + "=" + value, at);
  plate->units.push_back(std::move(unit));
}

void SetGears(const SourceFiles& files, double gear, Unit* unit) {
  unit->axis[0].gear = files.gears.empty() ? gear : files.gears.front();
  unit->axis[1].gear = files.gears.empty() ? gear : files.gears.back();
  unit->arm_half_width_mm = files.arm_half_width_mm;
}

Status TakeDisabled(const std::vector<NamedTable>& tables, const std::string& id_column,
                    Plate* plate) {
  for (const NamedTable& each : tables) {
    const bool by_project = each.table.Find(id_column).has_value();
    if (!by_project) FOCALFLEET_TRY(each.table.Require({"unit_id"}));
    FOCALFLEET_TRY(each.table.ReadRows([&](CsvRow& row) {
      const std::string column = by_project ? id_column : "unit_id";
      const auto number = NumberInName(row.Text(column));
      PlateUnit* unit = number ? plate->Find(UnitId{*number}) : nullptr;
      if (unit == nullptr)
        return row.Reject(column, Quoted(row.Text(column)) + " is no unit of the layout");
      const std::string reason = row.Text("reason");
      Disable(unit, reason.empty() ? "on the list of disabled units" : reason);
      const auto theta = row.NumberIfAny("theta_deg");
      const auto phi = row.NumberIfAny("phi_deg");
      if (theta && phi) unit->stands = AnglesDeg{*theta, *phi};
    }));
  }
  return {};
}

std::string FirstColumnOf(const CsvTable& table, std::initializer_list<std::string_view> columns) {
  for (const std::string_view column : columns)
    if (table.Find(column)) return std::string(column);
  return {};
}

Status TakeFiducials(const SourceFiles& files, Plate* plate) {
  FOCALFLEET_TRY_ASSIGN(const auto tables, ReadAll(files.fiducials));
  for (const NamedTable& each : tables) {
    const CsvTable& table = each.table;
    const std::string id = FirstColumnOf(table, {"fiducial_id", "fiducialId", "id", "device_id"});
    const std::string x = FirstColumnOf(table, {"x_mm", "xWok", "x", "offset_x_cs5", "offset_x"});
    const std::string y = FirstColumnOf(table, {"y_mm", "yWok", "y", "offset_y_cs5", "offset_y"});
    if (id.empty() || x.empty() || y.empty())
      FOCALFLEET_TRY(table.Require({"fiducial_id", "x_mm", "y_mm"}));
    FOCALFLEET_TRY(table.ReadRows([&](CsvRow& row) {
      const auto number = NumberInName(row.Text(id));
      if (!number) return row.Reject(id, Quoted(row.Text(id)) + " holds no number");
      const PointFp at{row.NumberIn(x, "mm"), row.NumberIn(y, "mm")};
      if (row.error()) return;
      plate->fiducials.push_back({*number, at});
      if (files.fiducial_radius_mm > 0)
        plate->obstacles.push_back({*number, at, files.fiducial_radius_mm});
    }));
  }
  return {};
}

void LeaveOut(const NamedTable& table, std::size_t row, const std::string& unit, const char* what,
              std::string reason, Plate* plate) {
  plate->left_out.push_back(
      {PlaceIn(table.table.file(), table.table.line(row)), unit, what, std::move(reason)});
}

void TakeTarget(TargetRow target, const NamedTable& table, std::size_t row, PlateUnit* unit,
                Plate* plate) {
  const auto leave = [&](std::string reason) {
    LeaveOut(table, row, unit->name, "target", std::move(reason), plate);
  };
  if (!unit->unit.enabled) return leave("its unit is disabled: " + unit->reason);
  if (const auto* place = std::get_if<PointFp>(&target.place)) {
    if (!AnglesAt(unit->unit, *place)) return leave("out of the unit's reach");
  } else {
    const auto& angles = std::get<TargetAngles>(target.place);
    const double theta = TurnedInto(angles.theta_deg, unit->unit.theta());
    if (!InRange(theta, unit->unit.theta()) || !InRange(angles.phi_deg, unit->unit.phi()))
      return leave("out of the unit's range: theta " + NumberText(angles.theta_deg) + ", phi " +
                   NumberText(angles.phi_deg));
  }
  constexpr std::size_t kTargetIdMax = 64;
  target.target_id.resize(std::min(target.target_id.size(), kTargetIdMax));
  plate->targets->rows.push_back(std::move(target));
}

void DisableOutsiders(Plate* plate) {
  // A robot at a hard stop reads what its encoder or camera makes of the stop. At the fibre this is
  // 4 um with arms of 22 mm, within what a camera sees. Half of it loses robots that report
  // 0.01 degrees; twice of it moves a fibre by more than its target allows.
  constexpr double kReadingOff_deg = 0.01;
  std::size_t at_the_end = 0;
  for (PlateUnit& unit : plate->units) {
    if (!unit.unit.enabled || !unit.stands) continue;
    for (const Axis axis : kAxes) {
      const AxisGeometry& geometry = unit.unit.axis[Index(axis)];
      double& at = axis == Axis::kTheta ? unit.stands->theta_deg : unit.stands->phi_deg;
      const double within = std::clamp(at, geometry.min_deg, geometry.max_deg);
      if (at != within && std::abs(at - within) <= kReadingOff_deg) {
        at = within;
        ++at_the_end;
      }
      if (!InRange(at, geometry))
        Disable(&unit, "stands outside its range: " + std::string(Name(axis)) + " " +
                           NumberText(at) + " is not within " + NumberText(geometry.min_deg) +
                           ".." + NumberText(geometry.max_deg));
    }
  }
  if (at_the_end > 0)
    plate->notes.push_back(std::to_string(at_the_end) +
                           " axes up to 0.01 degrees outside their range: taken as at its end");
}

Status WritePlate(const Plate& plate, const std::string& project, const std::string& folder) {
  std::vector<Unit> units;
  for (const PlateUnit& unit : plate.units) units.push_back(unit.unit);
  FOCALFLEET_TRY(Layout::Create(units, {.obstacles = plate.obstacles}));
  std::vector<std::pair<std::string, std::string>> files = {
      {"units.csv", WriteUnits(units)},
      {"origin.csv", OriginText(plate, project)},
      {"state.csv", StateText(plate)},
      {"disabled.csv", DisabledText(plate)},
      {"obstacles.csv", WriteObstacles(plate.obstacles)},
      {"left_out.csv", LeftOutText(plate)}};
  if (!plate.fiducials.empty())
    files.emplace_back("fiducials.csv", WriteFiducials(plate.fiducials));
  if (plate.targets) files.emplace_back("targets.csv", WriteTargets(*plate.targets));
  if (!plate.moves.empty()) files.emplace_back("moves.csv", MovesText(plate));
  std::error_code problem;
  const std::filesystem::path path(folder);
  std::filesystem::create_directories(path, problem);
  if (problem) return FailErrno(folder, "cannot be made", problem.value());
  // Tables of an import before this one would not belong to its units.
  if (std::filesystem::exists(path / "origin.csv", problem))
    for (const char* old : {"fiducials.csv", "targets.csv", "moves.csv"})
      std::filesystem::remove(path / old, problem);
  for (const auto& [name, text] : files) FOCALFLEET_TRY(WriteFileAtomically(path / name, text));
  return {};
}

}  // namespace focalfleet::observatory
