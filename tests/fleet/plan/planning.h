// A fleet to plan for in tests: the layout, the starts and the targets; and the properties that
// every plan must have.
#pragma once

#include <gtest/gtest.h>

#include <optional>
#include <utility>
#include <vector>

#include "fleet/hex_layout.h"
#include "fleet/plan/planner.h"
#include "fleet/targets.h"
#include "protocol/base/limits.h"
#include "tests/fleet/plan/plan_rows.h"
#include "tests/support/seed.h"

namespace focalfleet::test {

struct PlanningFleet {
  Layout layout;
  std::vector<UnitDrive> drives;
  std::vector<UnitKnowledge> start;
  std::vector<std::optional<Pose>> targets;
  std::vector<std::uint8_t> frozen;

  [[nodiscard]] PlanRequest request() const {
    return {
        .layout = &layout, .drives = drives, .start = start, .targets = targets, .frozen = frozen};
  }
  void StandAt(const std::vector<Pose>& poses) {
    for (std::size_t i = 0; i < poses.size(); ++i) start[i] = Exactly(Witness::kReported, poses[i]);
  }
};

/// The seed of the k-th draw of a test.
inline std::uint64_t Seed(std::uint64_t k) { return TestSeed(1000 + k); }

inline PlanningFleet FleetOf(std::vector<Unit> units, Layout::Options options = {}) {
  auto layout = Layout::Create(std::move(units), std::move(options));
  EXPECT_TRUE(layout) << layout.error().text;
  const std::size_t n = layout->size();
  PlanningFleet fleet{std::move(*layout), std::vector<UnitDrive>(n), std::vector<UnitKnowledge>(n),
                      std::vector<std::optional<Pose>>(n), std::vector<std::uint8_t>(n, 0)};
  for (UnitKnowledge& k : fleet.start) k = Exactly(Witness::kReported, Pose{});
  return fleet;
}

/// A unit on the x axis; angles count from where the arm is stretched along it.
inline Unit UnitAt(std::uint32_t id, double x_mm, double theta_zero_deg = 0) {
  Unit unit;
  unit.id = UnitId{id};
  unit.base_fp = {x_mm, 0};
  unit.axis[0] = {8.25, theta_zero_deg, 337 * 45 / 17.0, -190, 190};
  unit.axis[1] = {8.25, 0, 337 * 45 / 17.0, 0, 180};
  return unit;
}

inline Pose PoseDeg(const PlanningFleet& fleet, std::uint32_t unit, double theta_deg,
                    double phi_deg) {
  const Unit& u = fleet.layout.unit({unit});
  const UnitDrive& d = fleet.drives[unit];
  return {NearestVectors(theta_deg, u.axis[0], d.axis[0]),
          NearestVectors(phi_deg, u.axis[1], d.axis[1])};
}

inline PlanningFleet HexFleet(std::uint32_t count, Layout::Options options = {}) {
  return FleetOf(MakeHexLayout({.count = count}), std::move(options));
}

/// Draws a random start and, for every unit that may move, a random target; both are clear.
inline void DrawStartAndTargets(PlanningFleet* fleet, std::uint64_t seed) {
  const std::size_t n = fleet->layout.size();
  std::vector<std::optional<Pose>> standing(n);
  const auto start =
      DrawConfiguration(fleet->layout, fleet->drives, standing, Rng::Stream(seed, "start"));
  ASSERT_TRUE(start) << start.error().text;
  fleet->StandAt(*start);
  const auto stands = [&](std::uint32_t i) {
    return !fleet->layout.unit({i}).enabled || fleet->frozen[i] != 0;
  };
  for (std::uint32_t i = 0; i < n; ++i)
    if (stands(i)) standing[i] = (*start)[i];
  const auto target =
      DrawConfiguration(fleet->layout, fleet->drives, standing, Rng::Stream(seed, "target"));
  ASSERT_TRUE(target) << target.error().text;
  for (std::uint32_t i = 0; i < n; ++i) {
    fleet->targets[i].reset();
    if (!stands(i)) fleet->targets[i] = (*target)[i];
  }
}

inline bool IsUnserved(const Plan& plan, std::uint32_t unit) {
  for (const Unserved& u : plan.unserved)
    if (u.unit.value == unit) return true;
  return false;
}

inline const UnitPlan* MoveOf(const Plan& plan, std::uint32_t unit) {
  for (const UnitPlan& move : plan.moves)
    if (move.unit.value == unit) return &move;
  return nullptr;
}

/// The checker's verdict on a plan.
inline CheckReport Witnessed(const PlanningFleet& fleet, const Plan& plan,
                             CheckOptions options = {}) {
  options.clearance_mm = fleet.layout.clearance_mm();
  return CheckPlan(CheckedUnits(fleet.layout, fleet.drives, fleet.start, fleet.frozen),
                   CheckedRows(plan, fleet.layout, fleet.drives), CheckedObstacles(fleet.layout),
                   options);
}

/// The properties of every plan: clear at all times, and each unit ends at the target or where it
/// stood.
inline void ExpectSound(const PlanningFleet& fleet, const Plan& plan,
                        const CheckOptions& options = {}) {
  const CheckReport report = Witnessed(fleet, plan, options);
  EXPECT_TRUE(report.ok()) << report.Text();
  std::vector<Pose> ends;
  for (const UnitKnowledge& k : fleet.start) ends.push_back(PlaceOf(k));
  for (const UnitPlan& move : plan.moves) {
    EXPECT_EQ(move.from, ends[move.unit.value]);
    Pose at = move.from;
    for (std::size_t k = 0; k < kAxisCount; ++k) {
      EXPECT_LE(move.path[k].size(), limits::kSegmentsPerAxis);
      for (const Segment& segment : move.path[k].segments()) at[k] += segment.delta;
    }
    EXPECT_EQ(move.to, at);
    EXPECT_LE(EndOf(move, fleet.drives[move.unit.value]), plan.makespan_s);
    ends[move.unit.value] = at;
  }
  for (std::uint32_t i = 0; i < ends.size(); ++i) {
    const bool served = fleet.targets[i] && !IsUnserved(plan, i);
    EXPECT_EQ(ends[i], served ? *fleet.targets[i] : PlaceOf(fleet.start[i])) << "unit index " << i;
  }
}

}  // namespace focalfleet::test
