// The sequential planner finds an order in which all movers of a configuration can go into their
// cells, one at a time. Each goes along a way that is clear of all others as they stand at that
// moment. Run from the starts it gives the way in; run from the targets and read backwards it gives
// the way out again.
//
// The usual way is straight: phi folds back just as far as the cell needs, theta stands. Rounds
// take all units that are free now, so that chains of waiting stay short. A unit whose end would
// shut in a free neighbour waits for that neighbour.
//
// Where a round finds no free unit, three means follow in this order. A unit goes around by a path
// search. A neighbour is moved aside to where it no longer blocks a straight way. The place is
// inside its cell if it is there already and finds room, otherwise anywhere. At last the unit and
// its neighbours take a few random steps, until a way into its cell opens. The number of times that
// a unit does that for others is bounded.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "fleet/plan/path_search.h"
#include "fleet/plan/scene.h"
#include "fleet/plan/surroundings.h"
#include "protocol/base/rng.h"

namespace focalfleet {

/// A leg of one unit.
struct Piece {
  std::uint32_t unit = 0;
  Sweep sweep;
};

class SequentialPlanner {
 public:
  SequentialPlanner(const Scene* scene, std::span<const UnitDrive> drives,
                    Surroundings* surroundings, std::span<const Pose> poses,
                    std::span<const std::uint8_t> movers);

  /// Takes as many movers as possible into their cells.
  void Run();

  [[nodiscard]] const std::vector<Piece>& pieces() const { return pieces_; }
  /// Where each unit stands in the end. Shape: (n).
  [[nodiscard]] const std::vector<Pose>& poses() const { return poses_; }
  /// Movers that did not get into their cells; ascending.
  [[nodiscard]] const std::vector<std::uint32_t>& stuck() const { return waiting_; }

 private:
  [[nodiscard]] Pose StraightEnd(std::uint32_t unit) const;
  bool StraightClear(std::uint32_t unit);
  [[nodiscard]] bool StraightClearOf(std::uint32_t unit, const NeighbourNeed& near,
                                     const SegmentFp& line) const;
  [[nodiscard]] int ShutIn(std::uint32_t unit) const;
  bool StraightRound();
  bool GoAround(double grid_deg);
  bool ClearStraightWays();
  bool ClearStraightWayOf(std::uint32_t unit, bool stay_in_cell);
  bool MoveAside(const NeighbourNeed& near, std::uint32_t waiting, double grid_deg,
                 bool stay_in_cell);
  bool Perturb();
  bool PerturbAround(std::uint32_t unit);
  bool RandomWay(std::uint32_t unit, Way* way);
  Way WayIntoCell(std::uint32_t unit, double grid_deg);
  void StandAt(std::uint32_t unit, const Pose& pose);
  PathSearch::Question QuestionFor(std::uint32_t unit, double grid_deg);
  void Go(std::uint32_t unit, std::span<const Waypoint> way);
  void GoStraight(std::uint32_t unit);
  void DropArrived();
  [[nodiscard]] bool Waits(std::uint32_t unit) const { return waits_[unit] != 0; }

  const Scene* scene_;
  std::span<const UnitDrive> drives_;
  Surroundings* surroundings_;
  std::vector<Pose> poses_;
  std::vector<SegmentFp> lines_;
  std::vector<std::uint8_t> movers_;
  std::vector<std::uint8_t> waits_;
  std::vector<std::uint32_t> waiting_;
  std::vector<std::uint32_t> newly_waiting_;
  std::vector<Piece> pieces_;
  enum class Known : std::uint8_t { kNo, kClear, kBlocked };
  std::vector<Known> straight_;       // as far as nothing near has moved since
  std::vector<double> searched_deg_;  // finest grid on which a search failed since then; 0: none
  std::vector<std::uint8_t> moves_aside_;    // by unit, for the sake of others
  std::vector<std::uint8_t> perturbations_;  // by unit, for its own sake
  Rng rng_;
};

}  // namespace focalfleet
