#include "fleet/coordinate/watch.h"

#include <algorithm>
#include <utility>
#include <variant>
#include <vector>

#include "fleet/coordinate/stall_detection.h"
#include "fleet/estimate.h"

namespace focalfleet {
namespace {

/// Sets the time within which others pass where the unit may stand.
void SetWatch(const Coordination& fleet, const Round& round, PositionerIndex i) {
  MotionState& motion = fleet.units[i].motion;
  motion.watch_from = kNever;
  motion.watch_until = HostInstant{INT64_MIN};
  for (const UnitPlan::Follower& follower : round.PlanOf(i)->followers) {
    motion.watch_from = std::min(motion.watch_from, round.AtPlanTime(follower.since_s));
    motion.watch_until = std::max(motion.watch_until, round.AtPlanTime(follower.left_s));
  }
  if (const auto beyond = round.border.leads.find(i.value); beyond != round.border.leads.end()) {
    motion.watch_from = std::min(motion.watch_from, round.AtPlanTime(beyond->second.since_s));
    motion.watch_until = std::max(motion.watch_until, round.AtPlanTime(beyond->second.left_s));
  }
}

bool Concerns(const Round& round, double since_s, double left_s, const Ended& when) {
  return round.AtPlanTime(left_s) >= when.from && round.AtPlanTime(since_s) <= when.until;
}

/// Units that may have ended, whose followers have not been looked at yet.
using Open = std::vector<std::pair<PositionerIndex, Ended>>;

/// The unit may be on its way. A unit that was lost on its way may hear, and may be read again.
bool MayMove(const Coordination& fleet, const Round& round, PositionerIndex i) {
  const UnitView& view = fleet.units[i].view;
  if (view.phase == UnitPhase::kMoving) return round.part(i) == Part::kMoving;
  const auto intent = fleet.ledger.intents.find(view.serial);
  const bool was_lost = view.phase == UnitPhase::kSilent || view.phase == UnitPhase::kSettling ||
                        view.phase == UnitPhase::kIdentifying;
  return was_lost && intent != fleet.ledger.intents.end() && intent->second.move == round.MoveOf(i);
}

void StopFollower(const Coordination& fleet, const Round& round, const UnitPlan::Follower& follower,
                  const Ended& when, const std::string& reason, Open* open) {
  if (!Concerns(round, follower.since_s, follower.left_s, when)) return;
  const UnitRecord& unit = fleet.units[follower.unit];
  const bool asked =
      unit.request.question && std::holds_alternative<Stop>(unit.request.question->message);
  if (asked || !MayMove(fleet, round, follower.unit)) return;
  StopOne(fleet, follower.unit, reason);
  // The follower ends when the stop gets through. Should that take longer, it is judged anew then.
  open->push_back({follower.unit, {fleet.now(), fleet.now() + fleet.requests.Patience()}});
}

void StopFollowersOf(const Coordination& fleet, const Round& round, Open open,
                     const std::string& reason) {
  while (!open.empty()) {
    const auto [i, when] = open.back();
    open.pop_back();
    const auto beyond = round.border.leads.find(i.value);
    if (beyond != round.border.leads.end() &&
        Concerns(round, beyond->second.since_s, beyond->second.left_s, when))
      fleet.out().border_ends.push_back({fleet.layout.unit(i).id, when.from, when.until});
    const UnitPlan* const plan = round.PlanOf(i);
    if (plan == nullptr) continue;
    for (const UnitPlan::Follower& follower : plan->followers)
      StopFollower(fleet, round, follower, when, reason, &open);
  }
}

}  // namespace

void WatchFromStart(const Coordination& fleet, const Round& round, PositionerIndex i) {
  constexpr DurationNs kBegun = Milliseconds(50);  // every unit has begun, whatever the skew
  SetWatch(fleet, round, i);
  UnitRecord& unit = fleet.units[i];
  // Spread over a period, so that a bus never hears all its units at once.
  const auto spread = [&](DurationNs period) {
    return DurationNs{period.ns * (i.value % 97) / 97};
  };
  const HostInstant began = round.BeganOf(i);
  const DurationNs poll = fleet.config.poll_period;
  const DurationNs watch = StallDetectionOf(fleet.config).poll;
  unit.motion.begun_by = began + poll;
  unit.next_poll = began + poll + spread(poll);
  if (unit.motion.watch_from < unit.motion.watch_until)
    unit.next_poll = std::min(
        unit.next_poll, std::max(began + kBegun, unit.motion.watch_from) + spread(watch - kBegun));
}

void WatchSoon(const Coordination& fleet, const Round& round, PositionerIndex i) {
  SetWatch(fleet, round, i);
  UnitRecord& unit = fleet.units[i];
  unit.next_poll = std::min(unit.next_poll, std::max(fleet.now(), unit.motion.watch_from));
  if (!unit.request.question) fleet.timers.Set(i, unit.next_poll);
}

bool MayHaveArrived(const Coordination& fleet, const Round& round, const Round::Course& course) {
  const PlanOptions allowed;
  const double end_s = EndOf(*course.plan, fleet.drive(course.plan->unit));
  return fleet.now() >=
         course.began + Seconds(end_s * (1 - allowed.clock_error) - 2 * round.skew_s);
}

Ended SeenUntil(const Coordination& fleet, PositionerIndex i, HostInstant until) {
  return {fleet.units[i].motion.seen_moving, until};
}

void StopFollowers(const Coordination& fleet, const Round& round, PositionerIndex first,
                   const Ended& ended, const std::string& reason) {
  StopFollowersOf(fleet, round, {{first, ended}}, reason);
}

void StopFollowersBeyond(const Coordination& fleet, const Round& round,
                         const BorderEndCommand& end) {
  Open open;
  for (const SectorRound::FollowsBeyond& follows : round.border.follows)
    if (std::ranges::find(end.leaders, follows.leader) != end.leaders.end())
      StopFollower(fleet, round, follows.follower, {end.from, end.until}, end.reason, &open);
  StopFollowersOf(fleet, round, std::move(open), end.reason);
}

void StopOne(const Coordination& fleet, PositionerIndex i, const std::string& reason) {
  fleet.requests.Forget(i);
  fleet.requests.Ask(i, Stop{});
  fleet.ledger.alarms().Raise(AlarmName::kUnitHeldBack, i, {},
                              fleet.units.NameOf(i) + " is stopped: " + reason);
}

}  // namespace focalfleet
