// The units that have to leave before a unit of uncertain place may look for its stops, and where
// they go. Neighbours go into their own cells and turn there until they are clear of everything
// that the homing arm may sweep. The nearest such place is taken.

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>

#include "fleet/plan/planner.h"
#include "fleet/plan/scene.h"

namespace focalfleet {
namespace {

/// A stop may yield, and its place is known only as well as the range was measured. Units: degrees.
constexpr double kBeyondStopDeg = 1;
/// Distances of one test of two sweeps; beyond it they count as not clear.
constexpr int kBudget = 40'000;

class WayMaker {
 public:
  WayMaker(const PlanRequest& request, PositionerIndex homing)
      : request_(request),
        scene_(*request.layout, request.drives, request.start),
        homing_(homing.value) {}

  Result<std::vector<std::optional<Pose>>> Run();

 private:
  void FindSwept();
  [[nodiscard]] bool ClearOfSwept(std::uint32_t unit, const PoseBox& box, double need_mm) const;
  [[nodiscard]] bool ClearOfOthers(std::uint32_t unit, const Pose& pose) const;
  [[nodiscard]] std::optional<Pose> NearestPlace(std::uint32_t unit, double need_mm) const;
  [[nodiscard]] Status CheckObstacles() const;
  Status Refuse(std::uint32_t unit, const char* why) const;

