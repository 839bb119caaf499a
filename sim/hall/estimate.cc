#include "sim/hall/estimate.h"

#include <algorithm>
#include <limits>

#include "sim/hall/median.h"
#include "sim/hall/suspicion.h"

namespace focalfleet::sim {
namespace {

constexpr double kUsualNoise_T = 5e-4;
constexpr double kLeastNoise_T = 1e-6;
constexpr double kLeastContradiction_T = 1e-4;  // a model of good data may err by less
constexpr std::size_t kRowsForNoise = 20;
constexpr double kBranchChi2 = 9;      // as good within 3 standard deviations
constexpr double kContradiction = 30;  // of chi^2 a degree of freedom
constexpr double kBeyond_V = 0.01;

bool BeyondSupply(const std::vector<VoltageRow>& rows, const SensorElectronics& electronics) {
  for (const VoltageRow& row : rows)
    for (const double voltage_V : row.voltages_V)
      if (voltage_V < -kBeyond_V || voltage_V > electronics.supply_V + kBeyond_V) return true;
  return false;
}

void Append(std::string* text, const std::string& part) {
  *text += (text->empty() ? "" : "; ") + part;
}

std::string SensorName(std::size_t sensor) { return "v" + std::to_string(sensor + 1); }

// The faults of single sensors in this row: a sensor is missing, or at the end of its range.
std::string OfSensors(const HallRig& rig, const VoltageRow& row, bool magnitudes) {
  std::string saturated, missing;
  for (std::size_t k = 0; k < row.voltages_V.size(); ++k) {
    if (std::isnan(row.voltages_V[k]))
      missing += " " + SensorName(k);
    else if (!magnitudes && !Field_T(rig.sensors[k], rig.electronics, row.voltages_V[k]))
      saturated += " " + SensorName(k);
  }
  std::string text;
  if (!saturated.empty()) Append(&text, "saturated" + saturated);
  if (!missing.empty()) Append(&text, "missing" + missing);
  return text;
}

// The median of chi^2 a degree of freedom is below 1 (Wilson and Hilferty).
double MedianShare(int freedom) {
  const double part = 1 - 2.0 / (9.0 * freedom);
  return part * part * part;
}

double NoiseOf(const std::vector<std::vector<OrientationFit>>& fits) {
  std::vector<double> variances;
  for (const auto& branches : fits) {
    if (branches.empty() || branches.front().sensors < 4) continue;
    const int freedom = branches.front().sensors - 3;
    variances.push_back(branches.front().squares_T2 / freedom / MedianShare(freedom));
  }
  return std::sqrt(Median(std::move(variances)));
}

class RowJudge {
 public:
  RowJudge(const OrientationSolver& solver, double noise_T) : solver_(solver), noise_T_(noise_T) {}

  // The voltages of one row contradict each other: the function asks whether one sensor is to
  // blame.
  [[nodiscard]] std::vector<OrientationFit> Judge(const HallReading& reading,
                                                  std::vector<OrientationFit> fits,
                                                  std::string* status) const {
    if (fits.empty() || !Contradicts(fits.front())) return fits;
    std::vector<std::size_t> blamed;
    std::vector<OrientationFit> without;
    for (std::size_t k = 0; k < solver_.rig().sensors.size(); ++k) {
      if ((reading.used >> k & 1u) == 0 || fits.front().sensors < 6) continue;
      HallReading rest = reading;
      rest.used &= ~(1u << k);
      std::vector<OrientationFit> trial = solver_.Solve(rest);
      if (trial.empty() || Contradicts(trial.front())) continue;
      blamed.push_back(k);
      without = std::move(trial);
    }
    if (blamed.size() == 1) {
      Append(status, "bad " + SensorName(blamed.front()));
      return without;
    }
    Append(status, "cannot tell");
    return fits;
  }

 private:
  [[nodiscard]] bool Contradicts(const OrientationFit& fit) const {
    const int freedom = fit.sensors - 3;
    return freedom > 0 && fit.squares_T2 > kContradiction * freedom * noise_T_ * noise_T_;
  }

