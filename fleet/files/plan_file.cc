#include "fleet/files/plan_file.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <utility>

#include "fleet/files/csv.h"
#include "fleet/files/place.h"
#include "protocol/base/check.h"

namespace focalfleet {
namespace {

constexpr double kJoinToleranceDeg = 1e-6;  // rounding of a writer
constexpr double kJoinToleranceS = 1e-9;    // rounding of a writer

template <class Word, std::size_t kCount>
std::optional<Word> WordOf(const std::string& text, const Word (&words)[kCount]) {
  for (const Word word : words)
    if (text == Name(word)) return word;
  return std::nullopt;
}

PlanRow ReadRow(CsvRow* row) {
  PlanRow r;
  r.unit = UnitId{static_cast<std::uint32_t>(row->Integer("unit_id", {0, UINT32_MAX}))};
  const auto axis = WordOf(row->Text("axis"), kAxes);
  if (!axis) row->Reject("axis", "'" + row->Text("axis") + "' is neither theta nor phi");
  r.axis = axis.value_or(Axis::kTheta);
  r.t0_s = row->Number("t0_s");
  r.t1_s = row->Number("t1_s");
  if (r.t0_s < 0) row->Reject("t0_s", "before the start signal");
  if (r.t1_s < r.t0_s) row->Reject("t1_s", "the row ends before it begins");
  r.from_deg = row->Number("from_deg");
  r.to_deg = row->Number("to_deg");
  constexpr WaveMode kModes[] = {WaveMode::kAsymmetric, WaveMode::kFiveSegment,
                                 WaveMode::kSevenSegment};
  const auto mode = WordOf(row->Text("mode"), kModes);
  if (!mode)
    row->Reject("mode", "'" + row->Text("mode") +
                            "' is not one of asymmetric, five_segment, seven_segment");
  r.mode = mode.value_or(WaveMode::kAsymmetric);
  r.power_W = row->Number("power_W");
  if (r.power_W < 0) row->Reject("power_W", "negative");
  r.line = row->line();
  return r;
}

// The fault of `later` after `before`, two rows of one axis in the order of time. Empty: none.
std::string JoinFault(const PlanRow& before, const PlanRow& later) {
  const std::string of = " of line " + std::to_string(before.line);
  if (later.t0_s < before.t1_s - kJoinToleranceS)
    return "begins at " + NumberText(later.t0_s) + " s, before the end" + of + " at " +
           NumberText(before.t1_s) + " s";
  if (std::abs(later.from_deg - before.to_deg) > kJoinToleranceDeg)
    return "begins at " + NumberText(later.from_deg) + " deg, but the row" + of + " ends at " +
           NumberText(before.to_deg) + " deg";
  return {};
}

Status CheckJoins(const std::string& file, const std::vector<PlanRow>& rows) {
  std::vector<std::size_t> order(rows.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    const PlanRow& p = rows[a];
    const PlanRow& q = rows[b];
    if (p.unit != q.unit) return p.unit < q.unit;
    return p.axis != q.axis ? p.axis < q.axis : p.t0_s < q.t0_s;
  });
  BadRows bad;
  for (std::size_t k = 1; k < order.size(); ++k) {
    const PlanRow& before = rows[order[k - 1]];
    const PlanRow& later = rows[order[k]];
    if (before.unit != later.unit || before.axis != later.axis) continue;
    const std::string fault = JoinFault(before, later);
    if (fault.empty()) continue;
    std::string text = PlaceIn(file, later.line) + ": unit ";
    text += std::to_string(later.unit.value) + " " + Name(later.axis) + ": " + fault;
    bad.Add(text, "does not join up");
  }
  return bad.Check();
}

}  // namespace

std::vector<PlanRow> RowsOf(const Plan& plan, const Layout& layout,
                            std::span<const UnitDrive> drives, const MotorModel& motor) {
  FOCALFLEET_CHECK(drives.size() == layout.size());
  DrivePowers powers(motor);
  std::vector<PlanRow> rows;
  for (const UnitPlan& move : plan.moves) {
    const Unit& unit = layout.unit(move.unit);
    const UnitDrive& drive = drives[move.unit.value];
    for (const Axis axis : kAxes) {
      const AxisGeometry& geometry = unit.axis[Index(axis)];
      const AxisDrive& tuned = drive.axis[Index(axis)];
      std::int32_t at = move.from[Index(axis)];
      for (const Segment& segment : move.path[Index(axis)].segments()) {
        const SegmentTime time = TimeOf(segment, tuned);
        PlanRow row;
        row.unit = unit.id;
        row.axis = axis;
        row.t0_s = time.t0_s;
        row.t1_s = time.t1_s;
        row.from_deg = AngleDeg(at, geometry, tuned);
        at += segment.delta;
        row.to_deg = AngleDeg(at, geometry, tuned);
        row.mode = move.mode;
        row.power_W = powers.Of({AsSent(segment, tuned), move.mode, drive.v_bus_V}).total_W();
        rows.push_back(row);
      }
    }
  }
  return rows;
}

std::string WritePlan(std::span<const PlanRow> rows) {
  CsvWriter csv({"unit_id", "axis", "t0_s", "t1_s", "from_deg", "to_deg", "mode", "power_W"});
  for (const PlanRow& row : rows) {
    csv.Integer(row.unit.value).Text(Name(row.axis)).Number(row.t0_s).Number(row.t1_s);
    csv.Number(row.from_deg).Number(row.to_deg).Text(Name(row.mode)).Number(row.power_W);
    csv.EndRow();
  }
  return csv.Take();
}

Result<std::vector<PlanRow>> ReadPlan(std::string_view text, std::string file) {
  FOCALFLEET_TRY_ASSIGN(const CsvTable table, CsvTable::Parse(text, std::move(file)));
  FOCALFLEET_TRY(
      table.Require({"unit_id", "axis", "t0_s", "t1_s", "from_deg", "to_deg", "mode", "power_W"}));
  std::vector<PlanRow> rows;
  FOCALFLEET_TRY(table.ReadRows([&](CsvRow& row) { rows.push_back(ReadRow(&row)); }));
  FOCALFLEET_TRY(CheckJoins(table.file(), rows));
  return rows;
}

}  // namespace focalfleet
