#include "fleet/plan/retreat.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace focalfleet {
namespace {

constexpr std::uint8_t kFavoursMax = 3;
constexpr std::array kGrids_deg{3.0, 1.0};

}  // namespace

std::span<const Blocker> Surroundings::Around(std::uint32_t unit, std::span<const SegmentFp> lines,
                                              std::span<const Pose> poses, bool in_cell_only) {
  blockers_.clear();
  for (const NeighbourNeed& near : scene_->neighbours(unit)) {
    if (!scene_->is_place(near.unit)) continue;
    if (in_cell_only && scene_->InCell(near.unit, poses[near.unit])) continue;
    blockers_.push_back({{lines[near.unit], 0}, near.need_mm, near.unit});
  }
  for (const StandingThing& thing : scene_->standing(unit)) {
    if (in_cell_only && thing.in_cell) continue;
    blockers_.push_back({thing.capsule, thing.need_mm, thing.by});
  }
  return blockers_;
}

Retreat::Retreat(const Scene* scene, std::span<const UnitDrive> drives, Surroundings* surroundings,
                 std::span<const Pose> poses, std::span<const std::uint8_t> movers)
    : scene_(scene),
      drives_(drives),
      surroundings_(surroundings),
      poses_(poses.begin(), poses.end()),
      lines_(poses.size()),
      movers_(movers.begin(), movers.end()),
      waits_(poses.size(), 0),
      straight_(poses.size(), Known::kNo),
      searched_deg_(poses.size(), 0),
      favours_(poses.size(), 0) {
  for (std::uint32_t i = 0; i < poses_.size(); ++i) {
    lines_[i] = scene_->arm(i).At(poses_[i]);
    if (movers_[i] == 0 || scene_->InCell(i, poses_[i])) continue;
    waits_[i] = 1;
    waiting_.push_back(i);
  }
}

void Retreat::Run() {
  for (;;) {
    while (StraightRound()) DropArrived();
    if (waiting_.empty()) return;
    bool moved = false;
    for (const double grid_deg : kGrids_deg) moved = moved || GoAround(grid_deg);
    moved = moved || MakeRoom() || Yield();
    DropArrived();
    if (!moved) return;
  }
}

Pose Retreat::StraightEnd(std::uint32_t unit) const {
  const PhiSpan& cell = scene_->cell(unit);
  const Pose& pose = poses_[unit];
  return {pose[0], std::clamp(pose[1], cell.low, std::max(cell.low, cell.high))};
}

bool Retreat::StraightClear(std::uint32_t unit) {
  if (straight_[unit] == Known::kNo) {
    const Sweep sweep{poses_[unit], StraightEnd(unit)};
    const bool clear = scene_->HasCell(unit) &&
                       SweepClear(scene_->arm(unit), sweep,
                                  surroundings_->Around(unit, lines_, poses_, false), nullptr);
    straight_[unit] = clear ? Known::kClear : Known::kBlocked;
  }
  return straight_[unit] == Known::kClear;
}

bool Retreat::StraightClearOf(std::uint32_t unit, const NeighbourNeed& near,
                              const SegmentFp& line) const {
  return SweepClearOf(scene_->arm(unit), {poses_[unit], StraightEnd(unit)}, {line, 0},
                      near.need_mm);
}

/// How many waiting neighbours this unit would block at the end of its straight way, and does not
/// block now.
int Retreat::ShutIn(std::uint32_t unit) const {
  const SegmentFp after = scene_->arm(unit).At(StraightEnd(unit));
  int count = 0;
  for (const NeighbourNeed& near : scene_->neighbours(unit)) {
    if (!Waits(near.unit)) continue;
    const NeighbourNeed back{unit, near.need_mm};
    if (!StraightClearOf(near.unit, back, after) && StraightClearOf(near.unit, back, lines_[unit]))
      ++count;
  }
  return count;
}

bool Retreat::StraightRound() {
  bool moved = false;
  std::uint32_t least_harmful = kNobody;
  int least_harm = 0;
  for (const std::uint32_t i : waiting_) {
    if (!StraightClear(i)) continue;
    const int harm = ShutIn(i);
    if (harm > 0) {
      if (least_harmful == kNobody || harm < least_harm) {
        least_harmful = i;
        least_harm = harm;
      }
      continue;
    }
    GoStraight(i);
    moved = true;
  }
  if (!moved && least_harmful != kNobody) {
    GoStraight(least_harmful);
    moved = true;
  }
  return moved;
}

bool Retreat::GoAround(double grid_deg) {
  bool moved = false;
  for (const std::uint32_t i : waiting_) {
    if (!Waits(i) || !scene_->HasCell(i)) continue;
    if (searched_deg_[i] > 0 && searched_deg_[i] <= grid_deg) continue;
    const ArmGeometry& arm = scene_->arm(i);
    PathSearch::Question question;
    question.arm = &arm;
    question.drive = &drives_[i];
    question.blockers = surroundings_->Around(i, lines_, poses_, false);
    question.from = poses_[i];
    question.within = arm.range();
    for (std::size_t k = 0; k < kAxisCount; ++k) {
      question.within.low[k] = std::min(question.within.low[k], poses_[i][k]);
      question.within.high[k] = std::max(question.within.high[k], poses_[i][k]);
    }
    PoseBox goal = question.within;
    goal.low[1] = scene_->cell(i).low;
    goal.high[1] = scene_->cell(i).high;
    question.goal = goal;
    question.grid_deg = grid_deg;
    const Way way = surroundings_->search().Find(question);
    searched_deg_[i] = grid_deg;
    if (way.empty()) continue;
    Go(i, way);
    moved = true;
  }
  return moved;
}

