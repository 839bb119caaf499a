// The least time in which two neighbours can both get to their targets, whatever all others do: a
// lower bound of every plan that serves both.
//
// The argument. Each of the four axes is cut into cells that it cannot cross in less than a step of
// time. Look at the two units at the times 0, 1 step, 2 steps ... and at the end. From one look to
// the next no axis gets farther than into a cell beside its own. At each look the two are clear of
// each other, so their joint cell has a pose that is clear. A joint cell is closed if it has none:
// the arms in its middle are nearer than the rule asks by more than both can travel within the
// cell. A unit that needs K changes of cells on the shortest way through joint cells that are not
// closed therefore needs at least K - 1 steps. No pose between the looks is asked for anything, so
// the bound holds for every motion, at any speed up to the axes' own, with waits and turns.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "fleet/plan/path_search.h"
#include "fleet/plan/service.h"

namespace focalfleet {

class PairBound {
 public:
  static constexpr double kGridDeg = 4;

  struct Member {
    const ArmGeometry* arm = nullptr;
    const UnitDrive* drive = nullptr;
    Pose from{};
    Pose to{};
  };

  /// `need_mm` is what the rule asks at least. Lifetime: the arms and drives outlive this.
  PairBound(const std::array<Member, 2>& members, double need_mm);

  /// A time below which no motion serves both, at least `at_least_s`. The search ends after so many
  /// expansions, and says what is proven until then. Units: s.
  double Find(double at_least_s, std::uint32_t expansions_most);
  [[nodiscard]] std::uint32_t expansions() const { return expansions_; }

 private:
  using Cells = std::array<std::int16_t, 4>;  // theta and phi of the first, of the second
  struct Node {
    Cells at{};
    std::int32_t steps = 0;
  };
  struct Open {
    std::int32_t left;
    std::int32_t node;
    bool operator<(const Open& o) const { return left != o.left ? left > o.left : node < o.node; }
  };
  enum class Answer : std::uint8_t { kReached, kClosed, kUnknown };

  [[nodiscard]] std::int32_t StepsLeft(const Cells& at) const;
  [[nodiscard]] bool IsClosed(const Cells& at) const;
  [[nodiscard]] bool InRange(const Cells& at) const;
  [[nodiscard]] Pose MiddleOf(const Cells& at, std::size_t member) const;
  Answer Within(std::int32_t steps_most, std::uint32_t expansions_most);
  std::int32_t* SlotOf(const Cells& at);
  void Reach(const Cells& at, std::int32_t steps, std::int32_t steps_most);

  std::array<Member, 2> members_;
  double step_s_ = 0;
  std::array<std::int32_t, 4> side_{};  // vectors of a cell
  Cells low_{};
  Cells high_{};
  Cells target_{};
  double closed_mm_ = 0;  // a joint cell whose middles are nearer is closed
  std::vector<Node> nodes_;
  std::vector<Open> open_;
  std::vector<std::pair<std::uint64_t, std::int32_t>> table_;  // open addressing; -1: free
  std::size_t used_ = 0;
  std::uint32_t expansions_ = 0;
};

/// The largest bound of all pairs of neighbours that the plan serves, and who sets it. Pairs that
/// are both there by `at_least_s` cannot raise it and are not looked at. Shape: `end_s` (n), when
/// each unit of a plan ends. Cost: counted, at most some tenths of a second.
struct LargestPairBound {
  double bound_s = 0;
  std::optional<std::pair<PositionerIndex, PositionerIndex>> by;
};
LargestPairBound FindPairBound(const Service& service, std::span<const double> end_s,
                               double at_least_s);

}  // namespace focalfleet