  const OrientationSolver& solver_;
  double noise_T_;
};

RowEstimate RowOf(const std::vector<OrientationFit>& found, double noise_T, std::string status) {
  RowEstimate row;
  row.status = std::move(status);
  if (found.empty()) return row;
  const OrientationFit& best = found.front();
  row.solved = true;
  row.orientation = best.orientation;
  for (std::size_t k = 0; k < 3; ++k)
    row.sd_rad[k] = noise_T * std::sqrt(best.unit_covariance[k][k]);
  const double close_T2 = best.squares_T2 + kBranchChi2 * noise_T * noise_T;
  row.branches = static_cast<std::size_t>(
      std::count_if(found.begin(), found.end(),
                    [&](const OrientationFit& other) { return other.squares_T2 <= close_T2; }));
  if (row.branches > 1) Append(&row.status, "ambiguous");
  if (row.status.empty()) row.status = "ok";
  return row;
}

}  // namespace

std::string_view Name(SensorFault fault) {
  switch (fault) {
    case SensorFault::kMissing:
      return "missing";
    case SensorFault::kStuck:
      return "stuck";
    case SensorFault::kSwapped:
      return "swapped";
    case SensorFault::kGain:
      return "gain";
    case SensorFault::kOffset:
      return "offset";
    case SensorFault::kBad:
      return "bad";
  }
  return "";
}

Estimates EstimateOrientations(HallRig rig, const std::shared_ptr<const FieldModel>& field,
                               const std::vector<VoltageRow>& rows,
                               const EstimateOptions& options) {
  Estimates out;
  out.beyond_supply = BeyondSupply(rows, rig.electronics);
  if (out.beyond_supply || options.magnitudes) rig.electronics.clips = false;
  const OrientationSolver solver(
      rig, field, {.magnitudes = options.magnitudes, .tilt_max_rad = options.tilt_max_rad});
  const double zero_V = options.magnitudes ? rig.electronics.zero_V() : 0;
  std::vector<HallReading> readings;
  for (const VoltageRow& row : rows) {
    const double warm =
        std::isnan(row.temperature_C) ? 0 : row.temperature_C - rig.temperature_reference_C;
    std::vector<double> voltages_V = row.voltages_V;
    for (double& voltage_V : voltages_V) voltage_V += zero_V;
    readings.push_back(ReadingOf(rig, voltages_V, 1 + rig.temperature_per_K * warm));
  }
  const double usual_T = options.noise_T > 0 ? options.noise_T : kUsualNoise_T;
  out.verdicts = SuspectSensors(solver, rows, &readings, usual_T);

  std::vector<std::vector<OrientationFit>> fits;
  fits.reserve(readings.size());
  for (const HallReading& reading : readings) fits.push_back(solver.Solve(reading));
  out.noise_from_residuals = options.noise_T <= 0 && rows.size() >= kRowsForNoise;
  out.noise_T = std::max(kLeastNoise_T, out.noise_from_residuals ? NoiseOf(fits) : usual_T);

  std::string of_all;
  for (const SensorVerdict& verdict : out.verdicts) {
    if (verdict.fault == SensorFault::kMissing) continue;  // reported in each row
    std::string word(Name(verdict.fault));
    for (const std::size_t sensor : verdict.sensors) word += " " + SensorName(sensor);
    const bool pairs = verdict.fault == SensorFault::kSwapped;
    for (std::size_t k = 0; k < verdict.or_else.size(); ++k)
      word += (pairs && k % 2 == 1 ? " " : " or ") + SensorName(verdict.or_else[k]);
    Append(&of_all, word);
  }
  const RowJudge judge(solver, std::max(out.noise_T, kLeastContradiction_T));
  for (std::size_t r = 0; r < rows.size(); ++r) {
    std::string status = OfSensors(rig, rows[r], options.magnitudes);
    if (!of_all.empty()) Append(&status, of_all);
    const auto found = judge.Judge(readings[r], std::move(fits[r]), &status);
    if (found.empty())
      Append(&status,
             __builtin_popcount(readings[r].used) < 3 ? "too few sensors" : "no orientation found");
    out.rows.push_back(RowOf(found, out.noise_T, std::move(status)));
  }
  return out;
}

}  // namespace focalfleet::sim
