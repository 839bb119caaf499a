#include "daemon/soak/stop_judge.h"

#include <fmt/format.h>

#include <algorithm>

namespace focalfleet::soak {
namespace {

constexpr DurationNs kStopWithin = Milliseconds(150);
/// A stop goes ahead of the commands that wait for the same turn.
constexpr DurationNs kSameTurn = Seconds(1);
/// A start signal that a fault held up is discarded so long after it.
constexpr DurationNs kAfterHoldUp = Seconds(60);

bool Moves(const sim::UnitTruth& truth) {
  return truth.powered && (truth.state == UnitState::kMoving || truth.state == UnitState::kHoming);
}

}  // namespace

bool StopJudge::IsReached(std::size_t row, HostInstant since) const {
  const auto buses = plant_->layout().buses();
  const auto bus = std::lower_bound(buses.begin(), buses.end(), plant_->layout().units()[row].bus);
  return since > troubles_->buses[static_cast<std::size_t>(bus - buses.begin())] &&
         since > troubles_->deaf[row];
}

void StopJudge::Ordered(HostInstant now, std::optional<UnitId> unit) {
  for (std::size_t row = 0; row < must_rest_.size(); ++row)
    if (!unit || plant_->layout().units()[row].id == *unit)
      must_rest_[row] = std::min(must_rest_[row], now + kStopWithin);
}

void StopJudge::AllStopped(HostInstant asked, HostInstant now) {
  if (commanded_ < asked - kSameTurn) all_stopped_ = now;
}

void StopJudge::MotionCommanded(HostInstant now) {
  commanded_ = now;
  all_stopped_ = kNever;
}

void StopJudge::Look(HostInstant now, std::size_t row, const sim::UnitTruth& truth) {
  if (now < must_rest_[row]) return;
  const HostInstant ordered = std::exchange(must_rest_[row], kNever) - kStopWithin;
  if (troubles_->away < ordered && IsReached(row, ordered) && Moves(truth) && truth.began < ordered)
    broken_("stop", fmt::format("unit {} still moves {} ms after a stop", truth.id.value,
                                kStopWithin.ns / 1'000'000));
}

void StopJudge::LookAtStart(std::size_t row, const sim::UnitTruth& truth) {
  if (all_stopped_ == kNever || truth.began <= all_stopped_ + kStopWithin) return;
  if (IsReached(row, all_stopped_ - kAfterHoldUp))
    broken_("stop", fmt::format("unit {} begins move {} after all were stopped", truth.id.value,
                                truth.last_move.value));
}

}  // namespace focalfleet::soak
