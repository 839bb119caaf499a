#include "daemon/hall/fibre_carrier_work.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "fleet/kinematics.h"
#include "sim/hall/fibre_carrier.h"

namespace focalfleet {
namespace {

constexpr std::size_t kReadingsKept = 12;
// Fewest sensors for a position. If one of the five is wrong, the other four still give three
// angles and one check.
constexpr int kSensorsMin = 5;
// A reading contradicts itself where its chi^2 exceeds the expected value by this many standard
// deviations.
constexpr double kContradictionSigmas = 8;
constexpr double kAsGood_chi2 = 9;  // excess of chi^2 up to which another branch fits as well
constexpr double kNearMm = 3;  // from the believed position; open-loop errors are tenths of a mm
// A unit has not moved if it is this near to its old position though sent farther than kSentMm.
constexpr double kStillMm = 0.1;
constexpr double kSentMm = 1;
constexpr double kDegPerRad = 1 / sim::kRadPerDeg;

double Apart(PointFp a, PointFp b) { return std::hypot(a.x_mm - b.x_mm, a.y_mm - b.y_mm); }

// Text such as "missing v3 v4; saturated v1"; empty where all sensors were used.
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

struct FibreCarrierWorker::Looked {
  FibreCarrierReading carrier;
  sim::TipEstimate tip;  // valid where fibre carrier.solved
};

Result<std::unique_ptr<FibreCarrierWorker>> FibreCarrierWorker::Create(const Layout& layout,
                                                                       const HallModelFile& model,
                                                                       const Options& options) {
  std::unique_ptr<FibreCarrierWorker> worker(new FibreCarrierWorker(layout, options));
  worker->field_ = sim::MakeField(model.field);
  for (const Unit& unit : layout.units()) {
    const std::size_t sensors = unit.sensors;
    if (sensors == 0 || worker->solvers_.contains(sensors)) continue;
    if (sensors != 6 && sensors != 8)
      return Fail(ErrorCode::kInvalid, "unit " + std::to_string(unit.id.value) + " has " +
                                           std::to_string(sensors) +
                                           " sensors; sets of 6 and of 8 are known");
    FOCALFLEET_TRY_ASSIGN(sim::HallRig rig, RigOf(model, sim::FibreCarrierRig(sensors).sensors));
    worker->solvers_[sensors] = std::make_unique<sim::OrientationSolver>(
        std::move(rig), worker->field_,
        sim::OrientationSolver::Options{.tilt_max_rad = options.tilt_max_deg * sim::kRadPerDeg});
  }
  return worker;
}

FibreCarrierWorker::Looked FibreCarrierWorker::Look(PositionerIndex i, const sim::VoltageRow& row,
                                                    PointFp believed_fp) {
  const Unit& unit = layout_.unit(i);
  const sim::OrientationSolver& solver = *solvers_.at(unit.sensors);
  const sim::HallReading reading = sim::ReadingOf(solver.rig(), row.voltages_V);
  Looked looked;
  FibreCarrierReading& carrier = looked.carrier;
  carrier.used = static_cast<std::uint16_t>(reading.used);
  carrier.verdict = Unused(row, reading);
  const auto add_verdict = [&](const std::string& what) {
    carrier.verdict += (carrier.verdict.empty() ? "" : "; ") + what;
  };
  if (std::popcount(reading.used) < kSensorsMin) {
    add_verdict("too few sensors");
    return looked;
  }
  const std::vector<sim::OrientationFit> fits = solver.Solve(reading);
  if (fits.empty()) {
    add_verdict("no orientation found");
    return looked;
  }
  const double noise_T2 = options_.noise_T * options_.noise_T;
  const auto tip_of = [&](const sim::OrientationFit& fit) {
    auto covariance = fit.unit_covariance;
    for (auto& line : covariance)
      for (double& entry : line) entry *= noise_T2;
    return sim::TipOf(fit.orientation, covariance, unit.carrier_mm);
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
  carrier.solved = true;
  const sim::Orientation& at = best->orientation;
  carrier.angles_deg = {at.alpha_rad * kDegPerRad, at.beta_rad * kDegPerRad,
                        at.gamma_rad * kDegPerRad};
  std::size_t entry = 0;
  for (std::size_t a = 0; a < 3; ++a)
    for (std::size_t b = a; b < 3; ++b)
      carrier.covariance_deg2[entry++] =
          best->unit_covariance[a][b] * noise_T2 * kDegPerRad * kDegPerRad;
  looked.tip = tip_of(*best);
  if (good > 1 && near != 1) add_verdict("ambiguous");
  carrier.trusted = !contradicts && (good == 1 || near == 1);
  if (contradicts) add_verdict("cannot tell");  // Examine may find the sensor
  if (carrier.verdict.empty()) carrier.verdict = "ok";
  return looked;
}

/// Finds which sensor is wrong, from all readings that are kept of the unit.
void FibreCarrierWorker::Examine(PositionerIndex i, FibreCarrierReading* carrier, int* examined) {
  if (++*examined > kDoubtsExamined) return;
  const sim::OrientationSolver& solver = *solvers_.at(layout_.unit(i).sensors);
  const std::deque<sim::VoltageRow>& kept = history_[i.value];
  const sim::Estimates estimates = sim::EstimateOrientations(
      solver.rig(), field_, {kept.begin(), kept.end()},
      {.tilt_max_rad = options_.tilt_max_deg * sim::kRadPerDeg, .noise_T = options_.noise_T});
  const std::string& status = estimates.rows.back().status;
  if (status != "ok") carrier->verdict = status;
}

Measurement FibreCarrierWorker::MeasurementOf(PositionerIndex i, const ExposureJob& job,
                                              const UnitDrive& drive, int* examined) {
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
  const bool enough = std::popcount(looked.carrier.used) >= kSensorsMin;
  if (enough && !looked.carrier.trusted) Examine(i, &looked.carrier, examined);
  Measurement measurement{.unit = i,
                          .status = MeasurementStatus::kSensorsDoubted,
                          .source = MeasurementSource::kSensors,
                          .other = {},
                          .covariance = {},
                          .place = {}};
  measurement.carrier = std::move(looked.carrier);
  if (!measurement.carrier->trusted) return measurement;
  const sim::TipEstimate& tip = looked.tip;
  measurement.x_mm = unit.base_fp.x_mm + tip.x_mm;
  measurement.y_mm = unit.base_fp.y_mm + tip.y_mm;
  measurement.covariance = {tip.var_x_mm2, tip.cov_xy_mm2, tip.var_y_mm2};
  const double sigma_um = SigmaUm(measurement.covariance);
  measurement.status = MeasurementStatus::kMeasured;
  if (2 * sigma_um > job.tolerance_um) measurement.status = MeasurementStatus::kTooCoarse;
  if (measurement.status != MeasurementStatus::kMeasured || !has_place) return measurement;
  const PointFp seen_fp{measurement.x_mm, measurement.y_mm};
  measurement.place =
      PlaceSeen(unit, drive, seen_fp, PlaceOf(believed), {.sigma_mm = 1e-3 * sigma_um});
  if (!measurement.place) measurement.status = MeasurementStatus::kOutsidePatrol;
  const std::optional<Pose>& before = job.before[i.value];
  if (!before) return measurement;
  const PointFp before_fp = FibreAt(unit, drive, *before);
  if (Apart(seen_fp, before_fp) < kStillMm && Apart(believed_fp, before_fp) > kSentMm)
    measurement.status = MeasurementStatus::kDidNotMove;
  return measurement;
}

std::vector<Measurement> FibreCarrierWorker::Measure(const ExposureJob& job,
                                                     std::span<const UnitDrive> drives) {
  std::vector<Measurement> measurements;
  int examined = 0;
  for (std::uint32_t n = 0; n < job.readings.size(); ++n)
    if (job.readings[n].sensors != 0 && job.readings[n].sensors == layout_.unit({n}).sensors)
      measurements.push_back(MeasurementOf({n}, job, drives[n], &examined));
  return measurements;
}

}  // namespace focalfleet
