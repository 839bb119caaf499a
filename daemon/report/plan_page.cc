#include "daemon/report/plan_page.h"

#include <algorithm>
#include <array>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>

#include "daemon/report/embedded.h"
#include "daemon/report/escape.h"
#include "daemon/report/pack.h"
#include "fleet/files/plan_file.h"
#include "fleet/kinematics.h"
#include "protocol/base/check.h"

namespace focalfleet::report {
namespace {

using Json = nlohmann::json;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// Columns of equal length, by the names that the script uses.
class Columns {
 public:
  void Add(const char* name, double value) { columns_[name].push_back(value); }
  [[nodiscard]] Json Pack() const {
    Json packed = Json::object();
    for (const auto& [name, column] : columns_) packed[name] = PackColumn(column);
    return packed;
  }

 private:
  std::map<std::string, std::vector<double>> columns_;
};

void AddHardware(const Unit& unit, Columns* out) {
  out->Add("id", unit.id.value);
  out->Add("base_x_mm", unit.base_fp.x_mm);
  out->Add("base_y_mm", unit.base_fp.y_mm);
  out->Add("arm_theta_mm", unit.theta().arm_mm);
  out->Add("arm_phi_mm", unit.phi().arm_mm);
  out->Add("theta_zero_deg", unit.theta().zero_deg);
  out->Add("phi_zero_deg", unit.phi().zero_deg);
  out->Add("half_width_mm", unit.arm_half_width_mm);
  const PatrolLimits patrol = PatrolOf(unit);
  out->Add("patrol_min_mm", patrol.min_mm);
  out->Add("patrol_max_mm", patrol.max_mm);
  out->Add("rail", unit.rail.value);
  out->Add("bus", unit.bus.value);
  out->Add("node", unit.node.value);
  out->Add("enabled", unit.enabled ? 1 : 0);
}

void AddPlaces(const PlanScene& scene, PositionerIndex i, const UnitPlan* move, Columns* out) {
  const Unit& unit = scene.layout->unit(i);
  const UnitDrive& drive = scene.drives[i.value];
  const std::optional<Pose> start = move == nullptr ? scene.start[i.value] : move->from;
  const std::optional<Pose>& target = scene.targets[i.value];
  const AxisAngles angles = start ? AnglesOf(unit, drive, *start) : AxisAngles{kNan, kNan};
  const PointFp point = target ? FibreAt(unit, drive, *target) : PointFp{kNan, kNan};
  out->Add("start_theta_deg", angles.theta_deg);
  out->Add("start_phi_deg", angles.phi_deg);
  out->Add("target_x_mm", point.x_mm);
  out->Add("target_y_mm", point.y_mm);
}

void AddCounts(const UnitPlan* move, Columns* out) {
  constexpr std::array<const char*, kAxisCount> kNames = {"theta_rows", "phi_rows"};
  for (const Axis axis : kAxes) {
    const std::size_t count = move == nullptr ? 0 : move->path[Index(axis)].segments().size();
    out->Add(kNames[Index(axis)], static_cast<double>(count));
  }
}

// `unserved` and `by` count from 1; 0 means served, and no blocking unit.
void AddOutcome(const Unserved* unserved, Columns* out) {
  out->Add("unserved", unserved == nullptr ? 0 : 1 + static_cast<int>(unserved->why));
  out->Add("by", unserved == nullptr || !unserved->by ? 0 : 1.0 + unserved->by->value);
}

// Both lists ascend by unit, so one pass meets every entry.
template <class Entry>
const Entry* TakeIf(PositionerIndex unit, const std::vector<Entry>& entries, std::size_t* next) {
  if (*next == entries.size() || entries[*next].unit != unit) return nullptr;
  return &entries[(*next)++];
}

Json UnitsJson(const PlanScene& scene) {
  Columns columns;
  std::size_t next_move = 0;
  std::size_t next_unserved = 0;
  for (std::uint32_t i = 0; i < scene.layout->size(); ++i) {
    const UnitPlan* move = TakeIf({i}, scene.plan->moves, &next_move);
    AddHardware(scene.layout->unit({i}), &columns);
    AddPlaces(scene, {i}, move, &columns);
    AddCounts(move, &columns);
    AddOutcome(TakeIf({i}, scene.plan->unserved, &next_unserved), &columns);
  }
  FOCALFLEET_CHECK(next_move == scene.plan->moves.size());
  FOCALFLEET_CHECK(next_unserved == scene.plan->unserved.size());
  return columns.Pack();
}

// The rows of an axis join up: each begins where the previous one ended.
Json RowsJson(const std::vector<PlanRow>& rows) {
  Columns columns;
  for (const PlanRow& row : rows) {
    columns.Add("t0_s", row.t0_s);
    columns.Add("t1_s", row.t1_s);
    columns.Add("to_deg", row.to_deg);
    columns.Add("power_W", row.power_W);
  }
  return columns.Pack();
}

Json PairsJson(std::vector<TightPair> pairs) {
  std::stable_sort(pairs.begin(), pairs.end(), [](const TightPair& p, const TightPair& q) {
    return p.clearance_mm < q.clearance_mm;
  });
  pairs.resize(std::min(pairs.size(), kTightPairsShownMax));
  Json list = Json::array();
  for (const TightPair& pair : pairs) {
    list.push_back({{"a", pair.a.value},
                    {"b", pair.b.value},
                    {"clearance_mm", pair.clearance_mm},
                    {"t_s", pair.t_s}});
  }
  return list;
}

Json SceneJson(const PlanScene& scene) {
  const std::vector<PlanRow> rows = RowsOf(*scene.plan, *scene.layout, scene.drives, scene.motor);
  Json obstacles = Json::array();
  for (const Obstacle& obstacle : scene.layout->obstacles()) {
    obstacles.push_back({{"id", obstacle.id},
                         {"x_mm", obstacle.centre_fp.x_mm},
                         {"y_mm", obstacle.centre_fp.y_mm},
                         {"radius_mm", obstacle.radius_mm}});
  }
  Json limits = Json::array();
  for (const RailLimit& limit : scene.rail_limits) {
    limits.push_back({{"rail", limit.rail.value}, {"limit_W", limit.limit_W}});
  }
  return {{"units_count", scene.layout->size()},
          {"units", UnitsJson(scene)},
          {"rows_count", rows.size()},
          {"rows", RowsJson(rows)},
          {"pitch_mm", scene.layout->pitch_mm()},
          {"clearance_mm", scene.layout->clearance_mm()},
          {"obstacles", obstacles},
          {"pairs", PairsJson(scene.plan->tightest)},
          {"rail_limits", limits}};
}

}  // namespace

std::string PlanPage(const PlanScene& scene) {
  FOCALFLEET_CHECK(scene.layout != nullptr && scene.plan != nullptr);
  FOCALFLEET_CHECK(scene.drives.size() == scene.layout->size());
  FOCALFLEET_CHECK(scene.start.size() == scene.layout->size());
  FOCALFLEET_CHECK(scene.targets.size() == scene.layout->size());
  const std::string title = EscapeMarkup(scene.title);
  std::string out =
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n"
      "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; "
      "style-src 'unsafe-inline'; script-src 'unsafe-inline'\"/>\n";
  out.append("<title>").append(title).append("</title>\n<style>\n");
  out.append(kPlanPageStyle).append("</style>\n</head>\n<body>\n");
  out.append("<header><h1>").append(title).append("</h1><p id=\"summary\"></p></header>\n");
  // The data are numbers and base64 only, so nothing in them can end the element.
  out.append(kPlanPageBody).append(R"(<script type="application/json" id="plan">)");
  out.append(SceneJson(scene).dump()).append("</script>\n<script>\n");
  return out.append(kPlanPageScript).append("</script>\n</body>\n</html>\n");
}

}  // namespace focalfleet::report
