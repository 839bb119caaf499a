#include "tests/scenario/delayed_parts.h"

#include <utility>

#include "fleet/camera/findings.h"
#include "fleet/kinematics.h"
#include "fleet/plan/job.h"

namespace focalfleet::test {

void DelayedStore::Put(HostInstant now, const Effects& effects) {
  if (!effects.rows.empty()) waiting_.push_back({now + delay_, effects.batch, effects.rows});
}

void DelayedStore::CommitDue(HostInstant now) {
  while (!fails && !waiting_.empty() && waiting_.front().at <= now) {
    Batch& next = waiting_.front();
    for (std::size_t k = next.rows.size(); refuse && k-- > 0;) {
      if (!refuse(next.rows[k])) continue;
      refused_.push_back({next.number, next.number, next.rows[k], "the test refuses it"});
      next.rows.erase(next.rows.begin() + static_cast<std::ptrdiff_t>(k));
    }
    for (RefusedRow& row : memory_.CommitAllBut(next.number, next.rows))
      refused_.push_back(std::move(row));
    committed_through_ = next.number;
    waiting_.pop_front();
  }
}

void DelayedStore::CommitAll(const Effects& last) {
  for (const Batch& batch : waiting_) memory_.CommitAllBut(batch.number, batch.rows);
  memory_.CommitAllBut(last.batch, last.rows);
}

void DelayedStore::Restart() {
  waiting_.clear();
  refused_.clear();
  committed_through_ = 0;
}

HostInstant DelayedStore::due() const {
  return fails || waiting_.empty() ? kNever : waiting_.front().at;
}

std::vector<RefusedRow> DelayedStore::TakeRefused() { return std::exchange(refused_, {}); }

std::vector<PlanDone> DelayedPlanner::TakeDue(HostInstant now, const Layout& layout,
                                              std::span<const UnitDrive> drives) {
  std::vector<PlanDone> done;
  for (; due() <= now; waiting_.pop_front()) {
    done.push_back(fails ? PlanFailed(waiting_.front().job,
                                      {ErrorCode::kUnavailable, "the planner failed: no memory"})
                         : RunPlanJob(waiting_.front().job, layout, drives));
    if (done.back().plan) last_plan_ = *done.back().plan;
  }
  return done;
}

std::vector<ExposureDone> DelayedCamera::TakeDue(HostInstant now, const Layout& layout,
                                                 std::span<const UnitDrive> drives,
                                                 const sim::World& world) {
  std::vector<ExposureDone> done;
  for (; due() <= now; waiting_.pop_front()) {
    done.push_back(Expose(waiting_.front().job, layout, drives, world));
    if (fault) fault(&done.back());
  }
  return done;
}

// Other tests judge whether a camera sees fibres and tells them apart.
ExposureDone DelayedCamera::Expose(const ExposureJob& job, const Layout& layout,
                                   std::span<const UnitDrive> drives, const sim::World& world) {
  if (measurer) return measurer(job);
  const std::vector<UnitExpectation> expected = Expect(layout, {.now = job.expected,
                                                                .before = job.before,
                                                                .seen = job.seen,
                                                                .reported = job.reported,
                                                                .drives = drives});
  ExposureFindings exposure{
      .id = job.id, .measurements = {}, .after_request_s = options_.delay.seconds()};
  for (std::uint32_t n = 0; n < layout.size(); ++n) {
    const sim::UnitTruth truth = world.Truth(n);
    const double noise_mm = 1e-3 * options_.centroid_sigma_um;
    Measurement measurement{.unit = {n},
                            .status = MeasurementStatus::kMeasured,
                            .other = {},
                            .x_mm = truth.x_mm + noise_mm * noise_.Normal(),
                            .y_mm = truth.y_mm + noise_mm * noise_.Normal(),
                            .covariance = RoundCovariance(options_.centroid_sigma_um),
                            .place = {}};
    const PointFp seen{measurement.x_mm, measurement.y_mm};
    if (IsPlace(job.expected[n]))
      measurement.place = PlaceSeen(layout.units()[n], drives[n], seen, PlaceOf(job.expected[n]));
    else
      measurement.place = PoseOfLost(layout.units()[n], drives[n], seen, expected[n],
                                     options_.centroid_sigma_um * 1e-3, layout.clearance_mm());
    exposure.measurements.push_back(measurement);
  }
  return {job.id, std::move(exposure)};
}

}  // namespace focalfleet::test
