// The planner at work on one request. Its phases share what they know of the request, of who is
// served, and of the plan so far:
//
//   all at once   everyone gets a way in the same search (planner_at_once.cc)
//   an order      one after the other, through the cells, for what the search does not bring to an
//                 end (planner_order.cc); the search begins with it once more
//   the end       bounds, followers and nearest pairs of the plan (planner.cc)
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "fleet/plan/local_search.h"
#include "fleet/plan/planner.h"
#include "fleet/plan/scene.h"
#include "fleet/plan/schedule.h"
#include "fleet/plan/service.h"
#include "fleet/plan/surroundings.h"

namespace focalfleet {

/// Each attempt takes at least one unit out of the served ones or lets at least one be moved aside.
/// After so many attempts the fleet is planned with what can be served without moving any unit
/// aside.
inline constexpr int kAttemptsMax = 60;

class Planner {
 public:
  /// Lifetime: both outlive this.
  Planner(const PlanRequest& request, const PlanOptions& options);

  /// Pre: the shapes of the request agree. Errors: as MakePlan.
  Result<Plan> Run();
  /// Every target is in reach, and no unit starts or ends nearer to another than allowed.
  [[nodiscard]] Status Check() const;

 private:
  Result<Plan> AmongGiven();
  bool Attempt(std::vector<Piece>* order);
  void GiveWay();
  void Abandon(std::uint32_t unit, std::optional<NoWay> proof = std::nullopt);
  bool AbandonHopeless();
  bool AbandonWalledIn();
  bool LetStepAside(std::uint32_t stuck);
  [[nodiscard]] Status CheckWanted() const;
  [[nodiscard]] double MeanNeighbours() const;
  [[nodiscard]] LocalSearchResult Search(LocalSearchRequest search, double complete_cpu_s) const;
  [[nodiscard]] std::size_t CountGoing() const;
  bool AllAtOnce(std::span<const AxisPaths> begin_with);
  bool LeaveStuck();
  void ServeTheRest();
  void PlanOfLocalSearch();
  void TracksOfPlan();
  void FindBounds();
  Plan Finish();

  const PlanRequest& request_;
  const PlanOptions& options_;
  const Layout& layout_;
  const std::vector<Pose> start_;  // of units without a place: meaningless
  Scene scene_;
  Surroundings surroundings_;
  Service service_;
  std::string too_near_;  // pairs that start so, by name
  std::vector<std::uint8_t> aside_;
  std::vector<std::uint8_t> by_itself_;  // goes from start to target in one way, not by its cell
  std::vector<std::uint8_t> hopeful_;    // CanEver has returned true for it
  std::vector<std::uint8_t> movers_;
  std::vector<std::uint32_t> stuck_;
  std::vector<std::uint32_t> stuck_for_order_;  // given up though a way exists
  bool dense_ = false;
  LocalSearchResult local_search_;  // tracks of plan_
  Plan plan_;
};

}  // namespace focalfleet
