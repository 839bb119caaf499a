// A new way for one unit while all others go on as they are. The unit may have a target of
// opportunity, was held back, comes late, or goes on after a stop. The motions of the others are
// given, bit for bit. The unit finds its way among them (candidates.h, time_search.h) and starts by
// a signal of its own.
//
// Times. Everything here is counted in seconds after the start signal of the configuration. The
// segments of a late move count from its own start signal, as they go on the bus. The time between
// two start signals is known only to the host's own timing. A unit with a signal of its own
// therefore has a wider skew. Clocks part no faster than those of units that started together. The
// slip of track.h therefore holds for such a pair with the mean of the two skews.
//
// Cost. A unit has some tens of neighbours at most, so one answer looks at them alone. The scene of
// the whole plate is made once for each configuration.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "fleet/knowledge.h"
#include "fleet/layout.h"
#include "fleet/plan/plan.h"
#include "fleet/plan/planner.h"
#include "fleet/plan/power_ledger.h"
#include "fleet/plan/scene.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// A move with a start signal of its own. Segments count from that signal, `move.followers` from
/// the configuration's.
struct LateMove {
  UnitPlan move;
  double start_s = 0;       // its start signal
  double start_skew_s = 0;  // the signal may come this early or late
  double end_s = 0;         // of the last segment
  /// The plan of `unit` gets this follower: the unit of `move` has to be stopped if `unit` ends
  /// early.
  struct Leader {
    PositionerIndex unit;
    UnitPlan::Follower follower;
  };
  std::vector<Leader> leaders;
  std::vector<Unnoticed> unnoticed;  // pairs with this unit that the notice does not cover
};

/// A unit that is otherwise than planned. Either it has ended and stands (at a place, within an
/// interval, or at an unknown place), or it has a late move.
struct Deviation {
  PositionerIndex unit;
  UnitKnowledge stands{};
  std::optional<LateMove> goes;  // where there is one, `stands` is not looked at
};

struct ReplanQuestion {
  PositionerIndex unit;
  Pose from{};  // the unit stands there from `now_s` on, until it starts
  Pose to{};
  double now_s = 0;
  double start_s = 0;  // when its own start signal can come: upload, read-back, arming, store
  double start_skew_s = 0.040;
};

/// A configuration under way. The object cannot be changed: each question brings the deviations
/// from the plan.
class RunningPlan {
 public:
  /// Pre: `moves` are a plan for `request`, made with `options`. Lifetime: `request.layout`
  /// outlives this. Cost: O(n), about 1 us a unit.
  RunningPlan(const PlanRequest& request, std::span<const UnitPlan> moves,
              const PlanOptions& options);
  RunningPlan(const RunningPlan&) = delete;
  RunningPlan& operator=(const RunningPlan&) = delete;

  /// A move of the unit that is clear of all others for all clocks and skews and within the limits
  /// of power, with notice where that is possible. The move ends soonest of the ways that are
  /// looked at.
  /// Pre: `deviations` has at most one for each unit; that of the unit itself does not count.
  /// Errors: kInvalid where a time or the target makes no sense, or the target is out of range or
  /// not clear of where others end (all of them named). kRefused where no way is found (the unit
  /// that was in the way most often is named).
  /// Cost: O(neighbours), with limits of power O(n).
  [[nodiscard]] Result<LateMove> Replan(const ReplanQuestion& question,
                                        std::span<const Deviation> deviations) const;

  /// The part of Replan that looks at the question and the target alone. Cost: some microseconds.
  [[nodiscard]] Status CheckTarget(const ReplanQuestion& question,
                                   std::span<const Deviation> deviations) const;

  /// Where the plan leaves a unit, as far as that is known.
  [[nodiscard]] const UnitKnowledge& PlannedEnd(PositionerIndex unit) const {
    return ends_[unit.value];
  }

 private:
  friend class Replanner;
  friend class ReplanNeighbourhood;

  [[nodiscard]] std::string NameOf(std::uint32_t unit) const;

  const Layout* layout_;
  std::vector<UnitDrive> drives_;
  PlanOptions options_;
  Scene scene_;
  std::vector<Pose> from_;  // of units without a place: meaningless
  std::vector<Pose> to_;    // as above
  std::vector<UnitKnowledge> ends_;
  std::vector<AxisPaths> paths_;  // empty: stands
  double end_s_ = 0;
  std::optional<PowerLedger> ledger_;  // of the moves as planned; none: power has no limit
};

}  // namespace focalfleet
