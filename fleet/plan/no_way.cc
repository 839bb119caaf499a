#include "fleet/plan/no_way.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "fleet/plan/scene.h"

namespace focalfleet {
namespace {

/// Coarse first: fine grids find narrower walls, and take longer.
constexpr std::array kGridsDeg{4.0, 2.0, 1.0, 0.5, 0.25};
constexpr std::uint8_t kOpen = 0;
constexpr std::uint8_t kReached = 1;

/// Boxes of one size over all that the axes' ranges allow. Neighbouring boxes share the whole
/// vectors at their borders, so a way cannot slip between two.
class Boxes {
 public:
  Boxes(const NoWayQuestion& question, double grid_deg) : q_(question), range_(Range()) {
    for (const Axis axis : kAxes) {
      const std::size_t k = Index(axis);
      const double vectors = grid_deg * std::numbers::pi / 180 / q_.arm->step_rad(axis);
      size_[k] = std::max(1, static_cast<std::int32_t>(vectors));
      count_[k] = (range_.high[k] - range_.low[k]) / size_[k] + 1;
    }
    state_.assign(static_cast<std::size_t>(count_[0]) * static_cast<std::size_t>(count_[1]), kOpen);
  }

  /// True: the target may be reached from the start. False: it cannot, and `walls` are the units
  /// and obstacles that close it off.
  bool Reaches(std::vector<std::uint32_t>* walls);

 private:
  [[nodiscard]] PoseBox Range() const {
    PoseBox range = q_.arm->range();
    for (std::size_t k = 0; k < kAxisCount; ++k) {
      range.low[k] = std::min({range.low[k], q_.from[k], q_.to[k]});
      range.high[k] = std::max({range.high[k], q_.from[k], q_.to[k]});
    }
    return range;
  }
  [[nodiscard]] std::array<std::int32_t, kAxisCount> BoxOf(const Pose& pose) const {
    return {(pose[0] - range_.low[0]) / size_[0], (pose[1] - range_.low[1]) / size_[1]};
  }
  [[nodiscard]] std::uint8_t& State(std::int32_t a, std::int32_t b) {
    return state_[static_cast<std::size_t>(a) * static_cast<std::size_t>(count_[1]) +
                  static_cast<std::size_t>(b)];
  }
  /// The blocker that every pose of the box is too near to. Null: there is none.
  [[nodiscard]] const Blocker* Closes(std::int32_t a, std::int32_t b) const;

  const NoWayQuestion& q_;
  PoseBox range_;
  std::array<std::int32_t, kAxisCount> size_{};
  std::array<std::int32_t, kAxisCount> count_{};
  std::vector<std::uint8_t> state_;
};

const Blocker* Boxes::Closes(std::int32_t a, std::int32_t b) const {
  const double theta = range_.low[0] + (a + 0.5) * size_[0];
  const double phi = range_.low[1] + (b + 0.5) * size_[1];
  const SegmentFp line = q_.arm->AtAngles(q_.arm->Theta(0) + theta * q_.arm->step_rad(Axis::kTheta),
                                          q_.arm->Fold(0) + phi * q_.arm->step_rad(Axis::kPhi));
  const double travel_mm = q_.arm->TravelBound(size_[0] / 2.0, size_[1] / 2.0);
  for (const Blocker& blocker : q_.never_move) {
    const double closed_mm = blocker.need_mm + blocker.capsule.radius_mm - travel_mm;
    if (closed_mm > 0 && SquaredDistance(line, blocker.capsule.line) < closed_mm * closed_mm)
      return &blocker;
  }
  return nullptr;
}

bool Boxes::Reaches(std::vector<std::uint32_t>* walls) {
  walls->clear();
  const auto target = BoxOf(q_.to);
  std::vector<std::array<std::int32_t, kAxisCount>> open{BoxOf(q_.from)};
  State(open.front()[0], open.front()[1]) = kReached;
  while (!open.empty()) {
    const auto [a, b] = open.back();
    open.pop_back();
    if (a == target[0] && b == target[1]) return true;
    // Closed boxes include their corners, so nothing passes between two that meet in one.
    for (const auto& [da, db] : {std::array{1, 0}, {-1, 0}, {0, 1}, {0, -1}}) {
      const std::int32_t c = a + da;
      const std::int32_t d = b + db;
      if (c < 0 || d < 0 || c >= count_[0] || d >= count_[1] || State(c, d) != kOpen) continue;
      const Blocker* closes = Closes(c, d);
      if (closes == nullptr) {
        State(c, d) = kReached;
        open.push_back({c, d});
      } else if (std::find(walls->begin(), walls->end(), closes->by) == walls->end()) {
        walls->push_back(closes->by);
      }
    }
  }
  return false;
}

}  // namespace

std::optional<NoWay> ProveNoWay(const NoWayQuestion& question) {
  for (const double grid_deg : kGridsDeg) {
    std::vector<std::uint32_t> walls;
    if (Boxes(question, grid_deg).Reaches(&walls)) continue;
    NoWay proof{.grid_deg = grid_deg, .walls = {}, .obstacle = false};
    std::sort(walls.begin(), walls.end());
    for (const std::uint32_t by : walls) {
      if (by == kNoUnitIndex)
        proof.obstacle = true;
      else
        proof.walls.push_back({by});
    }
    return proof;
  }
  return std::nullopt;
}

}  // namespace focalfleet
