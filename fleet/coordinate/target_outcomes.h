// The outcomes of the targets, and their counts in the published view. An arrival counts only when
// the batch with the end of its motion is durable; until then it waits here.
#pragma once

#include <cstdint>
#include <deque>
#include <string>

#include "fleet/coordinate/configuration_view.h"
#include "fleet/coordinate/coordination.h"

namespace focalfleet {

class TargetOutcomes {
 public:
  /// `view` outlives this.
  TargetOutcomes(const Coordination& fleet, ConfigurationView* view)
      : fleet_(fleet), view_(*view) {}

  /// No effect where the unit has another final outcome: an arrival or a failure is only taken back
  /// by Reopen, or by a new goal.
  void Set(PositionerIndex i, TargetOutcome outcome, std::string reason = {});
  /// Sets the outcome of all units whose target is pending.
  void SetOfPending(TargetOutcome outcome, const std::string& reason);
  /// The unit has another target: its outcome is pending, whatever it was.
  void Restart(PositionerIndex i);
  /// Takes an arrival back, because a measurement contradicts it or the unit is sent again.
  void Reopen(PositionerIndex i);

  /// The unit has arrived, which counts when `batch` is durable.
  void NoteArrival(PositionerIndex i, std::uint64_t batch);
  [[nodiscard]] bool IsNoted(PositionerIndex i) const;
  [[nodiscard]] bool IsAnyNoted() const { return !arrivals_.empty(); }
  /// Sets the outcome of arrivals whose batches are durable, in the order in which they were noted.
  void ReportArrivals();

 private:
  /// Where targets of this outcome are counted; null: nowhere.
  [[nodiscard]] std::uint32_t* CountOf(TargetOutcome outcome) const;
  void DropArrival(PositionerIndex i);

  struct Arrival {
    std::uint64_t batch;
    PositionerIndex unit;
  };
  const Coordination fleet_;
  ConfigurationView& view_;
  std::deque<Arrival> arrivals_;
};

}  // namespace focalfleet
