#include "fleet/files/state_file.h"

#include <cmath>
#include <unordered_map>

#include "fleet/files/csv.h"
#include "fleet/files/place.h"
#include "fleet/kinematics.h"
#include "protocol/base/check.h"
#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

std::int32_t ReadAxis(CsvRow* row, const Unit& unit, Axis axis, const AxisDrive& drive) {
  const AxisGeometry& geometry = unit.axis[Index(axis)];
  const std::string column = std::string(Name(axis)) + "_deg";
  const double angle_deg = row->Number(column);
  const double step_deg = DegreesPerVector(geometry, drive);
  const bool outside =
      angle_deg < geometry.min_deg - step_deg / 2 || angle_deg > geometry.max_deg + step_deg / 2;
  if (unit.enabled && outside)
    row->RejectRow("column " + column + ": unit " + std::to_string(unit.id.value) + ": " +
                       row->Text(column) + " is out of its range " + NumberText(geometry.min_deg) +
                       ".." + NumberText(geometry.max_deg) + " deg",
                   column + " out of range");
  if (std::abs(angle_deg / step_deg) > limits::kPositionMax) {
    row->Reject(column, row->Text(column) + " deg is more vectors than can be counted");
    return 0;
  }
  return unit.enabled ? NearestInRange(angle_deg, geometry, drive)
                      : NearestVectors(angle_deg, geometry, drive);
}

}  // namespace

Result<std::vector<std::optional<Pose>>> ReadState(std::string_view text, std::string file,
                                                   const Layout& layout,
                                                   std::span<const UnitDrive> drives) {
  FOCALFLEET_CHECK(drives.size() == layout.size());
  FOCALFLEET_TRY_ASSIGN(const CsvTable table, CsvTable::Parse(text, std::move(file)));
  FOCALFLEET_TRY(table.Require({"unit_id", "theta_deg", "phi_deg"}));
  std::vector<std::optional<Pose>> poses(layout.size());
  std::unordered_map<std::uint32_t, int> line_of;
  FOCALFLEET_TRY(table.ReadRows([&](CsvRow& row) {
    const UnitId id{static_cast<std::uint32_t>(row.Integer("unit_id", {0, UINT32_MAX}))};
    if (row.error()) return;
    const std::string name = "unit " + std::to_string(id.value);
    const auto index = layout.Find(id);
    if (!index)
      return row.RejectRow(name + ": unknown unit, the layout has none such", "unknown unit");
    if (const auto [it, fresh] = line_of.emplace(index->value, row.line()); !fresh)
      return row.RejectRow(name + ": named twice, first in " + LineOrRow(it->second),
                           "named twice");
    const UnitDrive& drive = drives[index->value];
    Pose pose{};
    for (const Axis axis : kAxes)
      pose[Index(axis)] = ReadAxis(&row, layout.unit(*index), axis, drive.axis[Index(axis)]);
    poses[index->value] = pose;
  }));
  return poses;
}

Status RequirePoses(const std::string& file, const Layout& layout,
                    std::span<const std::optional<Pose>> poses, WhoseState whose) {
  FOCALFLEET_CHECK(poses.size() == layout.size());
  std::string named;
  std::size_t missing = 0;
  for (std::uint32_t i = 0; i < layout.size(); ++i) {
    const Unit& unit = layout.unit({i});
    if (poses[i] || (whose == WhoseState::kDisabled && unit.enabled)) continue;
    if (++missing > limits::kBadRowsReported) continue;
    named += (missing > 1 ? ", " : "") + std::to_string(unit.id.value);
  }
  if (missing == 0) return {};
  if (missing > limits::kBadRowsReported)
    named += " and " + std::to_string(missing - limits::kBadRowsReported) + " more";
  return Fail(
      ErrorCode::kInvalid,
      file + ": no row for " + (whose == WhoseState::kDisabled ? "disabled " : std::string()) +
          (missing == 1 ? "unit " + named + ": where it stands is needed to keep clear of it"
                        : "units " + named + ": where they stand is needed to keep clear of them"));
}

std::string WriteState(const Layout& layout, std::span<const UnitDrive> drives,
                       std::span<const std::optional<Pose>> poses) {
  FOCALFLEET_CHECK(drives.size() == layout.size() && poses.size() == layout.size());
  CsvWriter csv({"unit_id", "theta_deg", "phi_deg"});
  for (std::uint32_t i = 0; i < layout.size(); ++i) {
    if (!poses[i]) continue;
    const AxisAngles angles = AnglesOf(layout.unit({i}), drives[i], *poses[i]);
    csv.Integer(layout.unit({i}).id.value).Number(angles.theta_deg).Number(angles.phi_deg).EndRow();
  }
  return csv.Take();
}

}  // namespace focalfleet
