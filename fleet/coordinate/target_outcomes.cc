#include "fleet/coordinate/target_outcomes.h"

#include <algorithm>
#include <utility>

namespace focalfleet {

void TargetOutcomes::Set(PositionerIndex i, TargetOutcome outcome, std::string reason) {
  UnitView& view = fleet_.units[i].view;
  if (view.outcome == outcome) return;
  if (outcome != TargetOutcome::kPending && view.outcome != TargetOutcome::kPending) return;
  view.outcome = outcome;
  view.outcome_reason = std::move(reason);
  if (std::uint32_t* const count = CountOf(outcome)) ++*count;
  fleet_.units.Changed(i);
}

void TargetOutcomes::SetOfPending(TargetOutcome outcome, const std::string& reason) {
  for (std::uint32_t n = 0; n < fleet_.units.size(); ++n)
    if (fleet_.units[{n}].view.outcome == TargetOutcome::kPending) Set({n}, outcome, reason);
}

void TargetOutcomes::Restart(PositionerIndex i) {
  UnitView& view = fleet_.units[i].view;
  if (std::uint32_t* const count = CountOf(view.outcome)) --*count;
  DropArrival(i);
  view.outcome = TargetOutcome::kPending;
  view.outcome_reason.clear();
  fleet_.units.Changed(i);
}

void TargetOutcomes::Reopen(PositionerIndex i) {
  UnitView& view = fleet_.units[i].view;
  DropArrival(i);
  if (view.outcome != TargetOutcome::kArrived) return;
  --*CountOf(view.outcome);
  view.outcome = TargetOutcome::kPending;
  fleet_.units.Changed(i);
}

void TargetOutcomes::NoteArrival(PositionerIndex i, std::uint64_t batch) {
  arrivals_.push_back({batch, i});
}

bool TargetOutcomes::IsNoted(PositionerIndex i) const {
  return std::any_of(arrivals_.begin(), arrivals_.end(),
                     [i](const Arrival& arrival) { return arrival.unit == i; });
}

void TargetOutcomes::ReportArrivals() {
  while (!arrivals_.empty() && fleet_.ledger.committed_through() >= arrivals_.front().batch) {
    Set(arrivals_.front().unit, TargetOutcome::kArrived);
    arrivals_.pop_front();
  }
}

std::uint32_t* TargetOutcomes::CountOf(TargetOutcome outcome) const {
  switch (outcome) {
    case TargetOutcome::kArrived:
      return &view_.counts.arrived;
    case TargetOutcome::kRefused:
      return &view_.counts.refused;
    case TargetOutcome::kFailed:
      return &view_.counts.failed;
    case TargetOutcome::kStopped:
      return &view_.counts.stopped;
    case TargetOutcome::kUnmeasured:
      return &view_.counts.unmeasured;
    case TargetOutcome::kNone:
    case TargetOutcome::kPending:
      break;
  }
  return nullptr;
}

void TargetOutcomes::DropArrival(PositionerIndex i) {
  std::erase_if(arrivals_, [i](const Arrival& arrival) { return arrival.unit == i; });
}

}  // namespace focalfleet
