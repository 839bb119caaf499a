#include "daemon/hall/spine_work.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "fleet/kinematics.h"
#include "sim/hall/spine.h"

namespace focalfleet {
namespace {

constexpr std::size_t kReadingsKept = 12;
// So many must agree for one of them to be found out: three angles and one number over.
constexpr int kSensorsMin = 5;
// chi^2 beyond which a reading contradicts itself: by its mean and so many standard deviations.
constexpr double kContradictionSigmas = 8;
constexpr double kAsGood_chi2 = 9;  // another branch
constexpr double kNearMm = 3;       // of where it is believed: blind errors are tenths
constexpr double kStillMm = 0.1;    // where it stood before, and it was sent farther than
constexpr double kSentMm = 1;
constexpr double kDegPerRad = 1 / sim::kRadPerDeg;

double Apart(PointFp a, PointFp b) { return std::hypot(a.x_mm - b.x_mm, a.y_mm - b.y_mm); }

// "missing v3 v4; saturated v1", or nothing.
std::string Unused(const sim::VoltageRow& row, const sim::HallReading& reading) {
  std::string missing, saturated;
  for (std::size_t k = 0; k < row.voltages_V.size(); ++k) {
    if ((reading.used >> k & 1u) != 0) continue;
    (std::isnan(row.voltages_V[k]) ? missing : saturated) += " v" + std::to_string(k + 1);
  }
  if (!missing.empty()) missing = "missing" + missing;
  if (!saturated.empty()) saturated = (missing.empty() ? "saturated" : "; saturated") + saturated;
  return missing + saturated;
}

}  // namespace

struct SpineWorker::Looked {
  SpineReading spine;
  sim::TipEstimate tip;  // where spine.solved
};

Result<std::unique_ptr<SpineWorker>> SpineWorker::Create(const Layout& layout,
                                                         const HallModelFile& model,
                                                         const Options& options) {
  std::unique_ptr<SpineWorker> worker(new SpineWorker(layout, options));
  worker->field_ = sim::MakeField(model.field);
  for (const Unit& unit : layout.units()) {
    const std::size_t sensors = unit.sensors;
    if (sensors == 0 || worker->solvers_.contains(sensors)) continue;
    if (sensors != 6 && sensors != 8)
      return Fail(ErrorCode::kInvalid, "unit " + std::to_string(unit.id.value) + " has " +
                                           std::to_string(sensors) +
                                           " sensors; sets of 6 and of 8 are known");
    FOCALFLEET_TRY_ASSIGN(sim::HallRig rig, RigOf(model, sim::SpineRig(sensors).sensors));
    worker->solvers_[sensors] = std::make_unique<sim::OrientationSolver>(
        std::move(rig), worker->field_,
        sim::OrientationSolver::Options{.tilt_max_rad = options.tilt_max_deg * sim::kRadPerDeg});
  }
  return worker;
}

SpineWorker::Looked SpineWorker::Look(PositionerIndex i, const sim::VoltageRow& row,
                                      PointFp believed_fp) {
  const Unit& unit = layout_.unit(i);
  const sim::OrientationSolver& solver = *solvers_.at(unit.sensors);
  const sim::HallReading reading = sim::ReadingOf(solver.rig(), row.voltages_V);
  Looked looked;
  SpineReading& spine = looked.spine;
  spine.used = static_cast<std::uint16_t>(reading.used);
  spine.verdict = Unused(row, reading);
  const auto say = [&](const std::string& what) {
    spine.verdict += (spine.verdict.empty() ? "" : "; ") + what;
  };
  if (std::popcount(reading.used) < kSensorsMin) {
    say("too few sensors");
    return looked;
  }
  const std::vector<sim::OrientationFit> fits = solver.Solve(reading);
  if (fits.empty()) {
    say("no orientation found");
    return looked;
  }
  const double noise_T2 = options_.noise_T * options_.noise_T;
  const auto tip_of = [&](const sim::OrientationFit& fit) {
    auto covariance = fit.unit_covariance;
    for (auto& line : covariance)
      for (double& entry : line) entry *= noise_T2;
    return sim::TipOf(fit.orientation, covariance, unit.spine_mm);
  };
  const auto away_mm = [&](const sim::OrientationFit& fit) {
    const sim::TipEstimate tip = tip_of(fit);
    return Apart({unit.base_fp.x_mm + tip.x_mm, unit.base_fp.y_mm + tip.y_mm}, believed_fp);
  };
  const auto as_good = [&](const sim::OrientationFit& fit) {
    return fit.squares_T2 <= fits.front().squares_T2 + kAsGood_chi2 * noise_T2;
  };
  const sim::OrientationFit* best = &fits.front();
  int near = 0, good = 0;
  for (const sim::OrientationFit& fit : fits) {
    if (!as_good(fit)) continue;
    ++good;
    if (away_mm(fit) >= kNearMm) continue;
    ++near;
    if (away_mm(fit) < away_mm(*best)) best = &fit;
  }
  const int freedom = best->sensors - 3;
  const double chi2 = best->squares_T2 / noise_T2;
  const bool contradicts = chi2 > freedom + kContradictionSigmas * std::sqrt(2.0 * freedom);
  spine.solved = true;
  const sim::Orientation& at = best->orientation;
  spine.angles_deg = {at.alpha_rad * kDegPerRad, at.beta_rad * kDegPerRad,
                      at.gamma_rad * kDegPerRad};
  std::size_t entry = 0;
  for (std::size_t a = 0; a < 3; ++a)
    for (std::size_t b = a; b < 3; ++b)
      spine.covariance_deg2[entry++] =
          best->unit_covariance[a][b] * noise_T2 * kDegPerRad * kDegPerRad;
  looked.tip = tip_of(*best);
  if (good > 1 && near != 1) say("ambiguous");
  spine.trusted = !contradicts && (good == 1 || near == 1);
  if (contradicts) say("cannot tell");  // Examine may know better
  if (spine.verdict.empty()) spine.verdict = "ok";
  return looked;
}

/// Which sensor lies, by all that is kept of the unit.
void SpineWorker::Examine(PositionerIndex i, SpineReading* spine, int* examined) {
  if (++*examined > kDoubtsExamined) return;
  const sim::OrientationSolver& solver = *solvers_.at(layout_.unit(i).sensors);
  const std::deque<sim::VoltageRow>& kept = history_[i.value];
  const sim::Estimates estimates = sim::EstimateOrientations(
      solver.rig(), field_, {kept.begin(), kept.end()},
      {.tilt_max_rad = options_.tilt_max_deg * sim::kRadPerDeg, .noise_T = options_.noise_T});
  const std::string& status = estimates.rows.back().status;
  if (status != "ok") spine->verdict = status;
}

Sighting SpineWorker::SightingOf(PositionerIndex i, const ExposureJob& job, const UnitDrive& drive,
                                 int* examined) {
  const Unit& unit = layout_.unit(i);
  const SensorReading& reading = job.readings[i.value];
  const sim::OrientationSolver& solver = *solvers_.at(unit.sensors);
  sim::VoltageRow row;
  row.voltages_V = sim::VoltagesOf({reading.counts.data(), unit.sensors}, solver.rig().electronics);
  std::deque<sim::VoltageRow>& kept = history_[i.value];
  kept.push_back(row);
  if (kept.size() > kReadingsKept) kept.pop_front();

  const UnitKnowledge& believed = job.expected[i.value];
  const bool has_place = IsPlace(believed);
  const PointFp believed_fp = has_place ? FibreAt(unit, drive, PlaceOf(believed)) : unit.base_fp;
  Looked looked = Look(i, row, believed_fp);
  const bool enough = std::popcount(looked.spine.used) >= kSensorsMin;
  if (enough && !looked.spine.trusted) Examine(i, &looked.spine, examined);
  Sighting sighting{.unit = i,
                    .status = SightingStatus::kSensorsDoubted,
                    .source = SightingSource::kSensors,
                    .other = {},
                    .covariance = {},
                    .place = {}};
  sighting.spine = std::move(looked.spine);
  if (!sighting.spine->trusted) return sighting;
  const sim::TipEstimate& tip = looked.tip;
  sighting.x_mm = unit.base_fp.x_mm + tip.x_mm;
  sighting.y_mm = unit.base_fp.y_mm + tip.y_mm;
  sighting.covariance = {tip.var_x_mm2, tip.cov_xy_mm2, tip.var_y_mm2};
  const double sigma_um = SigmaUm(sighting.covariance);
  sighting.status = SightingStatus::kMeasured;
  if (2 * sigma_um > job.tolerance_um) sighting.status = SightingStatus::kTooCoarse;
  if (sighting.status != SightingStatus::kMeasured || !has_place) return sighting;
  const PointFp seen_fp{sighting.x_mm, sighting.y_mm};
  sighting.place =
      PlaceSeen(unit, drive, seen_fp, PlaceOf(believed), {.sigma_mm = 1e-3 * sigma_um});
  if (!sighting.place) sighting.status = SightingStatus::kOutsidePatrol;
  const std::optional<Pose>& before = job.before[i.value];
  if (!before) return sighting;
  const PointFp before_fp = FibreAt(unit, drive, *before);
  if (Apart(seen_fp, before_fp) < kStillMm && Apart(believed_fp, before_fp) > kSentMm)
    sighting.status = SightingStatus::kDidNotMove;
  return sighting;
}

std::vector<Sighting> SpineWorker::Measure(const ExposureJob& job,
                                           std::span<const UnitDrive> drives) {
  std::vector<Sighting> sightings;
  int examined = 0;
  for (std::uint32_t n = 0; n < job.readings.size(); ++n)
    if (job.readings[n].sensors != 0 && job.readings[n].sensors == layout_.unit({n}).sensors)
      sightings.push_back(SightingOf({n}, job, drives[n], &examined));
  return sightings;
}

}  // namespace focalfleet
