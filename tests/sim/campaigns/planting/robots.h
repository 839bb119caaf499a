// Robots that are simulated axis by axis, in open and in closed loops. The classes that they are to
// have are planted.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "protocol/base/rng.h"
#include "sim/campaigns/diagnosis/use/axis_classes.h"

namespace focalfleet::sim::test {

inline constexpr std::size_t kMoves = 60;
inline constexpr double kNoise_mm = 0.003;

// An axis as it turns: the shares of a command that it makes, and when it makes none of it.
struct PlantedAxis {
  AxisClass is = AxisClass::kHealthy;
  double scale_cw = 1, scale_ccw = 1;
  double stall_share = 0;
  double begins_deg = 90;
  bool sticks = false;     // at begins_deg
  bool wraps = false;      // a whole turn more, to and fro
  bool is_parked = false;  // is never commanded
};

struct Robot {
  PlantedAxis axis[2];
  std::size_t stalls[2] = {0, 0};  // that were made, for the test
};

inline CampaignUnit Unit(std::uint32_t id) {
  CampaignUnit unit{.id = id, .base_x_mm = 20.0 * id, .base_y_mm = 5};
  unit.arm_mm[kTheta] = unit.arm_mm[kPhi] = 3;
  unit.zero_deg[kTheta] = 40, unit.zero_deg[kPhi] = -5;
  unit.gear[kTheta] = unit.gear[kPhi] = 337;
  unit.min_deg[kTheta] = -190, unit.max_deg[kTheta] = 190;
  unit.min_deg[kPhi] = 0, unit.max_deg[kPhi] = 180;
  return unit;
}

// A target that is at least 12 degrees away, by which a move is long.
inline double NextTarget(std::size_t axis, double from_deg, Rng* rng) {
  for (;;) {
    const double target = axis == kTheta ? rng->Uniform(-80, 80) : rng->Uniform(35, 145);
    if (std::abs(target - from_deg) > 12) return target;
  }
}

// How far the axis turns when this is asked of it. The first move is never stalled.
inline double TurnOf(const PlantedAxis& axis, double asked_deg, std::size_t move,
                     std::size_t* stalls, Rng* rng) {
  if (axis.sticks || asked_deg == 0) return 0;
  if (move > 0 && rng->Uniform() < axis.stall_share) {
    ++*stalls;
    return 0;
  }
  const double made = asked_deg * (asked_deg < 0 ? axis.scale_cw : axis.scale_ccw);
  return axis.wraps ? made + (move % 2 == 0 ? 360 : -360) : made;
}

// In a closed loop moves begin where the camera saw the axis, by noise of a few hundredths of a
// degree; in an open loop where the one before was to end.
inline void AddMoves(bool closed, Robot* robot, Rng* rng, Campaign* campaign) {
  const CampaignUnit& unit = campaign->units[campaign->first_row.size() - 1];
  double at_deg[2], cmd_deg[2];
  for (const std::size_t axis : {kTheta, kPhi})
    at_deg[axis] = cmd_deg[axis] = robot->axis[axis].begins_deg;
  for (std::size_t move = 0; move < kMoves; ++move) {
    campaign->move_id.push_back(static_cast<std::int64_t>(move) + 1);
    for (const std::size_t axis : {kTheta, kPhi}) {
      const PlantedAxis& planted = robot->axis[axis];
      const double from = closed ? at_deg[axis] + 0.03 * rng->Normal() : cmd_deg[axis];
      // Turns of theta count on: the target is meant in the turn that the axis is in.
      const double turns = axis == kTheta ? 360 * std::round(from / 360) : 0;
      const double target = turns + NextTarget(axis, from - turns, rng);
      cmd_deg[axis] = planted.is_parked ? from : target;
      campaign->from_deg[axis].push_back(from);
      campaign->cmd_deg[axis].push_back(cmd_deg[axis]);
      at_deg[axis] += TurnOf(planted, cmd_deg[axis] - from, move, &robot->stalls[axis], rng);
    }
    const PlacePoint at = PlaceOf(unit, at_deg[kTheta], at_deg[kPhi]);
    campaign->x_mm.push_back(at.x_mm + kNoise_mm * rng->Normal());
    campaign->y_mm.push_back(at.y_mm + kNoise_mm * rng->Normal());
  }
  campaign->first_row.push_back(campaign->rows());
}

inline Campaign CampaignOf(std::uint64_t seed, bool closed, std::vector<Robot>* robots) {
  Campaign campaign{.first_row = {0}};
  for (std::size_t k = 0; k < robots->size(); ++k)
    campaign.units.push_back(Unit(static_cast<std::uint32_t>(k) + 1));
  for (std::size_t k = 0; k < robots->size(); ++k) {
    Rng rng = Rng::Stream(seed, "robots", k);
    AddMoves(closed, &(*robots)[k], &rng, &campaign);
  }
  if (closed)
    campaign.covariates.push_back({"from_measured", std::vector<double>(campaign.rows(), 1)});
  EXPECT_TRUE(Validate(campaign));
  return campaign;
}

inline PlantedAxis Healthy() { return {}; }
inline PlantedAxis Scaled(double cw, double ccw) {
  return {.is = AxisClass::kScale, .scale_cw = cw, .scale_ccw = ccw};
}
inline PlantedAxis StuckAt(double deg) {
  return {.is = AxisClass::kStuck, .begins_deg = deg, .sticks = true};
}

}  // namespace focalfleet::sim::test
