// The judge of a plane looks at a run from outside: at where the units truly are, at what each
// store holds, and at which commands of a round reach which sector. No code is shared with what it
// judges; distances and kinematics are its own. Its rules:
//
//   contact   No two arms touch. Excused are two units on both sides of a border where a fault
//   struck
//             one of their sectors in the window before the start that docs/plane.md names.
//   twice     No move is begun twice.
//   start     A unit begins a move only where its sector's store held the intent.
//   split     Two neighbours on both sides of a border that move at the same time do so by the same
//             round of the same coordinator.
//   place     A stored exact place is where the unit is, an interval or an open intent holds it.
//   arrived   A coordinator counts no more arrivals than there are units at their targets.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "tests/scenario/plane_in_process.h"

namespace focalfleet::test {

class PlaneJudge {
 public:
  explicit PlaneJudge(PlaneInProcess* plane);

  /// An agent gives its sector's coordinator a command.
  void Commanded(std::uint32_t sector, const SectorAgent& agent, const Command& command);
  /// A fault strikes a sector now, or all.
  void Struck(std::optional<std::uint32_t> sector);
  /// Looks at the true state, every 10 ms of it.
  void Look();
  /// The end: all rest, and no node is dead.
  void LookAtStores();
  void LookAtArrivals(const std::vector<std::optional<Pose>>& targets);

  [[nodiscard]] const std::vector<std::string>& broken() const { return broken_; }
  [[nodiscard]] std::uint64_t begun() const { return begun_; }
  [[nodiscard]] std::uint64_t starts() const { return starts_; }
  [[nodiscard]] std::uint64_t excused() const { return excused_; }
  [[nodiscard]] double nearest_mm() const { return nearest_mm_; }

 private:
  struct RoundOf {
    PlaneEpoch epoch;
    std::uint64_t round = 0;
    auto operator<=>(const RoundOf&) const = default;
  };
  [[nodiscard]] bool IsExcused(std::uint32_t a, std::uint32_t b) const;
  void Broken(const std::string& rule, const std::string& what);
  void LookForContact(const std::vector<sim::UnitTruth>& truths);
  void LookAtBegins(const std::vector<sim::UnitTruth>& truths);

  PlaneInProcess& plane_;
  HostInstant look_at_{0};
  std::vector<std::uint32_t> begins_;           // Shape: (units)
  std::vector<std::optional<RoundOf>> moving_;  // Shape: (units); the round it moves by
  std::vector<std::optional<RoundOf>> given_;   // Shape: (sectors); the last round started
  std::vector<std::optional<RoundOf>> held_;    // Shape: (sectors)
  std::vector<std::pair<std::uint32_t, std::uint32_t>> near_;
  std::set<std::pair<std::uint32_t, std::uint32_t>> touching_;
  std::vector<std::string> broken_;
  std::uint64_t begun_ = 0;
  std::uint64_t starts_ = 0;
  std::uint64_t excused_ = 0;
  std::vector<std::pair<HostInstant, std::optional<std::uint32_t>>> struck_;
  std::vector<HostInstant> decided_;  // Shape: (sectors); the last start, when it was decided
  double nearest_mm_ = 1e9;           // of two arms' surfaces
};

}  // namespace focalfleet::test
