#include "sim/hall/diagnosis/hall_diagnosis.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "sim/hall/diagnosis/calibration.h"
#include "sim/hall/diagnosis/findings.h"
#include "sim/hall/diagnosis/selection.h"
#include "sim/hall/median.h"
#include "sim/hall/suspicion.h"

namespace focalfleet::sim {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr std::size_t kRowsMin = 15;
constexpr std::size_t kSpareReadings = 60;  // beyond the parameters
constexpr double kMove_V = 0.1;
constexpr double kSwapLeaves = 0.3;  // of the squares
constexpr int kPassesMax = 8;
constexpr double kPosesSpread_rad = 0.5 * kRadPerDeg;
// The margin by which an effect outside of the causes has to be the better explanation, in 2 ln L
// less ln n a number. The margin is that of every rival, plus an allowance for the some 140 effects
// tried.
constexpr double kOutsideMargin = 9 + 10;

struct SensorColumn {
  std::size_t count = 0;
  double range_V = 0;
};
SensorColumn ColumnOf(const HallCampaign& campaign, std::size_t sensor) {
  double low = 1e300, high = -1e300;
  SensorColumn column;
  for (const VoltageRow& row : campaign.rows)
    if (std::isfinite(row.voltages_V[sensor])) {
      low = std::min(low, row.voltages_V[sensor]);
      high = std::max(high, row.voltages_V[sensor]);
      ++column.count;
    }
  if (column.count > 0) column.range_V = high - low;
  return column;
}

// The readings that can be used, without sensors that give none.
std::vector<Reading> Usable(const HallCampaign& campaign, const HallRig& rig, HallDiagnosis* out) {
  std::vector<Reading> readings;
  bool beyond = false;
  std::vector<double> ranges;
  for (std::size_t s = 0; s < rig.sensors.size(); ++s)
    ranges.push_back(ColumnOf(campaign, s).range_V);
  for (const VoltageRow& row : campaign.rows)
    for (const double voltage_V : row.voltages_V)
      beyond = beyond || voltage_V < -0.01 || voltage_V > rig.electronics.supply_V + 0.01;
  SensorElectronics electronics = rig.electronics;
  if (beyond) electronics.clips = false;
  std::vector<double> sorted = ranges;
  std::sort(sorted.begin(), sorted.end());
  const bool others_move = sorted[sorted.size() / 2] > kMove_V;
  for (std::size_t s = 0; s < rig.sensors.size(); ++s) {
    const SensorColumn column = ColumnOf(campaign, s);
    const bool missing = column.count == 0;
    if (missing || (others_move && column.range_V < kAlike_V)) {
      out->troubles.push_back({missing ? "missing" : "stuck", {s}});
      out->outliers[(missing ? "missing v" : "stuck v") + std::to_string(s + 1)] =
          campaign.rows.size();
      out->outlier_rows = campaign.rows.size();
      continue;
    }
    for (std::size_t r = 0; r < campaign.rows.size(); ++r) {
      const double voltage_V = campaign.rows[r].voltages_V[s];
      if (!std::isfinite(voltage_V))
        ++out->outliers["missing"];
      else if (!Field_T({}, electronics, voltage_V))
        ++out->outliers["saturated"];
      else
        readings.push_back({r, s});
    }
  }
  return readings;
}

std::string Insufficient(const HallCampaign& campaign, const std::vector<Reading>& readings,
                         std::size_t parameters) {
  std::set<std::size_t> rows;
  std::set<std::size_t> sensors;
  for (const Reading& reading : readings) {
    rows.insert(reading.row);
    sensors.insert(reading.sensor);
  }
  if (rows.size() < kRowsMin)
    return std::to_string(rows.size()) + " poses with usable voltages, at least " +
           std::to_string(kRowsMin) + " are needed";
  if (sensors.size() < 4) return "fewer than four sensors say anything";
  if (readings.size() < parameters + kSpareReadings)
    return std::to_string(readings.size()) + " usable voltages, " +
           std::to_string(parameters + kSpareReadings) +
           " are needed to try every cause and know the noise";
  const auto spread = [&](auto angle) {
    double low = 1e9, high = -1e9;
    for (const std::size_t row : rows) {
      low = std::min(low, angle(campaign.poses[row]));
      high = std::max(high, angle(campaign.poses[row]));
    }
    return high - low;
  };
  if (spread([](const Orientation& o) { return o.alpha_rad; }) < kPosesSpread_rad &&
      spread([](const Orientation& o) { return o.beta_rad; }) < kPosesSpread_rad)
    return "the poses do not tilt: alpha and beta stay within 0.5 deg";
  return {};
}

// Two columns are exchanged where that removes most of the misfit.
void FindSwaps(const HallForward& forward, const HallRig& rig, HallCampaign* campaign,
               HallSearch* search, HallDiagnosis* out) {
  for (int round = 0; round < 2; ++round) {
    const HallFit fit = search->Free();
    std::vector<std::size_t> best;
    double least = kSwapLeaves * fit.squares;
    for (std::size_t one = 0; one < rig.sensors.size(); ++one)
      for (std::size_t two = one + 1; two < rig.sensors.size(); ++two) {
        double squares = 0;
        VectorXd predicted;
        std::vector<Reading> exchanged = search->readings();
        for (Reading& reading : exchanged)
          reading.sensor = reading.sensor == one   ? two
                           : reading.sensor == two ? one
                                                   : reading.sensor;
        forward.Predict(fit.parameters, exchanged, &predicted);
        squares = (search->measured_V() - predicted).squaredNorm();
        if (squares < least) {
          least = squares;
          best = {one, two};
        }
      }
    if (best.empty()) return;
    for (VoltageRow& row : campaign->rows)
      std::swap(row.voltages_V[best[0]], row.voltages_V[best[1]]);
    std::vector<Reading> readings = search->readings();
    for (Reading& reading : readings)
      reading.sensor = reading.sensor == best[0]   ? best[1]
                       : reading.sensor == best[1] ? best[0]
                                                   : reading.sensor;
    search->set_readings(std::move(readings));
    search->TakeMeasured();
    out->troubles.push_back({"swapped", best});
    out->outliers["swapped v" + std::to_string(best[0] + 1) + " v" + std::to_string(best[1] + 1)] =
        campaign->rows.size();
    out->outlier_rows = campaign->rows.size();
  }
}

// Drops single readings that nothing in the library comes near to. A reading that is far enough off
// pulls the fit, so that its neighbours seem far off. Therefore only those of the size of the worst
// go at a time.
bool DropFarOff(const Selected& selected, HallSearch* search, HallDiagnosis* out) {
  HallFit fit = selected.fit;
  std::size_t dropped = 0;
  for (int pass = 0; pass < kPassesMax; ++pass) {
    const Eigen::VectorXd residuals = search->AllFree(fit).residuals;
    std::vector<double> sizes;
    for (Index k = 0; k < residuals.size(); ++k) sizes.push_back(std::abs(residuals[k]));
    const double worst_V = *std::max_element(sizes.begin(), sizes.end());
    const double limit_V = std::max(kFarOff * 1.4826 * Median(sizes) + 1e-6, worst_V / 2);
    std::vector<Reading> kept;
    for (std::size_t k = 0; k < sizes.size(); ++k)
      if (sizes[k] <= limit_V) kept.push_back(search->readings()[k]);
    const std::size_t now = sizes.size() - kept.size();
    // Many readings that are far off are structure and no accidents.
    if (now == 0 || (dropped + now) * 20 > sizes.size()) break;
    dropped += now;
    search->set_readings(std::move(kept));
    search->TakeMeasured();
    fit = search->Fit(selected.on, fit.parameters);
  }
  if (dropped > 0) out->outliers["far off"] += dropped;
  return dropped > 0;
}

double PenalisedSquares(const Selected& selected, double variance, std::size_t readings) {
  return selected.fit.squares / variance +
         static_cast<double>(selected.fit.free.size()) * std::log(static_cast<double>(readings));
}

}  // namespace

