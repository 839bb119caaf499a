// Ways for two or three units at once, through the angles of all of them. Where arms are hooked
// into each other none can go first, and a search for one of them among the motions of the others
// finds nothing.
//
// Path and velocity are found apart (Kant and Zucker 1986).
// - The path: two trees of poses of all units together, one from the start, one from the target,
//   grow towards each other (RRT-Connect, Kuffner and LaValle 2000). In each step of time each axis
//   turns at its speed one way, the other way, or not. Where a stretch of the path has a quicker
//   one, that takes its place.
// - The velocity: the steps of the path get their time among all others. All members wait together
//   wherever that meets others least.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "fleet/plan/bundles.h"
#include "fleet/plan/occupancy.h"
#include "fleet/plan/pose_grid.h"
#include "protocol/base/rng.h"

namespace focalfleet {

class JointSearch {
 public:
  static constexpr std::size_t kMembersMax = 3;
  struct Member {
    const ArmGeometry* arm = nullptr;
    const UnitDrive* drive = nullptr;
    const Surround* around = nullptr;  // without the other members; null: nothing moves around it
    std::span<const StandingThing> standing;
    Pose from{};
    Pose to{};
    PoseBox within;
  };
  struct Question {
    std::span<const Member> members;  // two or three
    /// For members a and b, a < b. Shape: (members, members).
    std::array<std::array<double, kMembersMax>, kMembersMax> need_mm{};
    TimeSteps steps;
    std::int32_t end_step = 0;
    /// Steps in which no member may move: power has no room. Empty: there are none.
    std::span<const std::uint8_t> rests;
    int grow_most = 400;  // samples until the trees must have met
    int shorten = 100;    // stretches that are tried
  };
  struct Found {
    std::array<AxisPaths, kMembersMax> paths;
    std::int32_t meets = 0;  // steps of members in which others are too near
    std::int32_t steps = 0;  // that the path takes without a wait
  };

  /// Empty: the trees did not meet, or the path does not end in time.
  std::optional<Found> Find(const Question& question, Rng* rng);
  /// Tests of one step so far: what the searches cost.
  [[nodiscard]] std::uint64_t work() const { return work_; }

 private:
  using Poses = std::array<Pose, kMembersMax>;
  struct Node {
    Poses at{};
    std::int32_t came_from = -1;
  };
  using Tree = std::vector<Node>;
  enum class Shape : std::uint8_t { kEarly, kLate, kFirstFirst, kLastFirst };

  [[nodiscard]] std::size_t size() const { return q_.members.size(); }
  [[nodiscard]] std::int32_t StepsBetween(const Poses& a, const Poses& b) const;
  [[nodiscard]] std::int32_t StepsOf(std::size_t m, const Poses& a, const Poses& b) const;
  [[nodiscard]] Poses Towards(const Poses& from, const Poses& to) const;
  struct Swept;
  [[nodiscard]] bool StandsClear(std::size_t m, const Swept& arm) const;
  [[nodiscard]] bool StepClear(const Poses& from, const Poses& to);
  [[nodiscard]] Poses Draw(Rng* rng) const;
  [[nodiscard]] std::int32_t Nearest(const Tree& tree, const Poses& to) const;
  std::int32_t Grow(Tree* tree, std::int32_t from, const Poses& to, int steps_most);
  bool Connect(Rng* rng);
  void Shorten(Rng* rng);
  bool Stretch(const Poses& from, const Poses& to, Shape shape, std::vector<Poses>* out);
  [[nodiscard]] std::optional<Found> LayOut() const;

  Question q_;
  /// The distance at which two members are distinguished, with a margin where both ends have it.
  std::array<std::array<double, kMembersMax>, kMembersMax> apart_mm_{};
  std::array<Pose, kMembersMax> step_{};
  std::array<std::vector<Bundle>, kMembersMax> bundles_;  // of what stands
  Tree forward_;
  Tree backward_;
  std::vector<Poses> way_;
  std::vector<Poses> stretch_;
  std::uint64_t work_ = 0;
};

}  // namespace focalfleet
