#include "fleet/plan/time_search.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numbers>

#include "protocol/base/instants.h"

namespace focalfleet {
namespace {

constexpr std::uint8_t kPerhaps = 1;
constexpr std::uint8_t kBlocked = 2;

}  // namespace

/// False: there is no time, or the target is never safe for good.
bool TimeSearch::SetUp() {
  // A step lasts as long as the slower axis needs for the grid; the quicker axis gets farther in
  // it.
  double step_s = 0;
  for (const Axis axis : kAxes) {
    const double vectors = q_.grid_deg * std::numbers::pi / 180 / q_.arm->step_rad(axis);
    step_s = std::max(step_s, vectors * SecondsPerVector(q_.drive->axis[Index(axis)]));
  }
  // A step is a round number of ticks, so that usual drives turn whole vectors in it.
  constexpr std::int64_t kRoundTicks = 60;
  step_ticks_ =
      std::max<std::int64_t>(1, std::llround(step_s / kTickS / kRoundTicks)) * kRoundTicks;
  step_s_ = static_cast<double>(step_ticks_) * kTickS;
  for (std::size_t k = 0; k < kAxisCount; ++k) {
    const double vectors = step_s_ / SecondsPerVector(q_.drive->axis[k]) + 1e-6;
    step_[k] = std::max(1, static_cast<std::int32_t>(vectors));
    low_[k] = -((q_.from[k] - q_.within.low[k]) / step_[k]);
    count_[k] = (q_.within.high[k] - q_.from[k]) / step_[k] - low_[k] + 1;
  }
  steps_max_ = static_cast<std::int32_t>((q_.end_s - q_.begin_s) / step_s_);
  nodes_.clear();
  open_.clear();
  BundleUp(q_.standing, &bundles_);
  const auto poses = static_cast<std::size_t>(count_[0]) * static_cast<std::size_t>(count_[1]);
  safe_.resize(std::max(safe_.size(), poses));
  known_.assign(poses, 0);
  if (steps_max_ <= 0) return false;
  target_safe_ = steps_max_ + 1;
  for (std::int32_t step = steps_max_; step >= 0; --step) {
    Leg leg = LegOf(q_.to, q_.to, step);
    if (step == steps_max_) leg.end_s = Track::kForever;
    if (!StepClear(leg)) break;
    target_safe_ = step;
  }
  return target_safe_ <= steps_max_;
}

Pose TimeSearch::PoseOf(std::int32_t pose) const {
  return {q_.from[0] + (pose / count_[1] + low_[0]) * step_[0],
          q_.from[1] + (pose % count_[1] + low_[1]) * step_[1]};
}

/// The leg from one pose to another in one step.
Leg TimeSearch::LegOf(const Pose& from, const Pose& to, std::int32_t step) const {
  Leg leg;
  leg.begin_s = q_.begin_s + step * step_s_;
  leg.end_s = leg.begin_s + step_s_;
  leg.theta_rad = q_.arm->Theta(from[0]);
  leg.fold_rad = q_.arm->Fold(from[1]);
  leg.theta_rad_per_s = (q_.arm->Theta(to[0]) - leg.theta_rad) / step_s_;
  leg.fold_rad_per_s = (q_.arm->Fold(to[1]) - leg.fold_rad) / step_s_;
  leg.speed_mm_per_s =
      (q_.arm->theta_arm_mm() + q_.arm->phi_arm_mm()) * std::abs(leg.theta_rad_per_s) +
      q_.arm->phi_arm_mm() * std::abs(leg.fold_rad_per_s);
  return leg;
}

bool TimeSearch::StepClear(const Leg& leg) const {
  const SegmentFp middle = ArmAt(*q_.arm, leg, (leg.begin_s + leg.end_s) / 2);
  const double travel = leg.speed_mm_per_s * (leg.end_s - leg.begin_s) / 2;
  for (const MovingNeighbour& neighbour : q_.moving) {
    const double far = neighbour.need_mm + travel + neighbour.track->reach_mm();
    if (SquaredDistance(neighbour.arm->base_fp(), middle) > far * far) continue;
    if (!LegPassesClear(*q_.arm, leg, *neighbour.arm, *neighbour.track, neighbour.need_mm,
                        neighbour.tolerance))
      return false;
  }
  for (const Bundle& bundle : bundles_) {
    const double all_far = travel + bundle.around.radius_mm;
    if (bundle.has_several() && SquaredDistance(bundle.around.line, middle) > all_far * all_far)
      continue;
    for (const Blocker& blocker : OfBundle(bundle)) {
      const double far = blocker.need_mm + travel + blocker.capsule.radius_mm;
      if (SquaredDistance(blocker.capsule.line, middle) > far * far) continue;
      if (!LegPassesClearOf(*q_.arm, leg, blocker.capsule, blocker.need_mm)) return false;
    }
  }
  return true;
}

std::int32_t TimeSearch::StepsLeft(const Pose& pose) const {
  std::int32_t left = 0;
  for (std::size_t k = 0; k < kAxisCount; ++k)
    left = std::max(left, (std::abs(q_.to[k] - pose[k]) + step_[k] - 1) / step_[k]);
  return left;
}

/// The intervals in which the pose may be held. Slices decide most steps; the rest is tested.
std::vector<TimeSearch::Interval>& TimeSearch::SafeAt(std::int32_t pose) {
  std::vector<Interval>& safe = safe_[static_cast<std::size_t>(pose)];
  if (known_[static_cast<std::size_t>(pose)] != 0) return safe;
  known_[static_cast<std::size_t>(pose)] = 1;
  safe.clear();
  const Pose at = PoseOf(pose);
  const SegmentFp line = q_.arm->At(at);
  for (const Bundle& bundle : bundles_) {
    const double all_need = bundle.around.radius_mm;
    if (bundle.has_several() && SquaredDistance(line, bundle.around.line) > all_need * all_need)
      continue;
    for (const Blocker& blocker : OfBundle(bundle)) {
      const double need = blocker.need_mm + blocker.capsule.radius_mm;
      if (SquaredDistance(line, blocker.capsule.line) <= need * need) return safe;
    }
  }
  const Bounds here{std::min(line.a.x_mm, line.b.x_mm), std::max(line.a.x_mm, line.b.x_mm),
                    std::min(line.a.y_mm, line.b.y_mm), std::max(line.a.y_mm, line.b.y_mm)};
  blocked_.assign(static_cast<std::size_t>(steps_max_) + 1, 0);
  constexpr double h = Track::kSliceS;
  for (const MovingNeighbour& neighbour : q_.moving) {
    const double far = neighbour.need_mm + neighbour.track->reach_mm();
    if (SquaredDistance(neighbour.arm->base_fp(), line) > far * far) continue;
    const int last = neighbour.track->slice_count();
    const int first = std::max(-1, static_cast<int>(q_.begin_s / h) - 4);
    for (int n = first; n <= last; ++n) {
      // Most of the time most arms are elsewhere: one test covers all slices of a box.
      if (n >= 0 && n % Track::kSlicesPerBounds == 0 && n + Track::kSlicesPerBounds <= last &&
          Apart(neighbour.track->bounds(n / Track::kSlicesPerBounds), here, neighbour.need_mm)) {
        n += Track::kSlicesPerBounds - 1;
        continue;
      }
      const Slice& slice = neighbour.track->slice(n);
      const double enough = neighbour.need_mm + slice.travel_mm;
      const double distance2 = SquaredDistance(line, slice.line);
      if (distance2 > enough * enough) continue;
      const double slip_s = neighbour.tolerance.Slip((n + 2) * h);
      const double from_s = n < 0 ? -1 : n * h - slip_s - q_.begin_s;
      const double to_s = n == last ? Track::kForever : (n + 1) * h + slip_s - q_.begin_s;
      const auto from = static_cast<std::int32_t>(std::max(0.0, std::floor(from_s / step_s_)));
      const auto to =
          static_cast<std::int32_t>(std::min<double>(steps_max_, std::ceil(to_s / step_s_)));
      const bool certain = distance2 <= neighbour.need_mm * neighbour.need_mm;
      for (std::int32_t step = from; step <= to; ++step) {
        std::uint8_t& blocked = blocked_[static_cast<std::size_t>(step)];
        blocked = std::max(blocked, certain ? kBlocked : kPerhaps);
      }
    }
  }
  for (std::int32_t step = 0; step <= steps_max_; ++step) {
    const std::uint8_t blocked = blocked_[static_cast<std::size_t>(step)];
    if (blocked == kBlocked || (blocked == kPerhaps && !StepClear(LegOf(at, at, step)))) continue;
    if (safe.empty() || safe.back().last + 1 < step) safe.push_back({step, step, -1});
    safe.back().last = step;
  }
  return safe;
}

std::optional<AxisPaths> TimeSearch::LayOut(std::int32_t last, std::int32_t leaves) const {
  struct Turn {
    std::int32_t step;  // the step that ends it
    std::array<std::int8_t, kAxisCount> turned;
  };
  std::vector<Turn> turns;
  for (std::int32_t at = last; nodes_[static_cast<std::size_t>(at)].came_from >= 0;
       at = nodes_[static_cast<std::size_t>(at)].came_from) {
    const Node& node = nodes_[static_cast<std::size_t>(at)];
    turns.push_back({node.step, {node.turned[0], node.turned[1]}});
  }
  std::reverse(turns.begin(), turns.end());
  const Pose end = PoseOf(nodes_[static_cast<std::size_t>(last)].pose);
  AxisPaths paths;
  const auto begin_ticks = static_cast<std::int64_t>(std::ceil(q_.begin_s / kTickS - 1e-6));
  for (std::size_t k = 0; k < kAxisCount; ++k) {
    // A run goes on as long as each step follows the one before without a pause.
    std::int32_t since = 0;
    std::int32_t until = -1;
    std::int32_t delta = 0;
    const auto close = [&] {
      if (delta == 0) return true;
      if (paths[k].full()) return false;
      paths[k].Append({static_cast<std::uint32_t>(begin_ticks + since * step_ticks_), delta,
                       q_.drive->axis[k].repeat});
      delta = 0;
      return true;
    };
    const auto turn = [&](std::int32_t begins, std::int32_t by) {
      if (by == 0) return true;
      if (begins != until || (delta > 0) != (by > 0)) {
        if (!close()) return false;
        since = begins;
      }
      delta += by;
      until = begins + 1;
      return true;
    };
    for (const Turn& t : turns)
      if (!turn(t.step - 1, t.turned[k] * step_[k])) return std::nullopt;
    if (!turn(leaves, q_.to[k] - end[k]) || !close()) return std::nullopt;
  }
  return paths;
}

/// The unit stays clear for the rest of less than a step, and at the target from then on.
bool TimeSearch::EndsClear(const Pose& pose, std::int32_t step) const {
  const double begin_s = q_.begin_s + step * step_s_;
  AxisPaths paths;
  for (std::size_t k = 0; k < kAxisCount; ++k)
    if (q_.to[k] != pose[k])
      paths[k].Append({static_cast<std::uint32_t>(std::ceil(begin_s / kTickS - 1e-6)),
                       q_.to[k] - pose[k], q_.drive->axis[k].repeat});
  const Track rest(*q_.arm, *q_.drive, pose, paths);
  return std::all_of(rest.legs().begin(), rest.legs().end(), [&](Leg leg) {
    leg.begin_s = std::max(leg.begin_s, begin_s);
    return StepClear(leg);
  });
}

std::optional<AxisPaths> TimeSearch::EndFrom(std::int32_t index) const {
  const Node& node = nodes_[static_cast<std::size_t>(index)];
  const Pose pose = PoseOf(node.pose);
  const std::int32_t last =
      safe_[static_cast<std::size_t>(node.pose)][static_cast<std::size_t>(node.interval)].last;
  // The unit leaves as soon as the target is free, or some steps later.
  constexpr std::int32_t kTries = 3;
  for (std::int32_t k = 0; k < kTries; ++k) {
    const std::int32_t leaves = std::max(node.step, target_safe_ - 1) + 2 * k;
    if (leaves > last || leaves >= steps_max_) break;
    if (EndsClear(pose, leaves)) return LayOut(index, leaves);
  }
  return std::nullopt;
}

void TimeSearch::Reach(const Node& node) {
  Interval& interval =
      safe_[static_cast<std::size_t>(node.pose)][static_cast<std::size_t>(node.interval)];
  if (interval.node >= 0 && nodes_[static_cast<std::size_t>(interval.node)].step <= node.step)
    return;
  if (interval.node >= 0) nodes_[static_cast<std::size_t>(interval.node)].done = true;
  interval.node = static_cast<std::int32_t>(nodes_.size());
  nodes_.push_back(node);
  const std::int32_t left = StepsLeft(PoseOf(node.pose));
  open_.push_back({std::max(node.step + left, target_safe_), left, interval.node});
  std::push_heap(open_.begin(), open_.end());
}

void TimeSearch::Expand(std::int32_t index) {
  const Node node = nodes_[static_cast<std::size_t>(index)];
  const Pose pose = PoseOf(node.pose);
  const std::int32_t stays =
      safe_[static_cast<std::size_t>(node.pose)][static_cast<std::size_t>(node.interval)].last;
  const std::int32_t a = node.pose / count_[1];
  const std::int32_t b = node.pose % count_[1];
  for (std::int32_t da = -1; da <= 1; ++da) {
    for (std::int32_t db = -1; db <= 1; ++db) {
      if ((da == 0 && db == 0) || a + da < 0 || a + da >= count_[0] || b + db < 0 ||
          b + db >= count_[1])
        continue;
      const std::int32_t there = (a + da) * count_[1] + b + db;
      const Pose to = PoseOf(there);
      const std::vector<Interval>& intervals = SafeAt(there);
      for (std::size_t n = 0; n < intervals.size(); ++n) {
        const Interval interval = intervals[n];
        // The unit leaves as soon as the other pose may be held at the end of the step. Where a
        // neighbour passes just then it leaves a little later.
        const std::int32_t soonest = std::max(node.step, interval.first - 1);
        const std::int32_t latest = std::min({stays, interval.last - 1, steps_max_ - 1});
        constexpr std::int32_t kTries = 4;
        for (std::int32_t leaves = soonest; leaves <= std::min(latest, soonest + kTries - 1);
             ++leaves) {
          if (interval.node >= 0 &&
              nodes_[static_cast<std::size_t>(interval.node)].step <= leaves + 1)
            break;
          if (leaves + 1 + StepsLeft(to) > steps_max_) break;
          if (!StepClear(LegOf(pose, to, leaves))) continue;
          Reach({index,
                 there,
                 static_cast<std::int32_t>(n),
                 leaves + 1,
                 {static_cast<std::int8_t>(da), static_cast<std::int8_t>(db)},
                 false});
          break;
        }
      }
    }
  }
}

std::optional<AxisPaths> TimeSearch::Find(const Question& question) {
  q_ = question;
  if (!SetUp()) return std::nullopt;
  const std::int32_t start = -low_[0] * count_[1] - low_[1];
  const std::vector<Interval>& here = SafeAt(start);
  if (here.empty() || here.front().first > 0) return std::nullopt;
  Reach({-1, start, 0, 0, {0, 0}, false});
  std::uint32_t expansions = 0;
  while (!open_.empty() && ++expansions <= q_.expansions_max) {
    std::pop_heap(open_.begin(), open_.end());
    const Open next = open_.back();
    open_.pop_back();
    Node& node = nodes_[static_cast<std::size_t>(next.node)];
    if (node.done) continue;
    node.done = true;
    if (next.left <= 1)
      if (auto paths = EndFrom(next.node)) return paths;
    Expand(next.node);
  }
  return std::nullopt;
}

}  // namespace focalfleet
