#include "fleet/plan/time_search.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numbers>

namespace focalfleet {
namespace {

constexpr double kTickS = 1e-4;

}  // namespace

void TimeSearch::SetUp() {
  // As long as the slower axis needs for the grid; the quicker one gets farther in it.
  double step_s = 0;
  for (const Axis axis : kAxes) {
    const std::size_t k = Index(axis);
    const double vectors = q_.grid_deg * std::numbers::pi / 180 / q_.arm->step_rad(axis);
    step_s = std::max(step_s, vectors * SecondsPerVector(q_.drive->axis[k]));
  }
  // A whole number of ticks and, for the slower axis, of vectors.
  step_ticks_ = std::max<std::int64_t>(1, std::llround(step_s / kTickS / 60) * 60);
  for (std::size_t k = 0; k < kAxisCount; ++k)
    step_[k] = std::max(1, static_cast<std::int32_t>(static_cast<double>(step_ticks_) * kTickS /
                                                         SecondsPerVector(q_.drive->axis[k]) +
                                                     1e-6));
  nodes_.clear();
  open_.clear();
}

Pose TimeSearch::PoseOf(const Node& node) const {
  return {q_.from[0] + node.theta * step_[0], q_.from[1] + node.phi * step_[1]};
}

Leg TimeSearch::LegOf(const Pose& from, const Pose& to, double begin_s, double end_s) const {
  Leg leg;
  leg.begin_s = begin_s;
  leg.end_s = end_s;
  leg.theta_rad = q_.arm->Theta(from[0]);
  leg.fold_rad = q_.arm->Fold(from[1]);
  leg.theta_rad_per_s = (q_.arm->Theta(to[0]) - leg.theta_rad) / (end_s - begin_s);
  leg.fold_rad_per_s = (q_.arm->Fold(to[1]) - leg.fold_rad) / (end_s - begin_s);
  leg.speed_mm_per_s =
      (q_.arm->theta_arm_mm() + q_.arm->phi_arm_mm()) * std::abs(leg.theta_rad_per_s) +
      q_.arm->phi_arm_mm() * std::abs(leg.fold_rad_per_s);
  return leg;
}

bool TimeSearch::StepClear(const Leg& leg) const {
  const SegmentFp middle = ArmAt(*q_.arm, leg, (leg.begin_s + leg.end_s) / 2);
  const double travel = leg.speed_mm_per_s * (leg.end_s - leg.begin_s) / 2;
  for (const Passer& passer : q_.passers) {
    const double far = passer.need_mm + travel + passer.track->reach_mm();
    if (SquaredDistance(passer.arm->base_fp(), middle) > far * far) continue;
    if (!LegPassesClear(*q_.arm, leg, *passer.arm, *passer.track, passer.need_mm, passer.tolerance))
      return false;
  }
  for (const Blocker& blocker : q_.standing) {
    const double far = blocker.need_mm + travel + blocker.capsule.radius_mm;
    if (SquaredDistance(blocker.capsule.line, middle) > far * far) continue;
    if (!LegPassesClearOf(*q_.arm, leg, blocker.capsule, blocker.need_mm)) return false;
  }
  return true;
}

std::int32_t TimeSearch::StepsLeft(const Pose& pose) const {
  std::int32_t left = 0;
  for (std::size_t k = 0; k < kAxisCount; ++k)
    left = std::max(left, (std::abs(q_.to[k] - pose[k]) + step_[k] - 1) / step_[k]);
  return left;
}

std::optional<AxisPaths> TimeSearch::LayOut(std::int32_t last) const {
  std::vector<Node> way;
  for (std::int32_t node = last; node >= 0; node = nodes_[static_cast<std::size_t>(node)].came_from)
    way.push_back(nodes_[static_cast<std::size_t>(node)]);
  std::reverse(way.begin(), way.end());
  AxisPaths paths;
  const auto begin_ticks = static_cast<std::int64_t>(std::ceil(q_.begin_s / kTickS));
  for (std::size_t k = 0; k < kAxisCount; ++k) {
    std::int8_t turning = 0;
    std::int64_t since = 0;
    const auto close = [&](std::int64_t step) {
      if (turning == 0) return true;
      if (paths[k].full()) return false;
      paths[k].Append({static_cast<std::uint32_t>(begin_ticks + since * step_ticks_),
                       static_cast<std::int32_t>(step - since) * step_[k] * turning,
                       q_.drive->axis[k].repeat});
      return true;
    };
    for (std::size_t n = 1; n < way.size(); ++n) {
      if (way[n].turned[k] == turning) continue;
      if (!close(way[n].step - 1)) return std::nullopt;
      turning = way[n].turned[k];
      since = way[n].step - 1;
    }
    const std::int64_t end = way.back().step;
    const std::int32_t rest = q_.to[k] - PoseOf(way.back())[k];
    const bool goes_on = rest != 0 && turning != 0 && (rest > 0) == (turning > 0);
    if (goes_on) {
      if (paths[k].full()) return std::nullopt;
      paths[k].Append({static_cast<std::uint32_t>(begin_ticks + since * step_ticks_),
                       static_cast<std::int32_t>(end - since) * step_[k] * turning + rest,
                       q_.drive->axis[k].repeat});
      continue;
    }
    if (!close(end)) return std::nullopt;
    if (rest == 0) continue;
    if (paths[k].full()) return std::nullopt;
    paths[k].Append({static_cast<std::uint32_t>(begin_ticks + end * step_ticks_), rest,
                     q_.drive->axis[k].repeat});
  }
  return paths;
}

/// From here the rest of less than a step is clear, and so is the target ever after.
bool TimeSearch::EndsAt(const Node& node) const {
  const Pose pose = PoseOf(node);
  const double step_s = static_cast<double>(step_ticks_) * kTickS;
  const double begin_s = q_.begin_s + node.step * step_s;
  AxisPaths paths;
  for (std::size_t k = 0; k < kAxisCount; ++k)
    if (q_.to[k] != pose[k])
      paths[k].Append({static_cast<std::uint32_t>(std::ceil(begin_s / kTickS)), q_.to[k] - pose[k],
                       q_.drive->axis[k].repeat});
  const Track rest(*q_.arm, *q_.drive, pose, paths);
  return std::all_of(rest.legs().begin(), rest.legs().end(), [&](Leg leg) {
    leg.begin_s = std::max(leg.begin_s, begin_s);
    return StepClear(leg);
  });
}

std::optional<AxisPaths> TimeSearch::Find(const Question& question) {
  q_ = question;
  SetUp();
  const double step_s = static_cast<double>(step_ticks_) * kTickS;
  const auto steps_max = static_cast<std::int32_t>((q_.end_s - q_.begin_s) / step_s);
  std::array<std::int32_t, kAxisCount> low{};
  std::array<std::int32_t, kAxisCount> count{};
  for (std::size_t k = 0; k < kAxisCount; ++k) {
    low[k] = -((q_.from[k] - q_.within.low[k]) / step_[k]);
    count[k] = (q_.within.high[k] - q_.from[k]) / step_[k] - low[k] + 1;
  }
  if (steps_max <= 0) return std::nullopt;
  seen_.assign(static_cast<std::size_t>(count[0]) * static_cast<std::size_t>(count[1]) *
                   static_cast<std::size_t>(steps_max + 1),
               0);
  // The target is safe for good from this step on.
  std::int32_t safe = steps_max + 1;
  const Leg at_target = LegOf(q_.to, q_.to, 0, 1);
  for (std::int32_t step = steps_max; step >= 0; --step) {
    Leg leg = at_target;
    leg.begin_s = q_.begin_s + step * step_s;
    leg.end_s = step == steps_max ? Track::kForever : leg.begin_s + step_s;
    if (!StepClear(leg)) break;
    safe = step;
  }
  if (safe > steps_max) return std::nullopt;
  nodes_.push_back({});
  open_.push_back({std::max(StepsLeft(q_.from), safe), StepsLeft(q_.from), 0});
  std::uint32_t expansions = 0;
  while (!open_.empty() && ++expansions <= q_.expansions_max) {
    std::pop_heap(open_.begin(), open_.end());
    const std::int32_t index = open_.back().node;
    const std::int32_t left = open_.back().left;
    open_.pop_back();
    const Node node = nodes_[static_cast<std::size_t>(index)];
    const Pose pose = PoseOf(node);
    if (left <= 1 && node.step + left >= safe && EndsAt(node)) {
      auto paths = LayOut(index);
      if (paths) return paths;
    }
    if (node.step >= steps_max) continue;
    const double begin_s = q_.begin_s + node.step * step_s;
    for (std::int32_t dt = -1; dt <= 1; ++dt) {
      for (std::int32_t dp = -1; dp <= 1; ++dp) {
        Node next{index,
                  node.theta + dt,
                  node.phi + dp,
                  node.step + 1,
                  {static_cast<std::int8_t>(dt), static_cast<std::int8_t>(dp)}};
        const std::int32_t a = next.theta - low[0];
        const std::int32_t b = next.phi - low[1];
        if (a < 0 || a >= count[0] || b < 0 || b >= count[1]) continue;
        const Pose there = PoseOf(next);
        const std::int32_t there_left = StepsLeft(there);
        if (next.step + there_left > steps_max) continue;
        std::uint8_t& seen =
            seen_[(static_cast<std::size_t>(next.step) * static_cast<std::size_t>(count[0]) +
                   static_cast<std::size_t>(a)) *
                      static_cast<std::size_t>(count[1]) +
                  static_cast<std::size_t>(b)];
        if (seen != 0) continue;
        if (!StepClear(LegOf(pose, there, begin_s, begin_s + step_s))) continue;
        seen = 1;
        nodes_.push_back(next);
        open_.push_back({std::max(next.step + there_left, safe), there_left,
                         static_cast<std::int32_t>(nodes_.size()) - 1});
        std::push_heap(open_.begin(), open_.end());
      }
    }
  }
  return std::nullopt;
}

}  // namespace focalfleet
