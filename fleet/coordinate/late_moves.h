// A late move takes a single unit to its target while the others move. The unit has another target,
// or goes on after it was stopped.
//
//   settling -> planning -> uploading -> committing -> starting -> (moves like every other unit)
//      ^            |           |            |            |
//      +------------+-----------+------------+------------+   a neighbour is not where the plan has
//                                                             it, or the start would be too late
//
// A late move has an id and a start instant of its own, fixed when it is planned; no other unit is
// sent anything. A unit that cannot be served in this way keeps its target for the next round,
// unless an operator waits for the answer.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "fleet/coordinate/commands.h"
#include "fleet/coordinate/configuration.h"
#include "fleet/coordinate/coordination.h"
#include "fleet/coordinate/inputs.h"
#include "fleet/coordinate/round.h"
#include "fleet/coordinate/upload.h"
#include "fleet/plan/replan.h"
#include "protocol/base/result.h"

namespace focalfleet {

class LateMoves {
 public:
  /// All arguments outlive this.
  LateMoves(const Coordination& fleet, Configuration* configuration, Round* round, Upload* upload);

  /// Errors: kRefused with the reason, where the unit cannot get another target now.
  [[nodiscard]] Status MayRetarget(const RetargetCommand& command) const;
  /// The unit goes to its target as soon as it stands. `request` is answered when it starts.
  void Add(PositionerIndex i, std::uint64_t request);
  /// A unit was stopped on its way: goes on, where its target still stands and the round can take
  /// it.
  void GoOn(PositionerIndex i);

  /// Takes every late move as far as it can go now.
  void Advance();
  void OnPlan(const PlanDone& done);
  [[nodiscard]] HostInstant due() const { return due_; }
  [[nodiscard]] bool IsOver() const { return moves_.empty(); }

  /// Ends the late move of a unit that has not started, and takes its move back. False: none.
  bool Stop(PositionerIndex i, const std::string& reason);
  /// Ends all late moves that have not started.
  void EndAll(const std::string& reason);
  void Clear() { moves_.clear(); }

 private:
  struct Move {
    enum class Stage : std::uint8_t {
      kSettling,  // it was moving, or gives a move back
      kPlanning,
      kUploading,
      kCommitting,
      kStarting,
      kStarted,  // the start is said some more times
    };
    PositionerIndex unit;
    std::uint64_t request = 0;  // 0: no command waits, it goes on to the target that it had
    Stage stage = Stage::kSettling;
    int tries = 0;
    std::uint64_t job = 0;
    std::vector<Deviation> near;  // of its neighbours, when it was planned
    PlanPrediction predicted;
    std::uint64_t batch = 0;  // of its intent
    int starts_said = 0;
    HostInstant say_start_at{INT64_MIN};
  };

  [[nodiscard]] const Move* Find(PositionerIndex i) const;
  // False, of all below: the late move is over.
  bool AdvanceOne(Move* late);
  bool Settle(Move* late);
  bool Load(Move* late);
  bool TryAgain(Move* late);
  void AskForPlan(Move* late);
  void TakePlan(Move* late, const LateMove& move);
  void ReportOther(PositionerIndex i);
  void Withdraw(PositionerIndex i);
  void Start(Move* late);
  void SayStart(Move* late);
  void Reply(const Move& late, Error error) const;
  [[nodiscard]] bool IsStale(const Move& late) const;
  [[nodiscard]] bool MustNotStart(const Move& late, HostInstant last) const;

  const Coordination fleet_;
  Configuration& configuration_;
  Round& round_;
  Upload& upload_;
  std::vector<Move> moves_;
  std::uint64_t job_ = 0;  // under way; 0: none
  HostInstant due_ = kNever;
};

}  // namespace focalfleet
