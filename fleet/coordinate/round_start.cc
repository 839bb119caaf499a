#include "fleet/coordinate/round_start.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "fleet/coordinate/watch.h"

namespace focalfleet {
namespace {

constexpr int kStartRepeats = 2;
// Plans are widened to this at most: with more, units that pass each other find no way. A unit that
// starts later is out of step with all others, and the alarm is for a person.
constexpr double kSkewMost_s = 0.1;

std::string InMilliseconds(double time_s) {
  const auto tenths = static_cast<std::int64_t>(std::llround(time_s * 1e4));
  return std::to_string(tenths / 10) + "." + std::to_string(tenths % 10) + " ms";
}

}  // namespace

HostInstant RoundStart::Begin(HostInstant at) {
  round_.started = at;
  round_.last_arrival = round_.started;
  said_ = 0;
  for (const UnitPlan& move : round_.plan.moves) {
    UnitRecord& unit = fleet_.units[move.unit];
    round_.SetPart(move.unit, Part::kMoving);
    fleet_.units.SetPhase(move.unit, UnitPhase::kMoving);
    round_[move.unit].before.reset();
    unit.view.error_um.reset();  // no measurement holds where it goes now
    unit.motion.seen_moving = HostInstant{INT64_MIN};
    WatchFromStart(fleet_, round_, move.unit);
    fleet_.timers.Set(move.unit, unit.next_poll);
  }
  skew_.Clear();
  for (const UnitPlan& move : round_.plan.moves) fleet_.units[move.unit].motion.wants_start = true;
  if (fleet_.config.sync_line) fleet_.out().sync_at = round_.started;
  return Say();
}

HostInstant RoundStart::Repeat() {
  if (fleet_.now() < repeat_at_) return kNever;
  // A host that was held up repeats nothing: whoever missed the signal would begin out of step with
  // all others.
  if (Left() <= DurationNs{0}) return repeat_at_ = kNever;
  return Say();
}

/// From now to the instant that start signals name.
DurationNs RoundStart::Left() const {
  const DurationNs left = round_.started - fleet_.now();
  return fleet_.config.sync_line ? left + fleet_.config.sync_lead : left;
}

HostInstant RoundStart::Say() {
  const DurationNs left = Left();
  const auto ticks = static_cast<std::uint32_t>(std::max<std::int64_t>(left.ns, 0) / kTick.ns);
  std::vector<bool> said_on(fleet_.units.buses.size());
  for (const UnitPlan& move : round_.plan.moves) {
    const std::size_t bus = fleet_.units[move.unit].bus;
    if (said_on[bus]) continue;
    said_on[bus] = true;
    fleet_.requests.SendNow(bus, Start{round_.move, ticks}, kBroadcastNode);
  }
  repeat_at_ = ++said_ > kStartRepeats
                   ? kNever
                   : fleet_.now() + DurationNs{fleet_.config.start_delay.ns / (kStartRepeats + 2)};
  return repeat_at_;
}

void RoundStart::NoteStart(PositionerIndex i, std::uint32_t round_number, StartView* view) {
  // A late move has a start of its own.
  if (round_.PlanOf(i) == nullptr || round_.IsLate(i)) return;
  skew_.Add(i, fleet_.units[i].motion.began);
  const double skew_s = skew_.likely().seconds();
  if (view->round != round_number && skew_s < view->skew_s) return;  // an earlier round was worse
  const double least_s = skew_.least().seconds();
  const double most_s = skew_.most().seconds();
  *view = {.round = round_number,
           .begun = static_cast<std::uint32_t>(round_.plan.moves.size()),
           .reported = skew_.reported(),
           .skew_s = skew_s,
           .bound_s = std::max(most_s - skew_s, skew_s - least_s),
           .least_s = least_s,
           .most_s = most_s,
           .allowed_s = 2 * round_.skew_s,
           .first = skew_.first(),
           .last = skew_.last()};
}

bool RoundStart::Awaits(PositionerIndex i) const {
  const UnitRecord& unit = fleet_.units[i];
  return unit.motion.wants_start && unit.request.question &&
         std::holds_alternative<ClockRequest>(unit.request.question->message);
}

void RoundStart::Judge() {
  if (skew_.reported() == 0) return;
  const double allowed_s = 2 * round_.skew_s;
  const double least_s = skew_.least().seconds();
  if (least_s <= allowed_s) return;
  round_.next_skew_s = std::min(kSkewMost_s, std::max(round_.next_skew_s, least_s / 2));
  const StartSkew::Start& first = skew_.surely_first();
  const StartSkew::Start& last = skew_.surely_last();
  const auto name = [&](PositionerIndex i) {
    return fleet_.units.NameOf(i) + " (bus " + std::to_string(fleet_.units.bus_of(i).id.value) +
           ")";
  };
  fleet_.ledger.alarms().Raise(
      AlarmName::kStartsApart, last.unit, fleet_.units.bus_of(last.unit).id,
      name(last.unit) + " began " + InMilliseconds(least_s) + " to " +
          InMilliseconds((last.began.latest - first.began.earliest).seconds()) + " after " +
          name(first.unit) + ", more than the " + InMilliseconds(allowed_s) +
          " that the plan allowed for; from now on plans allow for " +
          InMilliseconds(2 * round_.next_skew_s));
}

}  // namespace focalfleet