bool Retreat::MakeRoom() {
  bool moved = false;
  for (const std::uint32_t i : waiting_) moved = MakeRoomFor(i) || moved;
  return moved;
}

/// Neighbours that are in their cells turn there until they no longer block the straight way of
/// `unit`.
bool Retreat::MakeRoomFor(std::uint32_t unit) {
  bool moved = false;
  if (!scene_->HasCell(unit)) return false;
  for (const NeighbourNeed& near : scene_->neighbours(unit)) {
    const std::uint32_t j = near.unit;
    if (movers_[j] == 0 || Waits(j) || favours_[j] >= kFavoursMax) continue;
    if (StraightClearOf(unit, near, lines_[j])) continue;
    moved = Turn(j, near, unit) || moved;
  }
  return moved;
}

bool Retreat::Turn(std::uint32_t neighbour, const NeighbourNeed& need, std::uint32_t unit) {
  constexpr int kDirections = 24;
  const ArmGeometry& arm = scene_->arm(neighbour);
  const PhiSpan& cell = scene_->cell(neighbour);
  const auto folded = static_cast<std::int32_t>(
      std::lround((std::numbers::pi - arm.phi_zero_rad()) / arm.step_rad(Axis::kPhi)));
  const std::int32_t fold = std::clamp(folded, cell.low, cell.high);
  const double turn = 2 * std::numbers::pi / arm.step_rad(Axis::kTheta);
  for (int k = 0; k < kDirections; ++k) {
    // Nearest directions first, alternating sides.
    const int side = k % 2 == 0 ? k / 2 : -(k + 1) / 2;
    const Pose there{
        poses_[neighbour][0] + static_cast<std::int32_t>(std::lround(turn * side / kDirections)),
        fold};
    if (there[0] < arm.range().low[0] || there[0] > arm.range().high[0]) continue;
    if (!StraightClearOf(unit, need, arm.At(there))) continue;
    const Sweep sweep{poses_[neighbour], there};
    if (!SweepClear(arm, sweep, surroundings_->Around(neighbour, lines_, poses_, true), nullptr))
      continue;
    const std::array way{Waypoint{poses_[neighbour]}, Waypoint{there}};
    Go(neighbour, way);
    ++favours_[neighbour];
    return true;
  }
  return false;
}

bool Retreat::Yield() {
  for (const std::uint32_t i : waiting_) {
    if (favours_[i] >= kFavoursMax) continue;
    for (const NeighbourNeed& near : scene_->neighbours(i))
      if (Waits(near.unit) && scene_->HasCell(near.unit) && YieldTo(i, near.unit)) return true;
  }
  return false;
}

/// `unit` goes to the nearest place where it no longer blocks the straight way of `other`.
bool Retreat::YieldTo(std::uint32_t unit, std::uint32_t other) {
  const NeighbourNeed* need = nullptr;
  for (const NeighbourNeed& near : scene_->neighbours(unit))
    if (near.unit == other) need = &near;
  const NeighbourNeed back{unit, need->need_mm};
  if (StraightClearOf(other, back, lines_[unit])) return false;
  const ArmGeometry& arm = scene_->arm(unit);
  PathSearch::Question question;
  question.arm = &arm;
  question.drive = &drives_[unit];
  question.blockers = surroundings_->Around(unit, lines_, poses_, false);
  question.from = poses_[unit];
  question.within = arm.range();
  for (std::size_t k = 0; k < kAxisCount; ++k) {
    question.within.low[k] = std::min(question.within.low[k], poses_[unit][k]);
    question.within.high[k] = std::max(question.within.high[k], poses_[unit][k]);
  }
  question.grid_deg = kGrids_deg.back();
  surroundings_->search().Find(question);
  const std::vector<Pose>& reached = surroundings_->search().reached();
  for (std::size_t k = 0; k < reached.size(); ++k) {
    if (!StraightClearOf(other, back, arm.At(reached[k]))) continue;
    const Way way = surroundings_->search().WayTo(k);
    ++favours_[unit];
    Go(unit, way);
    return true;
  }
  return false;
}

void Retreat::GoStraight(std::uint32_t unit) {
  const std::array way{Waypoint{poses_[unit]}, Waypoint{StraightEnd(unit)}};
  Go(unit, way);
}

void Retreat::Go(std::uint32_t unit, std::span<const Waypoint> way) {
  for (std::size_t k = 1; k < way.size(); ++k)
    if (way[k].pose != way[k - 1].pose)
      pieces_.push_back({unit, {way[k - 1].pose, way[k].pose, way[k].out_of_step}});
  poses_[unit] = way.back().pose;
  lines_[unit] = scene_->arm(unit).At(way.back().pose);
  if (scene_->InCell(unit, poses_[unit])) waits_[unit] = 0;
  straight_[unit] = Known::kNo;
  searched_deg_[unit] = 0;
  for (const NeighbourNeed& near : scene_->neighbours(unit)) {
    straight_[near.unit] = Known::kNo;
    searched_deg_[near.unit] = 0;
  }
}

void Retreat::DropArrived() {
  std::erase_if(waiting_, [this](std::uint32_t i) { return !Waits(i); });
}

}  // namespace focalfleet