const char* Name(HallVerdict verdict) {
  switch (verdict) {
    case HallVerdict::kConsistent:
      return "consistent";
    case HallVerdict::kExplained:
      return "explained";
    case HallVerdict::kAmbiguous:
      return "ambiguous";
    case HallVerdict::kUnknown:
      return "unknown";
    case HallVerdict::kInsufficient:
      return "insufficient";
  }
  return "";
}

HallDiagnosis DiagnoseHall(const HallCampaign& given, const HallRig& rig, const FieldModel& field) {
  HallCampaign campaign = given;
  HallDiagnosis out;
  const HallForward forward(campaign, rig, field);
  out.layout = forward.layout();
  out.parameters = VectorXd::Zero(static_cast<Index>(out.layout.size()));
  out.sd = out.parameters;
  if (!campaign.has_temperature)
    out.not_testable.emplace_back(HallCause::kTemperatureCoefficient,
                                  "the column temp_C is missing");
  std::vector<Reading> readings = Usable(campaign, rig, &out);
  out.missing = Insufficient(campaign, readings, out.layout.size());
  if (!out.missing.empty()) {
    out.next_poses = ProposePoses(forward, out.parameters, readings, 25 * 5e-4);
    return out;
  }

  HallSearch search(forward, campaign, std::move(readings));
  FindSwaps(forward, rig, &campaign, &search, &out);
  Selected selected = SelectHall(search);
  // Two rounds at most: without the far readings the noise is smaller.
  for (int round = 0; round < 2; ++round) {
    if (!DropFarOff(selected, &search, &out)) break;
    selected = SelectHall(search);
  }
  out.readings = search.readings();
  out.noise_V = std::sqrt(selected.variance);
  const HallForward wider(campaign, rig, field,
                          OutsideEffects(rig.sensors.size(), campaign.has_temperature));
  HallSearch with_others(wider, campaign, search.readings());
  const Selected other = SelectHall(with_others);
  const double variance = std::min(selected.variance, other.variance);
  const std::size_t n = search.readings().size();
  const bool outside = PenalisedSquares(other, variance, n) + kOutsideMargin <
                       PenalisedSquares(selected, variance, n);
  if (outside)
    AddFindings(wider, campaign, with_others, other, &out);
  else
    AddFindings(forward, campaign, search, selected, &out);
  out.verdict = HallVerdict::kConsistent;
  if (!out.causes.empty() || !out.troubles.empty()) out.verdict = HallVerdict::kExplained;
  for (const HallCauseFound& cause : out.causes)
    if (cause.candidates.size() > 1) out.verdict = HallVerdict::kAmbiguous;
  if (!out.unknown.empty()) out.verdict = HallVerdict::kUnknown;
  if (out.verdict == HallVerdict::kAmbiguous || out.verdict == HallVerdict::kUnknown)
    out.next_poses =
        ProposePoses(forward, out.parameters.head(static_cast<Index>(forward.layout().size())),
                     out.readings, out.noise_V);
  return out;
}

}  // namespace focalfleet::sim
