#include "fleet/files/layout_file.h"

#include <algorithm>
#include <charconv>
#include <unordered_map>

#include "fleet/files/csv.h"
#include "fleet/files/place.h"
#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

constexpr IntegerBounds kAnyId{0, UINT32_MAX - 1};

std::optional<std::uint32_t> IdIfAny(CsvRow* row, std::string_view column) {
  const auto value = row->IntegerIfAny(column, kAnyId);
  if (!value) return std::nullopt;
  return static_cast<std::uint32_t>(*value);
}

AxisGeometry ReadAxis(CsvRow* row, Axis axis) {
  const std::string name = Name(axis);
  AxisGeometry geometry;
  geometry.arm_mm = row->Number("arm_" + name + "_mm");
  geometry.zero_deg = row->Number(name + "_zero_deg");
  geometry.gear = row->Number(name + "_gear");
  geometry.min_deg = row->Number(name + "_min_deg");
  geometry.max_deg = row->Number(name + "_max_deg");
  return geometry;
}

Unit ReadUnit(CsvRow* row) {
  Unit unit;
  unit.id = UnitId{static_cast<std::uint32_t>(row->Integer("unit_id", kAnyId))};
  unit.base_fp.x_mm = row->Number("base_x_mm");
  unit.base_fp.y_mm = row->Number("base_y_mm");
  for (const Axis axis : kAxes) unit.axis[Index(axis)] = ReadAxis(row, axis);
  if (const auto width = row->NumberIfAny("arm_half_width_mm")) {
    unit.arm_half_width_mm = *width;
    if (*width <= 0)
      row->Reject("arm_half_width_mm", row->Text("arm_half_width_mm") + " is not above 0");
  }
  if (const auto rail = IdIfAny(row, "rail_id")) unit.rail = RailId{*rail};
  if (const auto bus = IdIfAny(row, "bus_id")) unit.bus = BusId{*bus};
  if (const auto node = row->IntegerIfAny("node_id", {1, limits::kNodesPerBus}))
    unit.node = NodeId{static_cast<std::uint8_t>(*node)};
  if (unit.node != kNoNode && unit.bus == kNoBus) row->Reject("bus_id", "a node_id needs a bus_id");
  unit.rail_slot = IdIfAny(row, "rail_slot");
  unit.bus_slot = IdIfAny(row, "bus_slot");
  unit.group = IdIfAny(row, "group_id");
  unit.sensors = static_cast<std::uint8_t>(
      row->IntegerIfAny("hall_sensors", {0, limits::kSensorsPerUnit}).value_or(0));
  unit.carrier_mm = row->NumberIfAny("spine_mm").value_or(0);
  unit.enabled = row->FlagIfAny("enabled").value_or(true);
  return unit;
}

// Layout::Create begins a line with "unit <id>" where the fault is one unit's; that unit's line of
// the file helps more.
std::string LinePrefix(const UnitsFile& file, std::string_view text) {
  constexpr std::string_view kUnit = "unit ";
  std::uint32_t id = 0;
  if (!text.starts_with(kUnit)) return file.source + ": ";
  text.remove_prefix(kUnit.size());
  if (std::from_chars(text.data(), text.data() + text.size(), id).ec != std::errc())
    return file.source + ": ";
  for (std::size_t i = 0; i < file.units.size(); ++i)
    if (file.units[i].id.value == id) return PlaceIn(file.source, file.lines[i]) + ": ";
  return file.source + ": ";
}

// Adds the line of the file to each line of a message.
std::string WithLines(const UnitsFile& file, std::string_view text) {
  std::string reported;
  while (!text.empty()) {
    const std::size_t begin = std::min(text.find_first_not_of(' '), text.size());
    const std::size_t end = std::min(text.find('\n'), text.size() - 1) + 1;
    const std::string_view line = text.substr(begin, end - begin);
    reported.append(text.substr(0, begin)).append(LinePrefix(file, line)).append(line);
    text.remove_prefix(end);
  }
  return reported;
}

}  // namespace

