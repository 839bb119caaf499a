#include "fleet/plan/joint_search.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>

namespace focalfleet {
namespace {

/// Between two looks within a step arms are nearer than at either by less than this.
constexpr double kJointMarginMm = 0.03;
constexpr int kGrowSteps = 12;  // of one branch
constexpr int kNearTarget = 4;  // one sample in so many is the root of the other tree

bool IsWithin(const SegmentFp& a, const SegmentFp& b, double distance_mm) {
  return SquaredDistance(a, b) <= distance_mm * distance_mm;
}

}  // namespace

/// The arm at the begin of the step, in its middle and at its end. No point of it is farther than
/// `sweep_mm` from the line in the middle, because both ends of a line bound what lies between.
struct JointSearch::Swept {
  std::array<SegmentFp, 3> lines;
  double sweep_mm = 0;

  Swept() = default;
  Swept(const ArmGeometry& arm, const Pose& from, const Pose& to)
      : lines{arm.At(from), arm.At({(from[0] + to[0]) / 2, (from[1] + to[1]) / 2}), arm.At(to)} {
    constexpr double kGuardMm = 1e-5;  // ten times what the distance of two segments may be off
    for (const SegmentFp& line : {lines[0], lines[2]})
      sweep_mm =
          std::max({sweep_mm, DistanceMm(line.a, lines[1].a), DistanceMm(line.b, lines[1].b)});
    sweep_mm += kGuardMm;
  }
};

std::int32_t JointSearch::StepsOf(std::size_t m, const Poses& a, const Poses& b) const {
  std::int32_t most = 0;
  for (std::size_t k = 0; k < kAxisCount; ++k)
    most = std::max(most, (std::abs(b[m][k] - a[m][k]) + step_[m][k] - 1) / step_[m][k]);
  return most;
}

std::int32_t JointSearch::StepsBetween(const Poses& a, const Poses& b) const {
  std::int32_t most = 0;
  for (std::size_t m = 0; m < size(); ++m) most = std::max(most, StepsOf(m, a, b));
  return most;
}

/// A step of time on, each axis at its speed until it is there.
JointSearch::Poses JointSearch::Towards(const Poses& from, const Poses& to) const {
  Poses next = from;
  for (std::size_t m = 0; m < size(); ++m)
    for (std::size_t k = 0; k < kAxisCount; ++k)
      next[m][k] += std::clamp(to[m][k] - from[m][k], -step_[m][k], step_[m][k]);
  return next;
}

/// The begin of the step was looked at as the end of the one before.
bool JointSearch::StandsClear(std::size_t m, const Swept& arm) const {
  for (const Bundle& bundle : bundles_[m]) {
    const Capsule& around = bundle.around;
    if (!IsWithin(arm.lines[1], around.line, around.radius_mm + arm.sweep_mm)) continue;
    for (std::uint32_t k = bundle.begin; k < bundle.end; ++k) {
      const StandingThing& thing = q_.members[m].standing[k];
      const double need_mm = thing.need_mm + thing.capsule.radius_mm;
      if (IsWithin(arm.lines[2], thing.capsule.line, need_mm) ||
          IsWithin(arm.lines[1], thing.capsule.line, need_mm))
        return false;
    }
  }
  return true;
}

/// Each member may be at the begin of the step, in its middle or at its end while another is at any
/// of these: a start skew is less than a step.
bool JointSearch::StepClear(const Poses& from, const Poses& to) {
  ++work_;
  std::array<Swept, kMembersMax> arms;
  for (std::size_t m = 0; m < size(); ++m) {
    arms[m] = Swept(*q_.members[m].arm, from[m], to[m]);
    if (!StandsClear(m, arms[m])) return false;
    for (std::size_t other = 0; other < m; ++other) {
      const double need_mm = apart_mm_[other][m];
      if (!IsWithin(arms[other].lines[1], arms[m].lines[1],
                    need_mm + arms[other].sweep_mm + arms[m].sweep_mm))
        continue;
      for (const SegmentFp& a : arms[other].lines)
        for (const SegmentFp& b : arms[m].lines)
          if (IsWithin(a, b, need_mm)) return false;
    }
  }
  return true;
}

JointSearch::Poses JointSearch::Draw(Rng* rng) const {
  Poses drawn{};
  for (std::size_t m = 0; m < size(); ++m) {
    const PoseBox& box = q_.members[m].within;
    for (std::size_t k = 0; k < kAxisCount; ++k)
      drawn[m][k] = box.low[k] + static_cast<std::int32_t>(rng->Below(
                                     static_cast<std::uint64_t>(box.high[k] - box.low[k]) + 1));
  }
  return drawn;
}

std::int32_t JointSearch::Nearest(const Tree& tree, const Poses& to) const {
  std::int32_t nearest = 0;
  std::int32_t least = std::numeric_limits<std::int32_t>::max();
  for (std::size_t n = 0; n < tree.size(); ++n) {
    const std::int32_t steps = StepsBetween(tree[n].at, to);
    if (steps >= least) continue;
    least = steps;
    nearest = static_cast<std::int32_t>(n);
  }
  return nearest;
}

/// A branch from a node, as far as it is clear. Returns its last node.
std::int32_t JointSearch::Grow(Tree* tree, std::int32_t from, const Poses& to, int steps_most) {
  for (int n = 0; n < steps_most; ++n) {
    const Poses here = (*tree)[static_cast<std::size_t>(from)].at;
    const Poses next = Towards(here, to);
    if (next == here || !StepClear(here, next)) break;
    tree->push_back({next, from});
    from = static_cast<std::int32_t>(tree->size()) - 1;
  }
  return from;
}

bool JointSearch::Connect(Rng* rng) {
  forward_.clear();
  backward_.clear();
  Node start;
  Node target;
  for (std::size_t m = 0; m < size(); ++m) {
    start.at[m] = q_.members[m].from;
    target.at[m] = q_.members[m].to;
  }
  forward_.push_back(start);
  backward_.push_back(target);
  Tree* grows = &forward_;
  Tree* waits = &backward_;
  constexpr int kAll = 1 << 20;
  for (int n = 0; n < q_.grow_most; ++n) {
    const Poses aim = n == 0 || rng->Below(kNearTarget) == 0 ? waits->front().at : Draw(rng);
    const std::int32_t tip = Grow(grows, Nearest(*grows, aim), aim, n == 0 ? kAll : kGrowSteps);
    const Poses at = (*grows)[static_cast<std::size_t>(tip)].at;
    const std::int32_t other = Grow(waits, Nearest(*waits, at), at, kAll);
    if ((*waits)[static_cast<std::size_t>(other)].at == at) {
      const bool is_forward = grows == &forward_;
      way_.clear();
      for (std::int32_t k = is_forward ? tip : other; k >= 0;
           k = forward_[static_cast<std::size_t>(k)].came_from)
        way_.push_back(forward_[static_cast<std::size_t>(k)].at);
      std::reverse(way_.begin(), way_.end());
      const std::int32_t back = is_forward ? other : tip;
      for (std::int32_t k = backward_[static_cast<std::size_t>(back)].came_from; k >= 0;
           k = backward_[static_cast<std::size_t>(k)].came_from)
        way_.push_back(backward_[static_cast<std::size_t>(k)].at);
      return true;
    }
    std::swap(grows, waits);
  }
  return false;
}

/// The steps from one to the other, the last included. False: they are not clear.
bool JointSearch::Stretch(const Poses& from, const Poses& to, Shape shape,
                          std::vector<Poses>* out) {
  out->clear();
  const std::int32_t steps = StepsBetween(from, to);
  Poses here = from;
  for (std::int32_t n = 0; n < 2 * steps; ++n) {
    Poses next = here;
    if (shape == Shape::kEarly) {
      next = Towards(here, to);
    } else if (shape == Shape::kLate) {
      // The same backwards in time from the target.
      for (std::size_t m = 0; m < size(); ++m)
        for (std::size_t k = 0; k < kAxisCount; ++k) {
          const std::int64_t most = static_cast<std::int64_t>(step_[m][k]) * (steps - 1 - n);
          const std::int64_t left = std::min<std::int64_t>(std::abs(to[m][k] - from[m][k]), most);
          next[m][k] = to[m][k] + static_cast<std::int32_t>(from[m][k] < to[m][k] ? -left : left);
        }
    } else {
      const std::size_t leads = shape == Shape::kFirstFirst ? 0 : size() - 1;
      const bool lead_done = here[leads] == to[leads];
      const Poses all = Towards(here, to);
      for (std::size_t m = 0; m < size(); ++m)
        if ((m == leads) != lead_done) next[m] = all[m];
    }
    if (next == here) {
      if (here == to) return true;
    } else if (!StepClear(here, next)) {
      return false;
    }
    out->push_back(next);
    here = next;
    if (here == to) return true;
  }
  return here == to;
}

void JointSearch::Shorten(Rng* rng) {
  for (int n = 0; n < q_.shorten && way_.size() > 2; ++n) {
    std::size_t i = rng->Below(way_.size() - 1);
    std::size_t j = i + 1 + rng->Below(way_.size() - 1 - i);
    if (n == 0) i = 0, j = way_.size() - 1;
    if (j < i + 2) continue;
    const auto shape = static_cast<Shape>(rng->Below(4));
    if (StepsBetween(way_[i], way_[j]) > static_cast<std::int32_t>(j - i)) continue;
    if (!Stretch(way_[i], way_[j], shape, &stretch_) || stretch_.size() > j - i) continue;
    way_.erase(way_.begin() + static_cast<std::ptrdiff_t>(i) + 1,
               way_.begin() + static_cast<std::ptrdiff_t>(j) + 1);
    way_.insert(way_.begin() + static_cast<std::ptrdiff_t>(i) + 1, stretch_.begin(),
                stretch_.end());
  }
}

/// Among all ways to wait before any of the steps: the one that meets others least, and of these
/// one with the fewest pauses.
std::optional<JointSearch::Found> JointSearch::LayOut() const {
  const std::size_t words = q_.steps.words();
  const std::size_t corners = way_.size();
  const std::size_t span = static_cast<std::size_t>(q_.end_step);
  if (corners > span + 1) return std::nullopt;
  const std::size_t row = span + 1;
  std::vector<std::uint8_t> meets(corners * row, 0);
  for (std::size_t c = 0; c < corners; ++c)
    for (std::size_t m = 0; m < size(); ++m) {
      const Member& member = q_.members[m];
      if (member.around == nullptr) continue;
      std::array<std::uint64_t, kStepWordsMost> bits{};
      RasterBitsAt(member.arm->At(way_[c][m]), *member.around, {words, words}, bits.data());
      for (std::size_t s = 0; s < row; ++s)
        if ((bits[s / 64] >> (s % 64) & 1) != 0) ++meets[c * row + s];
    }
  constexpr std::int32_t kMeet = 1000;
  constexpr std::int32_t kNone = std::numeric_limits<std::int32_t>::max() / 2;
  const auto met = [&](std::size_t c, std::size_t s) { return meets[c * row + s] * kMeet; };
  struct State {
    std::array<std::int32_t, 2> least{kNone, kNone};  // 1: it has moved in the step before
    std::array<std::int8_t, 2> came{};
  };
  std::vector<State> states(corners * row);
  states[0].least[0] = 0;
  for (std::size_t c = 0; c < corners; ++c)
    for (std::size_t s = 0; s < span; ++s)
      for (std::size_t moved = 0; moved < 2; ++moved) {
        const std::int32_t here = states[c * row + s].least[moved];
        if (here >= kNone) continue;
        const auto relax = [&](std::size_t to, std::size_t did, std::int32_t cost) {
          if (cost >= states[to].least[did]) return;
          states[to].least[did] = cost;
          states[to].came[did] = static_cast<std::int8_t>(moved);
        };
        relax(c * row + s + 1, 0, here + met(c, s));
        if (c + 1 < corners && (q_.rests.empty() || q_.rests[s] == 0))
          relax((c + 1) * row + s + 1, 1,
                here + std::max(met(c, s), met(c + 1, s)) + (moved == 0 ? 1 : 0));
      }
  const State& end = states[(corners - 1) * row + span];
  std::size_t moved = end.least[0] <= end.least[1] ? 0 : 1;
  if (end.least[moved] >= kNone) return std::nullopt;
  Found found;
  found.meets = end.least[moved] / kMeet;
  found.steps = static_cast<std::int32_t>(corners) - 1;
  std::vector<std::int32_t> leaves(corners, 0);
  for (std::size_t c = corners - 1, s = span; s > 0; --s) {
    const auto before = static_cast<std::size_t>(states[c * row + s].came[moved]);
    if (moved == 1) leaves[--c] = static_cast<std::int32_t>(s) - 1;
    moved = before;
  }
  for (std::size_t m = 0; m < size(); ++m) {
    StepPaths paths(*q_.members[m].drive, q_.steps);
    for (std::size_t c = 0; c + 1 < corners; ++c)
      paths.Turn(leaves[c], {way_[c + 1][m][0] - way_[c][m][0], way_[c + 1][m][1] - way_[c][m][1]});
    const std::optional<AxisPaths> made = paths.Take();
    if (!made) return std::nullopt;
    found.paths[m] = *made;
  }
  return found;
}

std::optional<JointSearch::Found> JointSearch::Find(const Question& question, Rng* rng) {
  q_ = question;
  for (std::size_t m = 0; m < size(); ++m)
    for (std::size_t k = 0; k < kAxisCount; ++k)
      step_[m][k] = std::max(
          1, static_cast<std::int32_t>(
                 q_.steps.step_s() / SecondsPerVector(q_.members[m].drive->axis[k]) + 1e-6));
  for (std::size_t m = 0; m < size(); ++m) {
    for (std::size_t other = 0; other < m; ++other) {
      const Member& a = q_.members[other];
      const Member& b = q_.members[m];
      const double least = std::min(DistanceMm(a.arm->At(a.from), b.arm->At(b.from)),
                                    DistanceMm(a.arm->At(a.to), b.arm->At(b.to)));
      const double need = q_.need_mm[other][m];
      apart_mm_[other][m] = need + std::clamp((least - need) / 2, 0.0, kJointMarginMm);
    }
    BundleUp(q_.members[m].standing, &bundles_[m]);
  }
  if (!Connect(rng)) return std::nullopt;
  Shorten(rng);
  return LayOut();
}

}  // namespace focalfleet
