#include "daemon/plane/plane_page.h"

#include <algorithm>
#include <utility>

#include "daemon/page/plan_motion.h"
#include "daemon/plane/plane_table.h"

namespace focalfleet {

PlanePage::PlanePage(const PlaneLayout* plane, std::size_t viewers_max)
    : plane_(*plane),
      silent_(plane->sectors()),
      feed_({.layout = &plane->layout(), .viewers_max = viewers_max}) {
  for (std::uint32_t n = 0; n < plane->layout().size(); ++n)
    sector_of_.push_back(plane->SectorOf({n}));
}

void PlanePage::Take(const StatusUpdate& update) {
  if (update.units.empty() && update.buses.empty()) return;
  StatusBatch batch;
  batch.units = update.units;
  batch.buses = update.buses;
  feed_.Take(batch);
}

void PlanePage::Take(const PlaneInstant& plane, const FleetStatusValue& fleet,
                     const ConfigurationProgressValue& configuration) {
  StatusBatch batch;
  batch.fleet = fleet;
  batch.configuration = configuration;
  const PlaneView& view = plane.coordinator->view();
  if (std::exchange(configuration_, view.configuration) != view.configuration) makespan_s_ = 0;
  if (view.state == ConfigurationState::kMoving && view.start_at != kNever)
    makespan_s_ = std::max(makespan_s_, (plane.now - view.start_at).seconds());
  batch.makespan_s = makespan_s_;
  for (std::uint32_t sector = 0; sector < silent_.size(); ++sector) {
    const std::uint8_t silent = plane.table->IsSilent(sector, plane.steady) ? 1 : 0;
    if (std::exchange(silent_[sector], silent) == silent) continue;
    for (const PositionerIndex i : plane_.own(sector)) {
      const UnitStatusValue* known = plane.table->unit(i);
      UnitStatusValue unit = known != nullptr && silent == 0 ? *known : UnitStatusValue{};
      unit.unit = plane_.layout().unit(i).id;
      if (silent != 0) unit.phase = UnitPhase::kSilent;
      batch.units.push_back(unit);
    }
  }
  night_.Take(batch);
  feed_.Take(batch);
}

void PlanePage::KeepPreview(const PlanJob& job, const Plan& plan,
                            std::span<const UnitDrive> drives) {
  if (plan.moves.empty()) return;
  night_.TakePreview(job.job, PowerOverTime(plan, job, plane_.layout(), drives));
  plans_.PutPreview(job.job, EncodeMotion(plan, plane_.layout(), drives));
}

PageParts PlanePage::parts() {
  return {.layout = &plane_.layout(),
          .sectors = sector_of_,
          .feed = &feed_,
          .plans = &plans_,
          .night = &night_};
}

}  // namespace focalfleet
