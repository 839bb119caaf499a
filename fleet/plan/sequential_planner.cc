#include "fleet/plan/sequential_planner.h"

#include <algorithm>
#include <array>

namespace focalfleet {
namespace {

constexpr std::uint8_t kMovesAsideMax = 3;     // of one unit, for the sake of others
constexpr std::uint8_t kPerturbationsMax = 2;  // for one unit
constexpr int kPerturbationTries = 300;        // of one perturbation
constexpr int kPerturbationSteps = 7;          // random steps of a try, at most

}  // namespace

SequentialPlanner::SequentialPlanner(const Scene* scene, std::span<const UnitDrive> drives,
                                     Surroundings* surroundings, std::span<const Pose> poses,
                                     std::span<const std::uint8_t> movers)
    : scene_(scene),
      drives_(drives),
      surroundings_(surroundings),
      poses_(poses.begin(), poses.end()),
      lines_(poses.size()),
      movers_(movers.begin(), movers.end()),
      waits_(poses.size(), 0),
      straight_(poses.size(), Known::kNo),
      searched_deg_(poses.size(), 0),
      moves_aside_(poses.size(), 0),
      perturbations_(poses.size(), 0),
      rng_(Rng::Stream(1, "retreat")) {
  for (std::uint32_t i = 0; i < poses_.size(); ++i) {
    lines_[i] = scene_->arm(i).At(poses_[i]);
    if (movers_[i] == 0 || scene_->InCell(i, poses_[i])) continue;
    waits_[i] = 1;
    waiting_.push_back(i);
  }
}

void SequentialPlanner::Run() {
  while (!surroundings_->search().abandoned()) {
    while (StraightRound()) DropArrived();
    if (waiting_.empty()) return;
    bool moved = false;
    for (const double grid_deg : kSearchGridsDeg) moved = moved || GoAround(grid_deg);
    moved = moved || ClearStraightWays() || Perturb();
    DropArrived();
    if (!moved) return;
  }
}

Pose SequentialPlanner::StraightEnd(std::uint32_t unit) const {
  const PhiSpan& cell = scene_->cell(unit);
  const Pose& pose = poses_[unit];
  return {pose[0], std::clamp(pose[1], cell.low, std::max(cell.low, cell.high))};
}

bool SequentialPlanner::StraightClear(std::uint32_t unit) {
  if (straight_[unit] == Known::kNo) {
    const Sweep sweep{poses_[unit], StraightEnd(unit)};
    const bool clear =
        scene_->HasCell(unit) &&
        SweepClear(scene_->arm(unit), sweep,
                   surroundings_->Around(unit, lines_, poses_, Surroundings::Include::kAll),
                   nullptr);
    straight_[unit] = clear ? Known::kClear : Known::kBlocked;
  }
  return straight_[unit] == Known::kClear;
}

bool SequentialPlanner::StraightClearOf(std::uint32_t unit, const NeighbourNeed& near,
                                        const SegmentFp& line) const {
  return SweepClearOf(scene_->arm(unit), {poses_[unit], StraightEnd(unit)}, {line, 0},
                      near.need_mm);
}

/// The number of waiting neighbours that this unit would block at the end of its straight way, and
/// does not block now.
int SequentialPlanner::ShutIn(std::uint32_t unit) const {
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

bool SequentialPlanner::StraightRound() {
  bool moved = false;
  std::uint32_t least_harmful = kNoUnitIndex;
  int least_harm = 0;
  for (const std::uint32_t i : waiting_) {
    if (!StraightClear(i)) continue;
    const int harm = ShutIn(i);
    if (harm > 0) {
      if (least_harmful == kNoUnitIndex || harm < least_harm) {
        least_harmful = i;
        least_harm = harm;
      }
      continue;
    }
    GoStraight(i);
    moved = true;
  }
  if (!moved && least_harmful != kNoUnitIndex) {
    GoStraight(least_harmful);
    moved = true;
  }
  return moved;
}

bool SequentialPlanner::GoAround(double grid_deg) {
  bool moved = false;
  for (const std::uint32_t i : waiting_) {
    if (surroundings_->search().abandoned()) return moved;
    if (!Waits(i) || !scene_->HasCell(i)) continue;
    if (searched_deg_[i] > 0 && searched_deg_[i] <= grid_deg) continue;
    const Way way = WayIntoCell(i, grid_deg);
    searched_deg_[i] = grid_deg;
    if (way.empty()) continue;
    Go(i, way);
    moved = true;
  }
  return moved;
}

/// A way among all others as they stand. Empty: none on this grid.
Way SequentialPlanner::WayIntoCell(std::uint32_t unit, double grid_deg) {
  PathSearch::Question question = QuestionFor(unit, grid_deg);
  PoseBox goal = question.within;
  goal.low[1] = scene_->cell(unit).low;
  goal.high[1] = scene_->cell(unit).high;
  question.goal = goal;
  return surroundings_->search().Find(question);
}

/// A neighbour of each waiting unit is moved aside to where it no longer blocks the straight way.
/// Neighbours that are in their cells first try to stay there.
bool SequentialPlanner::ClearStraightWays() {
  for (const bool stay_in_cell : {true, false}) {
    bool moved = false;
    for (const std::uint32_t i : waiting_) moved = ClearStraightWayOf(i, stay_in_cell) || moved;
    if (moved) return true;
  }
  return false;
}

bool SequentialPlanner::ClearStraightWayOf(std::uint32_t unit, bool stay_in_cell) {
  if (!scene_->HasCell(unit) || surroundings_->search().abandoned()) return false;
  bool moved = false;
  for (const NeighbourNeed& near : scene_->neighbours(unit)) {
    if (movers_[near.unit] == 0 || moves_aside_[near.unit] >= kMovesAsideMax) continue;
    if (StraightClearOf(unit, near, lines_[near.unit])) continue;
    moved = std::any_of(
                kSearchGridsDeg.begin(), kSearchGridsDeg.end(),
                [&](double grid_deg) { return MoveAside(near, unit, grid_deg, stay_in_cell); }) ||
            moved;
  }
  return moved;
}

/// `near` goes to the nearest place where it no longer blocks the straight way of `waiting`.
bool SequentialPlanner::MoveAside(const NeighbourNeed& near, std::uint32_t waiting, double grid_deg,
                                  bool stay_in_cell) {
  const std::uint32_t unit = near.unit;
  const bool in_cell = stay_in_cell && scene_->InCell(unit, poses_[unit]);
  PathSearch::Question question = QuestionFor(unit, grid_deg);
  if (in_cell) {
    question.within.low[1] = scene_->cell(unit).low;
    question.within.high[1] = scene_->cell(unit).high;
  }
  surroundings_->search().Find(question);
  const std::vector<Pose>& reached = surroundings_->search().reached();
  for (std::size_t k = 0; k < reached.size(); ++k) {
    if (!StraightClearOf(waiting, near, question.arm->At(reached[k]))) continue;
    const Way way = surroundings_->search().WayTo(k);
    ++moves_aside_[unit];
    Go(unit, way);
    return true;
  }
  return false;
}

bool SequentialPlanner::Perturb() {
  for (const std::uint32_t i : waiting_)
    if (scene_->HasCell(i) && PerturbAround(i)) return true;
  return false;
}

/// Some of the unit and its neighbours go to random places, one after the other. Then the unit goes
/// into its cell if there is a way.
bool SequentialPlanner::PerturbAround(std::uint32_t unit) {
  std::vector<std::uint32_t> near;
  for (const NeighbourNeed& n : scene_->neighbours(unit))
    if (movers_[n.unit] != 0) near.push_back(n.unit);
  if (near.empty() || perturbations_[unit] >= kPerturbationsMax) return false;
  ++perturbations_[unit];
  std::vector<std::pair<std::uint32_t, Way>> made;
  for (int attempt = 0; attempt < kPerturbationTries && !surroundings_->search().abandoned();
       ++attempt) {
    made.clear();
    const int steps = 1 + attempt * kPerturbationSteps / kPerturbationTries;
    for (int step = 0; step < steps; ++step) {
      const std::uint64_t pick = rng_.Below(near.size() + (steps > 1 ? 1 : 0));
      const std::uint32_t mover = pick < near.size() ? near[pick] : unit;
      Way way;
      if (!RandomWay(mover, &way)) continue;
      StandAt(mover, way.back().pose);
      made.emplace_back(mover, std::move(way));
    }
    Way in;
    for (const double grid_deg : kSearchGridsDeg)
      if (in.empty()) in = WayIntoCell(unit, grid_deg);
    for (auto it = made.rbegin(); it != made.rend(); ++it)
      StandAt(it->first, it->second.front().pose);
    if (in.empty()) continue;
    for (const auto& [mover, way] : made) Go(mover, way);
    Go(unit, in);
    return true;
  }
  return false;
}

/// A way to any place that the unit can reach among all others as they stand.
bool SequentialPlanner::RandomWay(std::uint32_t unit, Way* way) {
  surroundings_->search().Find(QuestionFor(unit, kSearchGridsDeg.front()));
  const std::vector<Pose>& reached = surroundings_->search().reached();
  if (reached.empty()) return false;
  *way = surroundings_->search().WayTo(rng_.Below(reached.size()));
  return !way->empty();
}

void SequentialPlanner::StandAt(std::uint32_t unit, const Pose& pose) {
  poses_[unit] = pose;
  lines_[unit] = scene_->arm(unit).At(pose);
}

/// The question around the unit as it is now, without a goal.
PathSearch::Question SequentialPlanner::QuestionFor(std::uint32_t unit, double grid_deg) {
  PathSearch::Question question;
  question.arm = &scene_->arm(unit);
  question.drive = &drives_[unit];
  question.blockers = surroundings_->Around(unit, lines_, poses_, Surroundings::Include::kAll);
  question.from = poses_[unit];
  question.within = RangeAround(*question.arm, poses_[unit]);
  question.grid_deg = grid_deg;
  return question;
}

void SequentialPlanner::GoStraight(std::uint32_t unit) {
  const std::array way{Waypoint{poses_[unit]}, Waypoint{StraightEnd(unit)}};
  Go(unit, way);
}

void SequentialPlanner::Go(std::uint32_t unit, std::span<const Waypoint> way) {
  for (std::size_t k = 1; k < way.size(); ++k)
    if (way[k].pose != way[k - 1].pose)
      pieces_.push_back({unit, {way[k - 1].pose, way[k].pose, way[k].out_of_step}});
  poses_[unit] = way.back().pose;
  lines_[unit] = scene_->arm(unit).At(way.back().pose);
  const bool waits = !scene_->InCell(unit, poses_[unit]);
  if (waits && waits_[unit] == 0) newly_waiting_.push_back(unit);
  waits_[unit] = waits ? 1 : 0;
  straight_[unit] = Known::kNo;
  searched_deg_[unit] = 0;
  for (const NeighbourNeed& near : scene_->neighbours(unit)) {
    straight_[near.unit] = Known::kNo;
    searched_deg_[near.unit] = 0;
  }
}

void SequentialPlanner::DropArrived() {
  std::erase_if(waiting_, [this](std::uint32_t i) { return !Waits(i); });
  // Units that left their cells again for the sake of others.
  waiting_.insert(waiting_.end(), newly_waiting_.begin(), newly_waiting_.end());
  newly_waiting_.clear();
  std::sort(waiting_.begin(), waiting_.end());
  waiting_.erase(std::unique(waiting_.begin(), waiting_.end()), waiting_.end());
}

}  // namespace focalfleet
