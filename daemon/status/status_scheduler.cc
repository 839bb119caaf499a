#include "daemon/status/status_scheduler.h"

#include <algorithm>

namespace focalfleet {

StatusScheduler::StatusScheduler(std::size_t units, Options options, const HostClock& clock)
    : options_(std::move(options)),
      period_(clock.Real(Seconds(1 / options_.rate_hz))),
      idle_period_(clock.Real(Seconds(1))),
      changed_(units, 1) {}

void StatusScheduler::Changed(std::span<const PositionerIndex> units) {
  for (const PositionerIndex i : units) changed_[i.value] = 1;
  any_changed_ = any_changed_ || !units.empty();
}

HostInstant StatusScheduler::wake_at() const {
  return any_changed_ || moving_ ? next_ : std::max(next_, next_idle_);
}

StatusBatch StatusScheduler::Take(const FleetView& view, std::uint64_t after_batch,
                                  bool store_failing) {
  StatusBatch batch;
  batch.after_batch = after_batch;
  TakeUnits(view, &batch);
  for (const BusId bus : view.layout->buses()) batch.buses.push_back(SnapshotBus(view, bus));
  const FleetCounts counts = CountFleet(view);
  batch.fleet = FleetStatusValue{
      .at = view.at,
      .started = options_.started,
      .version = options_.version,
      .units = static_cast<std::uint32_t>(view.layout->size()),
      .enabled = counts.enabled,
      .units_by_phase = counts.by_phase,
      .units_by_witness = counts.by_witness,
      .configuration = view.coordinator->configuration().id,
      .bus_load_max = HighestBusLoad(view),
      .busy = view.coordinator->busy(),
      .store_failing = store_failing,
  };
  batch.configuration = ConfigurationProgressValue{view.at, view.coordinator->configuration()};
  batch.makespan_s = MakespanSoFar(view);
  next_ = view.now + period_;
  next_idle_ = view.now + idle_period_;
  return batch;
}

void StatusScheduler::TakeUnits(const FleetView& view, StatusBatch* batch) {
  moving_ = false;
  for (std::uint32_t n = 0; n < changed_.size(); ++n) {
    const UnitPhase phase = view.coordinator->unit({n}).phase;
    const bool moves = phase == UnitPhase::kMoving || phase == UnitPhase::kHoming;
    moving_ = moving_ || moves;
    if (moves || changed_[n] != 0) batch->units.push_back(SnapshotUnit(view, {n}));
    if (changed_[n] != 0)
      if (auto orientation = SnapshotOrientation(view, {n}))
        batch->orientations.push_back(std::move(*orientation));
    changed_[n] = 0;
  }
  any_changed_ = false;
}

void StatusScheduler::GiveBack(const StatusBatch& batch, const Layout& layout) {
  for (const UnitStatusValue& unit : batch.units)
    if (const auto i = layout.Find(unit.unit)) changed_[i->value] = 1;
  any_changed_ = any_changed_ || !batch.units.empty();
}

}  // namespace focalfleet
