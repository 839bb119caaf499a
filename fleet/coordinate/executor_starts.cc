// ConfigurationExecutor, once a round has begun: when each unit did, and whether the plan had
// allowed for it. docs/adr/0010-start-skew.md

#include <algorithm>
#include <cmath>
#include <string>

#include "fleet/coordinate/executor.h"

namespace focalfleet {
namespace {

// What plans are widened to at most: with more, units that pass each other find no way. Whoever
// starts later is out of step with all others, and the alarm is for a person.
constexpr double kSkewMost_s = 0.1;

std::string InMilliseconds(double time_s) {
  const auto tenths = static_cast<std::int64_t>(std::llround(time_s * 1e4));
  return std::to_string(tenths / 10) + "." + std::to_string(tenths % 10) + " ms";
}

}  // namespace

void ConfigurationExecutor::ExpectStarts() {
  skew_.Clear();
  for (const UnitPlan& move : plan_.moves) core_.unit(move.unit).wants_start = true;
}

void ConfigurationExecutor::NoteStart(PositionerIndex i) {
  // A late move has a start of its own.
  if (plan_of_[i.value] == kNoPlan || courses_.contains(i.value)) return;
  skew_.Add(i, core_.unit(i).began);
  StartView& view = view_.starts;
  const double skew_s = skew_.likely().seconds();
  if (view.round != view_.round && skew_s < view.skew_s) return;  // an earlier round was worse
  const double least_s = skew_.least().seconds();
  const double most_s = skew_.most().seconds();
  view = {.round = view_.round,
          .begun = static_cast<std::uint32_t>(plan_.moves.size()),
          .reported = skew_.reported(),
          .skew_s = skew_s,
          .bound_s = std::max(most_s - skew_s, skew_s - least_s),
          .least_s = least_s,
          .most_s = most_s,
          .allowed_s = 2 * round_skew_s_,
          .first = skew_.first(),
          .last = skew_.last()};
}

/// A unit of this round whose answer is on its way: the round is over when it has come.
bool ConfigurationExecutor::AwaitsStart(PositionerIndex i) const {
  const UnitRecord& unit = core_.units[i.value];
  return unit.wants_start && unit.question &&
         std::holds_alternative<ClockRequest>(unit.question->message);
}

void ConfigurationExecutor::JudgeStarts() {
  if (skew_.reported() == 0) return;
  const double allowed_s = 2 * round_skew_s_;
  const double least_s = skew_.least().seconds();
  if (least_s <= allowed_s) return;
  planned_skew_s_ = std::min(kSkewMost_s, std::max(planned_skew_s_, least_s / 2));
  const StartSkew::Start& first = skew_.surely_first();
  const StartSkew::Start& last = skew_.surely_last();
  const auto name = [&](PositionerIndex i) {
    return core_.NameOf(i) + " (bus " + std::to_string(core_.bus_of(i).id.value) + ")";
  };
  core_.Raise(Severity::kError, last.unit, core_.bus_of(last.unit).id,
              name(last.unit) + " began " + InMilliseconds(least_s) + " to " +
                  InMilliseconds((last.began.latest - first.began.earliest).seconds()) + " after " +
                  name(first.unit) + ", more than the " + InMilliseconds(allowed_s) +
                  " that the plan allowed for; from now on plans allow for " +
                  InMilliseconds(2 * planned_skew_s_));
}

}  // namespace focalfleet
