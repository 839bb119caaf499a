// The scene is a plan for the page's tests in which everything occurs that the page can show. Units
// move, have no target, are disabled, are not served, block another, or have no known place. A
// fixed obstacle, two rails with limits and tight pairs are there, too.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "daemon/report/plan_page.h"
#include "fleet/knowledge.h"
#include "tests/fleet/plan/planning.h"

namespace focalfleet::report::test {

struct SceneData {
  static constexpr std::uint32_t kUnits = 61;
  static constexpr PositionerIndex kDisabled{4};
  static constexpr PositionerIndex kUnserved{9};
  static constexpr PositionerIndex kInTheWay{2};
  static constexpr PositionerIndex kUnknown{12};
  static constexpr PositionerIndex kWithoutTarget{30};

  focalfleet::test::PlanningFleet fleet;
  std::vector<std::optional<Pose>> start;
  Plan plan;

  /// Lifetime: the scene refers to this object.
  [[nodiscard]] PlanScene scene() const {
    return {.title = "Plan: <61> & more",
            .layout = &fleet.layout,
            .drives = fleet.drives,
            .start = start,
            .targets = fleet.targets,
            .plan = &plan,
            .rail_limits = {{RailId{0}, 6.5}, {RailId{1}, 3.0}}};
  }
};

inline void TakeOut(PositionerIndex unit, Plan* plan) {
  std::erase_if(plan->moves, [&](const UnitPlan& move) { return move.unit == unit; });
}

inline SceneData MakeSceneData() {
  std::vector<Unit> units = MakeHexLayout({.count = SceneData::kUnits, .units_per_rail = 31});
  units[SceneData::kDisabled.value].enabled = false;
  for (std::size_t i = 0; i < units.size(); ++i) {  // as built: no two alike
    const auto nth = static_cast<double>(i);
    units[i].axis[0] = {8.25 - 0.001 * nth, 11 * nth, 800 + nth, -190, 190};
    units[i].axis[1] = {8.2 - 0.002 * nth, 3 + 0.01 * nth, 900 - nth, 0, 180};
    units[i].arm_half_width_mm = 1.9 + 0.001 * nth;
  }
  // The obstacle lies between three bases, where only tips reach it.
  const Layout::Options options{.obstacles = {{7, {12.8, 7.39}, 0.5}}};
  SceneData data{focalfleet::test::FleetOf(units, options), {}, {}};
  focalfleet::test::DrawStartAndTargets(&data.fleet, focalfleet::test::TestSeed(3));
  data.fleet.frozen[SceneData::kDisabled.value] = 1;
  data.fleet.targets[SceneData::kWithoutTarget.value].reset();
  auto plan = MakePlan(data.fleet.request(), {.fixed = true});
  EXPECT_TRUE(plan) << plan.error().text;
  data.plan = std::move(*plan);
  for (const UnitKnowledge& known : data.fleet.start) data.start.emplace_back(PlaceOf(known));
  TakeOut(SceneData::kUnserved, &data.plan);
  data.plan.unserved = {
      {SceneData::kUnserved, UnservedWhy::kBlocked, std::optional(SceneData::kInTheWay), {}}};
  TakeOut(SceneData::kUnknown, &data.plan);
  data.start[SceneData::kUnknown.value].reset();
  // The pairs are not ordered; the page orders them.
  data.plan.tightest = {{{0}, {1}, 0.0456, 9.5}, {{7}, {19}, 0.0012, 4.25}, {{3}, {10}, 0.5, 20}};
  return data;
}

}  // namespace focalfleet::report::test
