#include "daemon/observatory/moons.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <unordered_map>
#include <utility>

#include "daemon/files/text_file.h"
#include "fleet/files/cell.h"
#include "fleet/files/last_line.h"

namespace focalfleet::observatory {
namespace {

constexpr double kRad = std::numbers::pi / 180;
constexpr double kFoldedDeg = 180;

PointFp PlaceOf(double r_mm, double theta_deg) {
  return {r_mm * std::sin(theta_deg * kRad), r_mm * std::cos(theta_deg * kRad)};
}

Result<std::string> ReadWholeFile(const std::string& path) {
  FOCALFLEET_TRY_ASSIGN(std::string text, ReadTextFile(path));
  FOCALFLEET_TRY(CheckLastLine(text, path));
  return text;
}

/// A parameter file: keys with their values and lines.
class MoonsParameters {
 public:
  static Result<MoonsParameters> Read(const std::string& path) {
    FOCALFLEET_TRY_ASSIGN(const std::string text, ReadWholeFile(path));
    MoonsParameters parameters;
    parameters.file_ = path;
    std::string_view rest = text;
    for (int line = 1; !rest.empty(); ++line) {
      const std::size_t end = std::min(rest.find('\n'), rest.size());
      FOCALFLEET_TRY(parameters.TakeLine(rest.substr(0, end), line));
      rest.remove_prefix(std::min(end + 1, rest.size()));
    }
    return parameters;
  }

  [[nodiscard]] bool Has(const std::string& key) const { return values_.contains(key); }
  [[nodiscard]] std::string Text(const std::string& key) const {
    const auto found = values_.find(key);
    return found == values_.end() ? std::string() : found->second.text;
  }
  [[nodiscard]] Result<double> Number(const std::string& key) const {
    const auto found = values_.find(key);
    if (found == values_.end())
      return Fail(ErrorCode::kInvalid, file_ + ": key " + key + " is missing");
    const auto value = ParseNumber(found->second.text);
    if (value && std::isfinite(*value)) return *value;
    return Fail(ErrorCode::kInvalid, file_ + ":" + std::to_string(found->second.line) + ": key " +
                                         key + ": " + Quoted(found->second.text) +
                                         " is not a number");
  }
  /// `otherwise` where the key is not there.
  [[nodiscard]] Result<bool> Flag(const std::string& key, bool otherwise) const {
    const auto found = values_.find(key);
    if (found == values_.end()) return otherwise;
    if (const auto flag = ParseFlagWord(found->second.text)) return *flag;
    return Fail(ErrorCode::kInvalid, file_ + ":" + std::to_string(found->second.line) + ": key " +
                                         key + ": " + Quoted(found->second.text) +
                                         " is neither T nor F");
  }
  [[nodiscard]] int Line(const std::string& key) const {
    const auto found = values_.find(key);
    return found == values_.end() ? 0 : found->second.line;
  }
  /// The numbers n of keys `INS.<stem>n.<last>`, in the order of the file.
  [[nodiscard]] std::vector<std::uint32_t> NumbersOf(const std::string& stem,
                                                     const std::string& last) const {
    std::vector<std::pair<int, std::uint32_t>> found;
    const std::string begin = "INS." + stem;
    for (const auto& [key, value] : values_) {
      if (!key.starts_with(begin) || !key.ends_with("." + last)) continue;
      const std::string middle =
          key.substr(begin.size(), key.size() - begin.size() - last.size() - 1);
      if (const auto number = NumberInName(middle);
          number && middle.find_first_not_of("0123456789") == std::string::npos)
        found.emplace_back(value.line, *number);
    }
    std::ranges::sort(found);
    std::vector<std::uint32_t> numbers;
    for (const auto& [line, number] : found) numbers.push_back(number);
    return numbers;
  }
  [[nodiscard]] const std::string& file() const { return file_; }

 private:
  struct Value {
    std::string text;
    int line = 0;
  };

