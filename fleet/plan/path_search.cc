#include "fleet/plan/path_search.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <numbers>

namespace focalfleet {
namespace {

constexpr double kSweepGuardMm = 1e-6;  // covers rounding

}  // namespace

bool SweepClear(const ArmGeometry& arm, const Sweep& sweep, std::span<const Blocker> blockers,
                std::uint32_t* by, int budget) {
  // Most blockers are too far away for any pose of the sweep; one distance says so.
  const auto middle = [&](std::size_t k) {
    return (static_cast<double>(sweep.from[k]) + sweep.to[k]) / 2;
  };
  const SegmentFp line = arm.AtAngles(arm.Theta(0) + middle(0) * arm.step_rad(Axis::kTheta),
                                      arm.Fold(0) + middle(1) * arm.step_rad(Axis::kPhi));
  const double travel_mm = arm.TravelBound(std::abs(sweep.to[0] - sweep.from[0]) / 2.0,
                                           std::abs(sweep.to[1] - sweep.from[1]) / 2.0);
  for (const Blocker& blocker : blockers) {
    const double far_mm = blocker.need_mm + blocker.capsule.radius_mm + travel_mm + kSweepGuardMm;
    if (SquaredDistance(line, blocker.capsule.line) > far_mm * far_mm) continue;
    if (SweepClearOf(arm, sweep, blocker.capsule, blocker.need_mm, budget)) continue;
    if (by != nullptr) *by = blocker.by;
    return false;
  }
  return true;
}

std::optional<InStep> KeepInStep(const Pose& from, const Pose& to, const UnitDrive& drive) {
  InStep step;
  std::array<double, kAxisCount> lasts_s{};
  std::array<double, kAxisCount> vectors{};
  for (std::size_t k = 0; k < kAxisCount; ++k) {
    vectors[k] = std::abs(to[k] - from[k]);
    if (vectors[k] == 0) return std::nullopt;
    step.repeat[k] = drive.axis[k].repeat;
    lasts_s[k] = vectors[k] * SecondsPerVector(drive.axis[k]);
  }
  const std::size_t quick = lasts_s[0] < lasts_s[1] ? 0 : 1;
  const double stretch = lasts_s[1 - quick] / lasts_s[quick];
  const double repeat = std::round(drive.axis[quick].repeat * stretch);
  if (repeat > std::numeric_limits<std::uint8_t>::max()) return std::nullopt;
  step.repeat[quick] = static_cast<std::uint8_t>(repeat);
  const double together = repeat / drive.axis[quick].repeat / stretch;
  // The last two terms are one vector of either axis: within a vector the growth of the angle is
  // not known.
  step.out_of_step = std::abs(1 - together) + 1 / vectors[0] + 1 / vectors[1];
  return step;
}

PoseBox RangeAround(const ArmGeometry& arm, const Pose& pose) {
  PoseBox box = arm.range();
  for (std::size_t k = 0; k < kAxisCount; ++k) {
    box.low[k] = std::min(box.low[k], pose[k]);
    box.high[k] = std::max(box.high[k], pose[k]);
  }
  return box;
}

void PathSearch::SetUp(const Question& question) {
  q_ = question;
  const double grid_rad = q_.grid_deg * std::numbers::pi / 180;
  for (const Axis axis : kAxes) {
    const std::size_t k = Index(axis);
    step_[k] =
        std::max(1, static_cast<std::int32_t>(std::lround(grid_rad / q_.arm->step_rad(axis))));
    // The grid's origin is the start itself, so that the first node is exact.
    low_[k] = -((q_.from[k] - q_.within.low[k]) / step_[k]);
    count_[k] = (q_.within.high[k] - q_.from[k]) / step_[k] - low_[k] + 1;
  }
  nodes_.assign(static_cast<std::size_t>(count_[0]) * static_cast<std::size_t>(count_[1]), Node{});
  open_.clear();
  BundleUp(q_.blockers, &bundles_);
  last_nearest_ = 0;
}

Pose PathSearch::PoseOf(std::int32_t node) const {
  const std::int32_t a = node / count_[1] + low_[0];
  const std::int32_t b = node % count_[1] + low_[1];
  return {q_.from[0] + a * step_[0], q_.from[1] + b * step_[1]};
}

double PathSearch::ExactClearance(std::int32_t index) {
  Node& node = nodes_[static_cast<std::size_t>(index)];
  if (node.exact) return static_cast<double>(node.clearance);
  const SegmentFp line = q_.arm->At(PoseOf(index));
  const auto clearance = [&](const Blocker& b) {
    return DistanceMm(line, b.capsule.line) - b.capsule.radius_mm - b.need_mm;
  };
  double least = static_cast<double>(std::numeric_limits<float>::max());
  if (last_nearest_ < q_.blockers.size()) least = clearance(q_.blockers[last_nearest_]);
  for (const Bundle& bundle : bundles_) {
    if (bundle.has_several() &&
        DistanceMm(line, bundle.around.line) - bundle.around.radius_mm >= least)
      continue;
    // Only "not clear" matters where the least is not above 0.
    for (std::size_t k = bundle.begin; k < bundle.end && least > 0; ++k) {
      const double here = clearance(q_.blockers[k]);
      if (here >= least) continue;
      least = here;
      last_nearest_ = k;
    }
  }
  // Rounded down: a clearance must never be overstated.
  node.clearance = std::nextafter(static_cast<float>(least), -1e30f);
  node.exact = true;
  return static_cast<double>(node.clearance);
}

/// Every pose of the edge is within its travel of both ends. The edge is therefore clear where the
/// clearances of its ends sum up to more than the travel. An end's clearance is at least that of
/// the other less the travel.
bool PathSearch::EdgeClear(std::int32_t a, std::int32_t b) {
  const Pose pa = PoseOf(a);
  const Pose pb = PoseOf(b);
  const double travel = q_.arm->TravelBound(std::abs(pa[0] - pb[0]), std::abs(pa[1] - pb[1]));
  Node& there = nodes_[static_cast<std::size_t>(b)];
  double here_mm = static_cast<double>(nodes_[static_cast<std::size_t>(a)].clearance);
  if (here_mm <= travel) here_mm = ExactClearance(a);
  if (here_mm <= 0) return false;
  if (here_mm > travel) {
    const auto left = std::nextafter(static_cast<float>(here_mm - travel), -1e30f);
    if (!there.exact) there.clearance = std::max(there.clearance, left);
    return !there.exact || there.clearance > 0;
  }
  const double there_mm = ExactClearance(b);
  if (there_mm <= 0) return false;
  if (here_mm + there_mm > travel) return true;
  return SweepClear(*q_.arm, {pa, pb}, q_.blockers, nullptr, 300);
}

std::int64_t PathSearch::Estimate(const Pose& pose) const {
  std::int64_t farthest = 0;
  if (!q_.goal) return farthest;
  for (std::size_t k = 0; k < kAxisCount; ++k) {
    const std::int32_t below = q_.goal->low[k] - pose[k];
    const std::int32_t above = pose[k] - q_.goal->high[k];
    farthest = std::max<std::int64_t>({farthest, below, above});
  }
  return farthest;
}

void PathSearch::Expand(std::int32_t node) {
  const std::int32_t a = node / count_[1];
  const std::int32_t b = node % count_[1];
  for (std::int32_t da = -1; da <= 1; ++da) {
    for (std::int32_t db = -1; db <= 1; ++db) {
      if ((da == 0 && db == 0) || a + da < 0 || a + da >= count_[0] || b + db < 0 ||
          b + db >= count_[1])
        continue;
      const std::int32_t next = node + da * count_[1] + db;
      Node& there = nodes_[static_cast<std::size_t>(next)];
      if (there.done) continue;
      const std::int32_t cost = nodes_[static_cast<std::size_t>(node)].cost +
                                std::max(std::abs(da) * step_[0], std::abs(db) * step_[1]);
      if (there.cost >= 0 && there.cost <= cost) continue;
      if (!EdgeClear(node, next)) continue;
      there.cost = cost;
      there.came_from = node;
      open_.push_back({cost + Estimate(PoseOf(next)), next});
      std::push_heap(open_.begin(), open_.end());
    }
  }
}

/// The nearest pose of the goal, where it is not more than a grid step away and the way there is
/// clear.
std::optional<Pose> PathSearch::EndNear(const Pose& pose) const {
  if (!q_.goal) return std::nullopt;
  Pose end = pose;
  for (std::size_t k = 0; k < kAxisCount; ++k) {
    end[k] = std::clamp(pose[k], q_.goal->low[k], q_.goal->high[k]);
    if (std::abs(end[k] - pose[k]) > step_[k]) return std::nullopt;
  }
  if (!SweepClear(*q_.arm, {pose, end}, q_.blockers, nullptr)) return std::nullopt;
  return end;
}

Way PathSearch::Find(const Question& question) {
  reached_.clear();
  reached_nodes_.clear();
  if (IsAbandoned(abandoned_)) return {};
  SetUp(question);
  const std::int32_t start = -low_[0] * count_[1] - low_[1];
  if (ExactClearance(start) <= 0) return {};
  nodes_[static_cast<std::size_t>(start)].cost = 0;
  open_.push_back({Estimate(q_.from), start});
  while (!open_.empty()) {
    std::pop_heap(open_.begin(), open_.end());
    const std::int32_t node = open_.back().node;
    open_.pop_back();
    Node& here = nodes_[static_cast<std::size_t>(node)];
    if (here.done) continue;
    here.done = true;
    const Pose pose = PoseOf(node);
    reached_.push_back(pose);
    reached_nodes_.push_back(node);
    if (const std::optional<Pose> end = EndNear(pose)) {
      std::vector<Pose> way = Trace(node);
      if (way.back() != *end) way.push_back(*end);
      return Shorten(way);
    }
    Expand(node);
  }
  return {};
}

Way PathSearch::WayTo(std::size_t reached_index) const {
  return Shorten(Trace(reached_nodes_[reached_index]));
}

std::vector<Pose> PathSearch::Trace(std::int32_t node) const {
  std::vector<Pose> way;
  for (; node >= 0; node = nodes_[static_cast<std::size_t>(node)].came_from)
    way.push_back(PoseOf(node));
  std::reverse(way.begin(), way.end());
  return way;
}

/// The leg from one corner to another, in the manner that is clear. Empty: neither manner is.
std::optional<Waypoint> PathSearch::Leg(const Pose& from, const Pose& to) const {
  constexpr int kBudget = 400;
  if (SweepClear(*q_.arm, {from, to}, q_.blockers, nullptr, kBudget)) return Waypoint{to};
  const std::optional<InStep> step = KeepInStep(from, to, *q_.drive);
  if (!step || step->out_of_step >= 1) return std::nullopt;
  const Sweep band{from, to, step->out_of_step};
  if (!SweepClear(*q_.arm, band, q_.blockers, nullptr, kBudget)) return std::nullopt;
  return Waypoint{to, step->out_of_step};
}

/// Each leg goes as far along the way as it can. Where that leaves many corners, the result is the
/// least number of legs with corners on the way.
Way PathSearch::Shorten(const std::vector<Pose>& way) const {
  constexpr std::size_t kManyCorners = 6;
  Way corners{{way.front()}};
  std::size_t at = 0;
  while (at + 1 < way.size()) {
    std::size_t next = way.size() - 1;
    std::optional<Waypoint> leg = Leg(way[at], way[next]);
    while (!leg && next > at + 1) leg = Leg(way[at], way[--next]);
    // Neighbours on the grid are clear of each other already.
    corners.push_back(leg ? *leg : Waypoint{way[next]});
    at = next;
  }
  return corners.size() > kManyCorners ? WithFewestCorners(way) : corners;
}

Way PathSearch::WithFewestCorners(const std::vector<Pose>& way) const {
  struct Corner {
    std::size_t came_from = 0;
    Waypoint at;
    bool seen = false;
  };
  std::vector<Corner> corners(way.size());
  corners[0] = {0, {way.front()}, true};
  std::vector<std::size_t> layer{0};
  while (!corners.back().seen) {
    std::vector<std::size_t> next_layer;
    for (const std::size_t from : layer) {
      for (std::size_t to = way.size() - 1; to > from && !corners.back().seen; --to) {
        if (corners[to].seen) continue;
        std::optional<Waypoint> leg = Leg(way[from], way[to]);
        if (!leg && to == from + 1) leg = Waypoint{way[to]};
        if (!leg) continue;
        corners[to] = {from, *leg, true};
        next_layer.push_back(to);
      }
    }
    layer = std::move(next_layer);
  }
  Way found;
  for (std::size_t at = way.size() - 1;; at = corners[at].came_from) {
    found.push_back(corners[at].at);
    if (at == 0) break;
  }
  std::reverse(found.begin(), found.end());
  return found;
}

}  // namespace focalfleet
