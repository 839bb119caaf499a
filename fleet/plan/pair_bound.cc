#include "fleet/plan/pair_bound.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numbers>

namespace focalfleet {
namespace {

constexpr std::uint32_t kExpansionsPerPair = 4000;
constexpr std::uint32_t kExpansionsInAll = 60'000;
constexpr std::int32_t kNotReached = -2;

}  // namespace

PairBound::PairBound(const std::array<Member, 2>& members, double need_mm) : members_(members) {
  // The quickest axis turns by the grid in a step; no other gets farther than its own cell's side.
  step_s_ = 1e9;
  for (const Member& member : members_)
    for (const Axis axis : kAxes)
      step_s_ = std::min(step_s_, kGridDeg * std::numbers::pi / 180 / member.arm->step_rad(axis) *
                                      SecondsPerVector(member.drive->axis[Index(axis)]));
  double travel_mm = 0;
  for (std::size_t m = 0; m < 2; ++m) {
    const Member& member = members_[m];
    std::array<double, kAxisCount> half{};
    for (std::size_t k = 0; k < kAxisCount; ++k) {
      const std::size_t n = 2 * m + k;
      side_[n] = static_cast<std::int32_t>(
          std::ceil(step_s_ / SecondsPerVector(member.drive->axis[k]) - 1e-9));
      half[k] = side_[n] / 2.0;
      // The start is in the middle of a cell. Places outside the range are cells, too.
      const auto cell = [&](std::int32_t vectors) {
        return static_cast<std::int16_t>(
            std::floor((static_cast<double>(vectors) - member.from[k]) / side_[n] + 0.5));
      };
      const PoseBox range = RangeAround(*member.arm, member.from);
      low_[n] = std::min(cell(range.low[k]), cell(member.to[k]));
      high_[n] = std::max(cell(range.high[k]), cell(member.to[k]));
      target_[n] = cell(member.to[k]);
    }
    travel_mm += member.arm->TravelBound(half[0], half[1]);
  }
  closed_mm_ = need_mm - travel_mm;
}

std::int32_t PairBound::StepsLeft(const Cells& at) const {
  std::int32_t left = 0;
  for (std::size_t n = 0; n < 4; ++n) left = std::max(left, std::abs(at[n] - target_[n]));
  return left;
}

Pose PairBound::MiddleOf(const Cells& at, std::size_t member) const {
  Pose pose = members_[member].from;
  for (std::size_t k = 0; k < kAxisCount; ++k)
    pose[k] += at[2 * member + k] * side_[2 * member + k];
  return pose;
}

bool PairBound::IsClosed(const Cells& at) const {
  if (closed_mm_ < 0) return false;
  return SquaredDistance(members_[0].arm->At(MiddleOf(at, 0)),
                         members_[1].arm->At(MiddleOf(at, 1))) < closed_mm_ * closed_mm_;
}

bool PairBound::InRange(const Cells& at) const {
  for (std::size_t n = 0; n < 4; ++n)
    if (at[n] < low_[n] || at[n] > high_[n]) return false;
  return true;
}

std::int32_t* PairBound::SlotOf(const Cells& at) {
  if (2 * used_ >= table_.size()) {
    const auto old = std::move(table_);
    table_.assign(std::max<std::size_t>(4096, 2 * old.size()), {0, -1});
    used_ = 0;
    for (const auto& [key, node] : old) {
      if (node == -1) continue;
      Cells cells{};
      for (std::size_t n = 0; n < 4; ++n)
        cells[n] = static_cast<std::int16_t>(key >> (16 * n) & 0xffff);
      *SlotOf(cells) = node;
    }
  }
  std::uint64_t key = 0;
  for (std::size_t n = 0; n < 4; ++n)
    key |= static_cast<std::uint64_t>(static_cast<std::uint16_t>(at[n])) << (16 * n);
  std::size_t slot = (key * 0x9e3779b97f4a7c15u) >> 30 & (table_.size() - 1);
  while (table_[slot].second != -1 && table_[slot].first != key)
    slot = (slot + 1) & (table_.size() - 1);
  if (table_[slot].second == -1) {
    table_[slot] = {key, kNotReached};
    ++used_;
  }
  return &table_[slot].second;
}

void PairBound::Reach(const Cells& at, std::int32_t steps, std::int32_t steps_most) {
  const std::int32_t left = StepsLeft(at);
  if (steps + left > steps_most) return;
  std::int32_t* slot = SlotOf(at);
  if (*slot != kNotReached) {
    Node& known = nodes_[static_cast<std::size_t>(*slot)];
    if (known.steps <= steps) return;
    known.steps = steps;
  } else {
    if (IsClosed(at)) {
      // A closed cell is never reached: the least number of steps says so.
      *slot = static_cast<std::int32_t>(nodes_.size());
      nodes_.push_back({at, -1});
      return;
    }
    *slot = static_cast<std::int32_t>(nodes_.size());
    nodes_.push_back({at, steps});
  }
  open_.push_back({left, *slot});
  std::push_heap(open_.begin(), open_.end());
}

/// Whether there is a way of at most so many changes of cells. The cell nearest to the target is
/// looked at first, and again whenever it is reached in fewer steps.
PairBound::Answer PairBound::Within(std::int32_t steps_most, std::uint32_t expansions_most) {
  nodes_.clear();
  open_.clear();
  table_.assign(4096, {0, -1});
  used_ = 0;
  Reach({}, 0, steps_most);
  while (!open_.empty()) {
    if (++expansions_ > expansions_most) return Answer::kUnknown;
    std::pop_heap(open_.begin(), open_.end());
    const Node node = nodes_[static_cast<std::size_t>(open_.back().node)];
    open_.pop_back();
    if (node.at == target_) return Answer::kReached;
    for (int move = 0; move < 81; ++move) {
      Cells next = node.at;
      int rest = move;
      for (std::size_t n = 0; n < 4; ++n, rest /= 3)
        next[n] = static_cast<std::int16_t>(next[n] + rest % 3 - 1);
      if (next != node.at && InRange(next)) Reach(next, node.steps + 1, steps_most);
    }
  }
  return Answer::kClosed;
}

double PairBound::Find(double at_least_s, std::uint32_t expansions_most) {
  expansions_ = 0;
  double bound_s = at_least_s;
  // K changes of cells need K - 1 steps of time.
  auto steps = std::max(StepsLeft({}), static_cast<std::int32_t>(at_least_s / step_s_) + 1);
  while (Within(steps, expansions_most) == Answer::kClosed) {
    bound_s = std::max(bound_s, steps * step_s_);
    ++steps;
  }
  return bound_s;
}

LargestPairBound FindPairBound(const Service& service, std::span<const double> end_s,
                               double at_least_s) {
  LargestPairBound largest{.bound_s = at_least_s, .by = {}};
  const Scene& scene = service.scene();
  const auto member = [&](std::uint32_t i) {
    return PairBound::Member{&scene.arm(i), &service.request().drives[i], service.start(i),
                             service.goal(i)};
  };
  std::uint32_t left = kExpansionsInAll;
  for (std::uint32_t i = 0; i < scene.size(); ++i) {
    for (const NeighbourNeed& near : scene.neighbours(i)) {
      const std::uint32_t j = near.unit;
      if (j < i || !service.is_served(i) || !service.is_served(j)) continue;
      if (std::max(end_s[i], end_s[j]) <= largest.bound_s) continue;
      const double need_mm = std::min(scene.FullNeed(i, j) - kClearToleranceMm, near.at_start_mm);
      PairBound pair({member(i), member(j)}, need_mm);
      const double bound_s = pair.Find(largest.bound_s, std::min(left, kExpansionsPerPair));
      left -= std::min(left, pair.expansions());
      if (left == 0) return largest;
      if (bound_s > largest.bound_s)
        largest = {bound_s, std::pair{PositionerIndex{i}, PositionerIndex{j}}};
    }
  }
  return largest;
}

}  // namespace focalfleet