Result<UnitsFile> ReadUnits(std::string_view text, std::string file) {
  FOCALFLEET_TRY_ASSIGN(const CsvTable table, CsvTable::Parse(text, std::move(file)));
  FOCALFLEET_TRY(table.Require({"unit_id", "base_x_mm", "base_y_mm", "arm_theta_mm", "arm_phi_mm",
                                "theta_zero_deg", "phi_zero_deg", "theta_gear", "phi_gear",
                                "theta_min_deg", "theta_max_deg", "phi_min_deg", "phi_max_deg"}));
  UnitsFile units;
  units.source = table.file();
  for (std::size_t column = 0; column < table.columns().size(); ++column)
    units.columns.push_back(table.known_as(column));
  units.ignored_columns =
      table.Others({"unit_id",           "base_x_mm",      "base_y_mm",     "arm_theta_mm",
                    "arm_phi_mm",        "theta_zero_deg", "phi_zero_deg",  "theta_gear",
                    "phi_gear",          "theta_min_deg",  "theta_max_deg", "phi_min_deg",
                    "phi_max_deg",       "rail_id",        "rail_slot",     "bus_id",
                    "bus_slot",          "node_id",        "group_id",      "enabled",
                    "arm_half_width_mm", "hall_sensors",   "spine_mm",      "serial"});
  std::unordered_map<UnitId, int> line_of;
  FOCALFLEET_TRY(table.ReadRows([&](CsvRow& row) {
    const Unit unit = ReadUnit(&row);
    if (row.error()) return;
    const std::string name = "unit " + std::to_string(unit.id.value) + ": ";
    if (const std::string fault = FaultOf(unit); !fault.empty())
      return row.RejectRow(name + fault, fault.substr(0, fault.find(' ')) + " out of bounds");
    if (const auto [it, fresh] = line_of.emplace(unit.id, row.line()); !fresh)
      return row.RejectRow(name + "is there twice, first in " + LineOrRow(it->second),
                           "is there twice");
    units.units.push_back(unit);
    units.lines.push_back(row.line());
  }));
  if (units.units.empty())
    return Fail(ErrorCode::kInvalid, units.source + ": a header, but no units");
  return units;
}

Result<Layout> ReadLayout(std::string_view text, std::string file, Layout::Options options) {
  FOCALFLEET_TRY_ASSIGN(UnitsFile units, ReadUnits(text, std::move(file)));
  auto layout = Layout::Create(units.units, std::move(options));
  if (!layout) return Fail(layout.error().code, WithLines(units, layout.error().text));
  return layout;
}

std::string WriteUnits(std::span<const Unit> units) {
  const auto any = [&](auto has) { return std::any_of(units.begin(), units.end(), has); };
  const bool rail_slots = any([](const Unit& u) { return u.rail_slot.has_value(); });
  const bool bus_slots = any([](const Unit& u) { return u.bus_slot.has_value(); });
  const bool groups = any([](const Unit& u) { return u.group.has_value(); });
  const bool sensors = any([](const Unit& u) { return u.sensors > 0; });
  std::vector<std::string_view> columns = {
      "unit_id",        "base_x_mm",    "base_y_mm",        "arm_theta_mm", "arm_phi_mm",
      "theta_zero_deg", "phi_zero_deg", "theta_gear",       "phi_gear",     "theta_min_deg",
      "theta_max_deg",  "phi_min_deg",  "phi_max_deg",      "rail_id",      "bus_id",
      "node_id",        "enabled",      "arm_half_width_mm"};
  if (rail_slots) columns.emplace_back("rail_slot");
  if (bus_slots) columns.emplace_back("bus_slot");
  if (groups) columns.emplace_back("group_id");
  if (sensors) columns.insert(columns.end(), {"hall_sensors", "spine_mm"});
  CsvWriter csv(columns);
  const auto integer_if = [&](bool given, std::int64_t value) {
    if (given) {
      csv.Integer(value);
    } else {
      csv.Missing();
    }
  };
  for (const Unit& unit : units) {
    const AxisGeometry& theta = unit.theta();
    const AxisGeometry& phi = unit.phi();
    csv.Integer(unit.id.value).Number(unit.base_fp.x_mm).Number(unit.base_fp.y_mm);
    csv.Number(theta.arm_mm).Number(phi.arm_mm).Number(theta.zero_deg).Number(phi.zero_deg);
    csv.Number(theta.gear).Number(phi.gear).Number(theta.min_deg).Number(theta.max_deg);
    csv.Number(phi.min_deg).Number(phi.max_deg).Integer(unit.rail.value);
    integer_if(unit.bus != kNoBus, unit.bus.value);
    integer_if(unit.node != kNoNode, unit.node.value);
    csv.Integer(unit.enabled ? 1 : 0);
    if (unit.arm_half_width_mm > 0) {
      csv.Number(unit.arm_half_width_mm);
    } else {
      csv.Missing();
    }
    if (rail_slots) integer_if(unit.rail_slot.has_value(), unit.rail_slot.value_or(0));
    if (bus_slots) integer_if(unit.bus_slot.has_value(), unit.bus_slot.value_or(0));
    if (groups) integer_if(unit.group.has_value(), unit.group.value_or(0));
    if (sensors) {
      csv.Integer(unit.sensors);
      if (unit.sensors > 0) {
        csv.Number(unit.carrier_mm);
      } else {
        csv.Missing();
      }
    }
    csv.EndRow();
  }
  return csv.Take();
}

}  // namespace focalfleet