  Status TakeLine(std::string_view line, int number) {
    bool in_quotes = false;
    std::size_t end = line.size();
    for (std::size_t at = 0; at < line.size() && end == line.size(); ++at) {
      if (line[at] == '"') in_quotes = !in_quotes;
      if (!in_quotes && (line[at] == ';' || line[at] == '#' || line[at] == '\r')) end = at;
    }
    line = Trimmed(line.substr(0, end));
    if (line.empty()) return {};
    const std::size_t blank = std::min(line.find_first_of(" \t"), line.size());
    std::string_view value = Trimmed(line.substr(blank));
    if (value.size() >= 2 && value.front() == '"' && value.back() == '"')
      value = Trimmed(value.substr(1, value.size() - 2));
    const std::string key(line.substr(0, blank));
    const bool of_header = key.starts_with("PAF.");
    if (!values_.emplace(key, Value{std::string(value), number}).second && !of_header)
      return Fail(ErrorCode::kInvalid,
                  file_ + ":" + std::to_string(number) + ": key " + key + " is there twice");
    return {};
  }

  std::string file_;
  std::unordered_map<std::string, Value> values_;
};

Result<PointFp> MoonsPlace(const MoonsParameters& parameters, const std::string& stem) {
  FOCALFLEET_TRY_ASSIGN(const double r_mm, parameters.Number(stem + ".RFOCAL"));
  FOCALFLEET_TRY_ASSIGN(const double theta_deg, parameters.Number(stem + ".THFOCAL"));
  return PlaceOf(r_mm, theta_deg);
}

Result<Unit> CommonUnit(const MoonsParameters& parameters) {
  Unit unit;
  for (const Axis axis : kAxes) {
    const std::string number = axis == Axis::kTheta ? "1" : "2";
    AxisGeometry& geometry = unit.axis[Index(axis)];
    FOCALFLEET_TRY_ASSIGN(geometry.arm_mm, parameters.Number("INS.POS.LENGTH" + number));
    FOCALFLEET_TRY_ASSIGN(geometry.min_deg, parameters.Number("INS.POS.LOW" + number));
    FOCALFLEET_TRY_ASSIGN(geometry.max_deg, parameters.Number("INS.POS.HIGH" + number));
  }
  unit.axis[1].zero_deg = kFoldedDeg;
  return unit;
}

Status TakeUnit(const MoonsParameters& parameters, std::uint32_t number, const Unit& common,
                Plate* plate) {
  const std::string stem = "INS.POS" + std::to_string(number);
  const std::string fibre = "INS.FIBRE" + std::to_string(number);
  PlateUnit unit;
  unit.unit = common;
  unit.unit.id = UnitId{number};
  unit.name = "POS" + std::to_string(number);
  FOCALFLEET_TRY_ASSIGN(unit.unit.base_fp, MoonsPlace(parameters, stem));
  if (parameters.Has(stem + ".ORIENT")) {
    FOCALFLEET_TRY_ASSIGN(unit.unit.axis[0].zero_deg, parameters.Number(stem + ".ORIENT"));
  }
  for (const char* key : {"COLUMN", "ROW"})
    if (parameters.Has(stem + "." + key)) unit.ids[key] = parameters.Text(stem + "." + key);
  FOCALFLEET_TRY_ASSIGN(const bool is_locked, parameters.Flag(stem + ".LOCK", false));
  if (is_locked) Disable(&unit, "locked");
  FOCALFLEET_TRY_ASSIGN(const bool is_healthy, parameters.Flag(fibre + ".HEALTH", true));
  if (!is_healthy) Disable(&unit, "fibre broken");
  const auto fail = [&](const std::string& reason) {
    return Fail(ErrorCode::kInvalid, parameters.file() + ":" +
                                         std::to_string(parameters.Line(stem + ".RFOCAL")) +
                                         ": positioner " + std::to_string(number) + ": " + reason);
  };
  if (const std::string fault = FaultOf(unit.unit); !fault.empty()) return fail(fault);
  if (parameters.Has(fibre + ".RFOCAL")) {
    FOCALFLEET_TRY_ASSIGN(const PointFp at, MoonsPlace(parameters, fibre));
    unit.stands = AnglesAt(unit.unit, at);
    if (!unit.stands) return fail("its fibre cannot be where " + fibre + " has it");
  }
  const std::size_t place = plate->units.size();
  plate->index.emplace("unit_id=" + std::to_string(number), place);
  plate->units.push_back(std::move(unit));
  return {};
}

/// Acquisition cameras stand among the positioners: circles of their field.
Status TakeCameras(const MoonsParameters& parameters, Plate* plate) {
  for (const std::uint32_t number : parameters.NumbersOf("ACQ", "RFOCAL")) {
    const std::string stem = "INS.ACQ" + std::to_string(number);
    FOCALFLEET_TRY_ASSIGN(const PointFp at, MoonsPlace(parameters, stem));
    FOCALFLEET_TRY_ASSIGN(const double field_arcsec, parameters.Number(stem + ".FOV"));
    FOCALFLEET_TRY_ASSIGN(const double scale, parameters.Number("INS.POS.PSCALE"));
    if (scale <= 0)
      return Fail(ErrorCode::kInvalid, parameters.file() + ": key INS.POS.PSCALE is not above 0");
    plate->obstacles.push_back({number, at, field_arcsec / scale / 2});
  }
  return {};
}

Status TakeMoonsLayout(const std::string& file, const SourceFiles& files, Plate* plate) {
  FOCALFLEET_TRY_ASSIGN(const MoonsParameters parameters, MoonsParameters::Read(file));
  FOCALFLEET_TRY_ASSIGN(Unit common, CommonUnit(parameters));
  SetGears(files, kHexLayoutGear, &common);
  if (files.arm_half_width_mm == 0 && parameters.Has("INS.POS.WIDTH2")) {
    FOCALFLEET_TRY_ASSIGN(const double width_mm, parameters.Number("INS.POS.WIDTH2"));
    common.arm_half_width_mm = width_mm / 2;
  }
  FOCALFLEET_TRY_ASSIGN(plate->parked.theta_deg, parameters.Number("INS.POS.DEF1"));
  FOCALFLEET_TRY_ASSIGN(plate->parked.phi_deg, parameters.Number("INS.POS.DEF2"));
  const std::vector<std::uint32_t> numbers = parameters.NumbersOf("POS", "RFOCAL");
  if (numbers.empty())
    return Fail(ErrorCode::kInvalid, file + ": no positioner (INS.POS1.RFOCAL ...) in it");
  for (const std::uint32_t number : numbers)
    FOCALFLEET_TRY(TakeUnit(parameters, number, common, plate));
  return TakeCameras(parameters, plate);
}

/// The lines of targets as a table with a header; both forms become `unit r theta parity priority`.
Result<NamedTable> ReadTargetLines(const std::string& path, const Plate& plate) {
  FOCALFLEET_TRY_ASSIGN(const std::string text, ReadWholeFile(path));
  std::string csv = "unit,r,theta,parity,priority\n";
  std::string_view rest = text;
  std::size_t row = 0;
  for (int line = 1; !rest.empty(); ++line) {
    const std::size_t end = std::min(rest.find('\n'), rest.size());
    std::string_view words = rest.substr(0, end);
    rest.remove_prefix(std::min(end + 1, rest.size()));
    std::vector<std::string> cells;
    while (!words.empty() && words.front() != '#') {
      const std::size_t begin = std::min(words.find_first_not_of(" \t\r,"), words.size());
      words.remove_prefix(begin);
      const std::size_t size = std::min(words.find_first_of(" \t\r,"), words.size());
      if (size > 0 && words.front() != '#') cells.emplace_back(words.substr(0, size));
      if (!words.empty() && words.front() == '#') break;
      words.remove_prefix(size);
    }
    if (cells.empty()) continue;
    const auto fail = [&](const std::string& reason) {
      return Fail(ErrorCode::kInvalid, path + ":" + std::to_string(line) + ": " + reason);
    };
    constexpr std::size_t kShort = 5;
    constexpr std::size_t kLong = 7;
    if (cells.size() != kShort && cells.size() != kLong)
      return fail(std::to_string(cells.size()) +
                  " values: 5 are expected (positioner R THETA parity "
                  "priority), or the 7 of an assignment");
    csv += "#@ " + std::to_string(line) + "\n";
    CsvWriter writer{std::vector<std::string_view>{"unit", "r", "theta", "parity", "priority"}};
    if (cells.size() == kShort) {
      for (const std::string& cell : cells) writer.Text(cell);
    } else {
      if (row >= plate.units.size()) return fail("more rows than the layout has positioners");
      writer.Integer(plate.units[row].unit.id.value).Text(cells[2]).Text(cells[3]);
      writer.Text(ParseNumber(cells[4]) == 1.0 ? "R" : "L").Text(cells[6]);
    }
    writer.EndRow();
    const std::string made = writer.Take();
    csv += made.substr(made.find('\n') + 1);
    ++row;
  }
  FOCALFLEET_TRY_ASSIGN(CsvTable table, CsvTable::Parse(csv, path));
  return NamedTable{"", {}, std::move(table)};
}

Status TakeMoonsTargets(const std::string& file, Plate* plate) {
  FOCALFLEET_TRY_ASSIGN(const NamedTable source, ReadTargetLines(file, *plate));
  plate->targets = Targets{.source = file, .rows = {}};
  std::unordered_map<std::uint32_t, int> line_of;
  return source.table.ReadRows([&](CsvRow& row) {
    constexpr double kNoTarget = 10'000;
    const auto number = static_cast<std::uint32_t>(row.Integer("unit", {0, UINT32_MAX - 1}));
    const double r_mm = row.Number("r");
    const double theta_deg = row.Number("theta");
    const double priority = row.NumberIfAny("priority").value_or(0);
    const std::string parity = row.Text("parity");
    if (parity != "L" && parity != "R")
      row.Reject("parity", Quoted(parity) + " is neither L nor R");
    if (row.error()) return;
    PlateUnit* unit = plate->Find(UnitId{number});
    if (unit == nullptr)
      return row.Reject("unit", std::to_string(number) + " is no positioner of the layout");
    if (r_mm >= kNoTarget)
      return LeaveOut(source, row.at(), unit->name, "target", "it has no place", plate);
    if (!line_of.emplace(number, row.line()).second)
      return row.RejectRow("positioner " + std::to_string(number) + ": named twice", "named twice");
    unit->ids["parity"] = parity;
    TakeTarget({.unit = unit->unit.id,
                .place = PlaceOf(r_mm, theta_deg),
                .priority = priority,
                .target_id = "",
                .line = row.line()},
               source, row.at(), unit, plate);
  });
}

}  // namespace

std::pair<double, double> PolarOf(PointFp place) {
  const double theta_deg = std::atan2(place.x_mm, place.y_mm) / kRad;
  return {std::hypot(place.x_mm, place.y_mm), theta_deg < 0 ? theta_deg + 360 : theta_deg};
}

Result<Plate> ReadMoons(const SourceFiles& files) {
  Plate plate;
  if (!files.moves.empty() || !files.state.empty())
    return Fail(ErrorCode::kInvalid,
                "moves and states of MOONS have no form that is read: a configuration file holds "
                "where each fibre stands");
  if (files.layout.size() != 1)
    return Fail(ErrorCode::kInvalid, "one configuration file is expected as the layout");
  FOCALFLEET_TRY(TakeMoonsLayout(files.layout.front(), files, &plate));
  FOCALFLEET_TRY_ASSIGN(const auto disabled, ReadAll(files.disabled));
  FOCALFLEET_TRY(TakeDisabled(disabled, "positioner", &plate));
  DisableOutsiders(&plate);
  FOCALFLEET_TRY(TakeFiducials(files, &plate));
  for (const std::string& file : files.targets) FOCALFLEET_TRY(TakeMoonsTargets(file, &plate));
  return plate;
}

}  // namespace focalfleet::observatory
