#include "fleet/files/targets_file.h"

#include <algorithm>
#include <unordered_map>

#include "fleet/files/csv.h"
#include "fleet/files/place.h"
#include "fleet/kinematics.h"
#include "protocol/base/check.h"

namespace focalfleet {
namespace {

std::variant<PointFp, TargetAngles> ReadPlace(CsvRow* row) {
  const bool place = row->Has("x_mm") || row->Has("y_mm");
  const bool angles = row->Has("theta_deg") || row->Has("phi_deg");
  if (place && angles) {
    row->Reject("x_mm", "a place and angles in one row; give one of them");
    return PointFp{};
  }
  if (angles) return TargetAngles{row->Number("theta_deg"), row->Number("phi_deg")};
  return PointFp{row->Number("x_mm"), row->Number("y_mm")};
}

Status RequireOneKind(const CsvTable& table) {
  FOCALFLEET_TRY(table.Require({"unit_id"}));
  const bool any_place = table.Find("x_mm") || table.Find("y_mm");
  const bool any_angle = table.Find("theta_deg") || table.Find("phi_deg");
  if (any_place || !any_angle) FOCALFLEET_TRY(table.Require({"x_mm", "y_mm"}));
  if (any_angle) FOCALFLEET_TRY(table.Require({"theta_deg", "phi_deg"}));
  return {};
}

constexpr std::size_t kTargetIdMax = 64;

}  // namespace

Result<Targets> ReadTargets(std::string_view text, std::string file) {
  FOCALFLEET_TRY_ASSIGN(const CsvTable table, CsvTable::Parse(text, std::move(file)));
  FOCALFLEET_TRY(RequireOneKind(table));
  Targets targets;
  targets.source = table.file();
  targets.ignored_columns =
      table.Others({"unit_id", "x_mm", "y_mm", "theta_deg", "phi_deg", "priority", "target_id"});
  std::unordered_map<UnitId, int> line_of;
  FOCALFLEET_TRY(table.ReadRows([&](CsvRow& row) {
    TargetRow target;
    target.unit = UnitId{static_cast<std::uint32_t>(row.Integer("unit_id", {0, UINT32_MAX}))};
    target.place = ReadPlace(&row);
    target.priority = row.NumberIfAny("priority").value_or(0);
    target.target_id = row.Text("target_id");
    if (target.target_id.size() > kTargetIdMax)
      row.Reject("target_id", "is longer than " + std::to_string(kTargetIdMax) + " characters");
    target.line = row.line();
    if (row.error()) return;
    if (const auto [it, fresh] = line_of.emplace(target.unit, target.line); !fresh)
      return row.RejectRow("unit " + std::to_string(target.unit.value) +
                               ": named twice, first in " + LineOrRow(it->second),
                           "named twice");
    targets.rows.push_back(std::move(target));
  }));
  if (targets.rows.empty())
    return Fail(ErrorCode::kInvalid, targets.source + ": a header, but no targets");
  return targets;
}

std::string WriteTargets(const Targets& targets) {
  const auto any = [&](auto has) {
    return std::any_of(targets.rows.begin(), targets.rows.end(), has);
  };
  const bool places =
      any([](const TargetRow& r) { return std::holds_alternative<PointFp>(r.place); });
  const bool angles =
      any([](const TargetRow& r) { return std::holds_alternative<TargetAngles>(r.place); });
  const bool priorities = any([](const TargetRow& r) { return r.priority != 0; });
  const bool names = any([](const TargetRow& r) { return !r.target_id.empty(); });
  std::vector<std::string_view> columns = {"unit_id"};
  if (places || !angles) columns.insert(columns.end(), {"x_mm", "y_mm"});
  if (angles) columns.insert(columns.end(), {"theta_deg", "phi_deg"});
  if (priorities) columns.emplace_back("priority");
  if (names) columns.emplace_back("target_id");
  CsvWriter csv(columns);
  for (const TargetRow& row : targets.rows) {
    csv.Integer(row.unit.value);
    const auto* place = std::get_if<PointFp>(&row.place);
    const auto* pair = std::get_if<TargetAngles>(&row.place);
    if (place != nullptr) csv.Number(place->x_mm).Number(place->y_mm);
    if (place == nullptr && places) csv.Missing().Missing();
    if (pair != nullptr) csv.Number(pair->theta_deg).Number(pair->phi_deg);
    if (pair == nullptr && angles) csv.Missing().Missing();
    if (priorities) csv.Number(row.priority);
    if (names) csv.Text(row.target_id);
    csv.EndRow();
  }
  return csv.Take();
}

Targets TargetsOf(const Layout& layout, std::span<const UnitDrive> drives,
                  std::span<const std::optional<Pose>> poses) {
  FOCALFLEET_CHECK(drives.size() == layout.size() && poses.size() == layout.size());
  Targets targets;
  for (std::uint32_t i = 0; i < layout.size(); ++i) {
    if (!poses[i]) continue;
    const Unit& unit = layout.unit({i});
    const AxisAngles angles = AnglesOf(unit, drives[i], *poses[i]);
    TargetRow row;
    row.unit = unit.id;
    row.place = TargetAngles{angles.theta_deg, angles.phi_deg};
    targets.rows.push_back(std::move(row));
  }
  return targets;
}

}  // namespace focalfleet