  const PlanRequest& request_;
  Scene scene_;
  std::uint32_t homing_;
  std::array<PoseBox, 2> swept_;  // phi to its upper stop, then theta to its lower one
};

void WayMaker::FindSwept() {
  const ArmGeometry& arm = scene_.arm(homing_);
  std::array<std::int32_t, kAxisCount> beyond{};
  for (const Axis axis : kAxes)
    beyond[Index(axis)] = static_cast<std::int32_t>(
        std::ceil(kBeyondStopDeg * std::numbers::pi / 180 / arm.step_rad(axis)));
  PoseBox anywhere = BoxOf(arm, request_.start[homing_]);
  const std::int32_t upper_stop = std::max(arm.range().high[1], anywhere.high[1]) + beyond[1];
  swept_[0] = anywhere;
  swept_[0].high[1] = upper_stop;
  swept_[1] = anywhere;
  swept_[1].low[1] = arm.range().high[1] - beyond[1];
  swept_[1].high[1] = upper_stop;
  swept_[1].low[0] = std::min(arm.range().low[0], anywhere.low[0]) - beyond[0];
}

bool WayMaker::ClearOfSwept(std::uint32_t unit, const PoseBox& box, double need_mm) const {
  return std::all_of(swept_.begin(), swept_.end(), [&](const PoseBox& swept) {
    if (scene_.InCell(unit, box) && scene_.InCell(homing_, swept)) return true;
    return SweepsClear(scene_.arm(homing_), Sweep::Of(swept), scene_.arm(unit), Sweep::Of(box),
                       need_mm, kBudget);
  });
}

/// Others stand where they are or go into their cells; a place in the unit's own cell is clear of
/// the latter.
bool WayMaker::ClearOfOthers(std::uint32_t unit, const Pose& pose) const {
  const SegmentFp line = scene_.arm(unit).At(pose);
  for (const NeighbourNeed& near : scene_.neighbours(unit)) {
    if (near.unit == homing_ || !scene_.is_place(near.unit)) continue;
    const Pose there = PlaceOf(request_.start[near.unit]);
    if (scene_.InCell(near.unit, there)) continue;
    if (DistanceMm(line, scene_.arm(near.unit).At(there)) <= near.need_mm) return false;
  }
  for (const StandingThing& thing : scene_.standing(unit)) {
    if (thing.by == homing_ || thing.in_cell) continue;
    if (DistanceMm(line, thing.capsule.line) <= thing.need_mm + thing.capsule.radius_mm)
      return false;
  }
  return true;
}

std::optional<Pose> WayMaker::NearestPlace(std::uint32_t unit, double need_mm) const {
  constexpr int kDirections = 120;
  constexpr int kFolds = 4;
  const ArmGeometry& arm = scene_.arm(unit);
  const PhiSpan& cell = scene_.cell(unit);
  const Pose now = PlaceOf(request_.start[unit]);
  if (!scene_.HasCell(unit)) return std::nullopt;
  const double turn = 2 * std::numbers::pi / arm.step_rad(Axis::kTheta);
  const auto back = static_cast<std::int32_t>(
      std::lround((std::numbers::pi - arm.phi_zero_rad()) / arm.step_rad(Axis::kPhi)));
  const std::int32_t nearest_fold = std::clamp(now[1], cell.low, cell.high);
  const std::int32_t full_fold = std::clamp(back, cell.low, cell.high);
  std::optional<Pose> best;
  std::int64_t best_cost = 0;
  for (int k = 0; k < 2 * kDirections; ++k) {
    const int side = k % 2 == 0 ? k / 2 : -(k + 1) / 2;
    const double theta = now[0] + std::round(turn * side / kDirections);
    if (theta < arm.range().low[0] || theta > arm.range().high[0]) continue;
    for (int fold = 0; fold <= kFolds; ++fold) {
      const Pose there{static_cast<std::int32_t>(theta),
                       nearest_fold + (full_fold - nearest_fold) * fold / kFolds};
      const std::int64_t cost = std::max(std::abs(there[0] - now[0]), std::abs(there[1] - now[1]));
      if (best && cost >= best_cost) continue;
      if (!ClearOfOthers(unit, there) || !ClearOfSwept(unit, PoseBox::Of(there), need_mm)) continue;
      best = there;
      best_cost = cost;
    }
  }
  return best;
}

Status WayMaker::Refuse(std::uint32_t unit, const char* why) const {
  const auto name = [&](std::uint32_t i) {
    return std::to_string(request_.layout->unit({i}).id.value);
  };
  return Fail(ErrorCode::kRefused,
              "unit " + name(homing_) + " cannot home: unit " + name(unit) + " " + why);
}

Status WayMaker::CheckObstacles() const {
  for (const StandingThing& thing : scene_.standing(homing_)) {
    if (thing.by != kNoUnitIndex) continue;
    for (const PoseBox& swept : swept_)
      if (!SweepClearOf(scene_.arm(homing_), Sweep::Of(swept), thing.capsule, thing.need_mm,
                        kBudget))
        return Fail(ErrorCode::kRefused,
                    "unit " + std::to_string(request_.layout->unit({homing_}).id.value) +
                        " cannot home: a fixed obstacle is in reach of its arm");
  }
  return {};
}

Result<std::vector<std::optional<Pose>>> WayMaker::Run() {
  FindSwept();
  FOCALFLEET_TRY(CheckObstacles());
  std::vector<std::optional<Pose>> targets(scene_.size());
  for (const NeighbourNeed& near : scene_.neighbours(homing_)) {
    const std::uint32_t j = near.unit;
    const PoseBox now = BoxOf(scene_.arm(j), request_.start[j]);
    if (ClearOfSwept(j, now, near.need_mm)) continue;
    if (!scene_.is_place(j)) FOCALFLEET_TRY(Refuse(j, "may be in the way, its place is not known"));
    if (!request_.layout->unit({j}).enabled || request_.frozen[j] != 0)
      FOCALFLEET_TRY(Refuse(j, "is in the way and cannot move"));
    targets[j] = NearestPlace(j, near.need_mm);
    if (!targets[j]) FOCALFLEET_TRY(Refuse(j, "is in the way and finds no place out of it"));
  }
  return targets;
}

}  // namespace

Result<std::vector<std::optional<Pose>>> MakeWayForHoming(const PlanRequest& request,
                                                          PositionerIndex homing) {
  return WayMaker(request, homing).Run();
}

}  // namespace focalfleet
