#include "sim/hall/diagnosis/calibration.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

namespace focalfleet::sim {
namespace {

using Eigen::Index;
using Eigen::Matrix4d;
using Eigen::MatrixXd;
using Eigen::Vector4d;
using Eigen::VectorXd;

constexpr std::size_t kReadingsMin = 12;
constexpr int kSteps = 60;
constexpr int kPasses = 4;
constexpr double kHuber = 2;  // of robust standard deviations; larger residuals pull no harder
constexpr std::size_t kFarOffMost = 8;  // one in this many; more is structure
constexpr double kFollows = 5;          // standard deviations of a gain that is not chance
constexpr double kContradicts = 3;      // times the residual of the median sensor
constexpr double kNoiseLeast_V = 1e-6;
// A place less certain than this counts as unknown.
constexpr double kReported_rad = 10 * kRadPerDeg;
constexpr double kGainReported = 0.5;

struct Own {
  std::vector<std::size_t> parameters;  // gain, offset, east, north
  std::vector<Reading> readings;
  VectorXd measured_V;

  void Take(const HallCampaign& campaign, std::vector<Reading> kept) {
    readings = std::move(kept);
    measured_V.resize(static_cast<Index>(readings.size()));
    for (std::size_t k = 0; k < readings.size(); ++k)
      measured_V[static_cast<Index>(k)] =
          campaign.rows[readings[k].row].voltages_V[readings[k].sensor];
  }
};

VectorXd Residuals(const HallForward& forward, const Own& own, const VectorXd& parameters) {
  VectorXd predicted_V;
  forward.Predict(parameters, own.readings, &predicted_V);
  return own.measured_V - predicted_V;
}

double RobustSd(const VectorXd& residuals) {
  std::vector<double> sizes(residuals.data(), residuals.data() + residuals.size());
  for (double& size : sizes) size = std::abs(size);
  const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
  std::nth_element(sizes.begin(), middle, sizes.end());
  return std::max(kNoiseLeast_V, 1.4826 * *middle);
}

// Huber's cost: squares up to `limit`, linear beyond.
double Cost(const VectorXd& residuals, double limit) {
  double cost = 0;
  for (const double residual : residuals) {
    const double size = std::abs(residual);
    cost += size <= limit ? size * size : limit * (2 * size - limit);
  }
  return cost;
}

struct FourFit {
  VectorXd parameters;  // of the whole layout
  VectorXd residuals;
  Matrix4d normal = Matrix4d::Zero();
};

FourFit Fit(const HallForward& forward, const Own& own, const VectorXd& start, double limit_V) {
  FourFit fit{start, Residuals(forward, own, start)};
  double cost = Cost(fit.residuals, limit_V), damping = 1e-3;
  for (int step = 0; step < kSteps; ++step) {
    const MatrixXd slopes = forward.Slopes(fit.parameters, own.readings, own.parameters);
    const VectorXd weights = fit.residuals.unaryExpr(
        [&](double r) { return std::abs(r) <= limit_V ? 1 : limit_V / std::abs(r); });
    fit.normal = slopes.transpose() * weights.asDiagonal() * slopes;
    const Vector4d right = slopes.transpose() * weights.cwiseProduct(fit.residuals);
    bool better = false;
    double gained = 0;
    for (int trial = 0; trial < 8 && !better; ++trial) {
      Matrix4d damped = fit.normal;
      damped.diagonal() += damping * fit.normal.diagonal() + Vector4d::Constant(1e-12);
      const Vector4d change = damped.ldlt().solve(right);
      VectorXd moved = fit.parameters;
      for (std::size_t k = 0; k < 4; ++k) {
        const auto at = static_cast<Index>(k);
        const double most = k < 2 ? 5 : 0.2;  // rad: the field's waves are not far longer
        moved[static_cast<Index>(own.parameters[k])] += std::clamp(change[at], -most, most);
      }
      const VectorXd residuals = Residuals(forward, own, moved);
      const double next = Cost(residuals, limit_V);
      better = std::isfinite(next) && next <= cost;
      damping = better ? std::max(1e-9, damping / 10) : damping * 30;
      if (!better) continue;
      gained = cost - next;
      cost = next;
      fit.parameters = moved;
      fit.residuals = residuals;
    }
    if (!better || gained < 1e-10 * cost + 1e-18) break;
  }
  return fit;
}

// The fit is robust first, then plain without the readings that are far off.
FourFit FitRobustly(const HallForward& forward, const HallCampaign& campaign, const VectorXd& zero,
                    Own* own, std::size_t* far_off) {
  FourFit fit = Fit(forward, *own, zero, 1e300);
  for (int pass = 0; pass < kPasses; ++pass)
    fit = Fit(forward, *own, fit.parameters, kHuber * RobustSd(fit.residuals));
  const double limit_V = kFarOff * RobustSd(fit.residuals);
  std::vector<Reading> kept;
  for (std::size_t k = 0; k < own->readings.size(); ++k)
    if (std::abs(fit.residuals[static_cast<Index>(k)]) <= limit_V) kept.push_back(own->readings[k]);
  const std::size_t dropped = own->readings.size() - kept.size();
  if (dropped > 0 && dropped * kFarOffMost <= own->readings.size()) {
    *far_off = dropped;
    own->Take(campaign, std::move(kept));
  }
  return Fit(forward, *own, fit.parameters, 1e300);
}

double HeldOut(const HallForward& forward, const HallCampaign& campaign, const Own& own,
               const VectorXd& start) {
  double squares = 0;
  for (std::size_t fold = 0; fold < kFolds; ++fold) {
    Own train{.parameters = own.parameters}, test{.parameters = own.parameters};
    std::vector<Reading> here, there;
    for (std::size_t k = 0; k < own.readings.size(); ++k)
      (k % kFolds == fold ? there : here).push_back(own.readings[k]);
    train.Take(campaign, std::move(here));
    test.Take(campaign, std::move(there));
    const FourFit fit = Fit(forward, train, start, 1e300);
    squares += Residuals(forward, test, fit.parameters).squaredNorm();
  }
  return std::sqrt(squares / static_cast<double>(own.readings.size()));
}

// The standard deviations of the four numbers. None: the readings do not determine all of them.
std::optional<Vector4d> Deviations(const FourFit& fit) {
  const Vector4d scale = fit.normal.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const Matrix4d scaled = scale.asDiagonal() * fit.normal * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Matrix4d> eigen(scaled);
  if (!(eigen.eigenvalues()[0] > 1e-9)) return std::nullopt;
  const double variance =
      fit.residuals.squaredNorm() / static_cast<double>(fit.residuals.size() - 4);
  const Matrix4d covariance =
      variance * (scale.asDiagonal() * scaled.inverse() * scale.asDiagonal()).eval();
  return covariance.diagonal().cwiseMax(0).cwiseSqrt();
}

std::vector<Reading> UsableOf(const HallCampaign& campaign, const HallRig& rig, std::size_t sensor,
                              SensorFit* out) {
  std::vector<Reading> readings;
  for (std::size_t row = 0; row < campaign.rows.size(); ++row) {
    const double voltage_V = campaign.rows[row].voltages_V[sensor];
    if (!std::isfinite(voltage_V))
      ++out->missing;
    else if (!Field_T({}, rig.electronics, voltage_V))
      ++out->saturated;
    else
      readings.push_back({row, sensor});
  }
  return readings;
}

SensorFit CalibrateOne(const HallForward& forward, const HallCampaign& campaign, const HallRig& rig,
                       std::size_t sensor) {
  const ParameterLayout& layout = forward.layout();
  SensorFit out{.sensor = rig.sensors[sensor]};
  Own own{.parameters = {layout.gain(sensor), layout.offset(sensor), layout.shift(sensor),
                         layout.shift(sensor) + 1}};
  own.Take(campaign, UsableOf(campaign, rig, sensor, &out));
  out.readings = own.readings.size();
  if (out.missing == campaign.rows.size()) return out;
  out.status = CalibrationStatus::kFew;
  if (own.readings.size() < kReadingsMin) return out;
  const VectorXd zero = VectorXd::Zero(static_cast<Index>(layout.size()));
  const FourFit fit = FitRobustly(forward, campaign, zero, &own, &out.far_off);
  out.readings = own.readings.size();
  out.rms_before_V = Rms(Residuals(forward, own, zero));
  out.rms_after_V = Rms(fit.residuals);
  const auto found = [&](std::size_t k) {
    return fit.parameters[static_cast<Index>(own.parameters[k])];
  };
  const double gain = 1 + found(0);
  const std::optional<Vector4d> sd = Deviations(fit);
  // The gain is judged by itself: where the sensor does not follow the field nothing determines its
  // place, and the poses are not the cause.
  const double sd_gain_alone = out.rms_after_V / std::sqrt(std::max(fit.normal(0, 0), 1e-300));
  out.status = CalibrationStatus::kStuck;
  if (std::abs(gain) < kFollows * sd_gain_alone || std::abs(gain) < 1e-4) return out;
  out.status = CalibrationStatus::kUndetermined;
  if (!sd || (*sd)[0] > kGainReported * std::abs(gain) || (*sd)[2] > kReported_rad ||
      (*sd)[3] > kReported_rad)
    return out;
  out.status = CalibrationStatus::kOk;
  out.shift = {found(2), found(3)};
  out.sensor.direction = Shifted(out.sensor.direction, out.shift);
  out.sensor.gain *= gain;
  out.sensor.offset_V += found(1);
  out.sd_gain = (*sd)[0] * std::abs(rig.sensors[sensor].gain);
  out.sd_offset_V = (*sd)[1];
  out.sd_east_rad = (*sd)[2];
  out.sd_north_rad = (*sd)[3];
  out.rms_held_out_V = HeldOut(forward, campaign, own, fit.parameters);
  return out;
}

}  // namespace

const char* Name(CalibrationStatus status) {
  switch (status) {
    case CalibrationStatus::kOk:
      return "ok";
    case CalibrationStatus::kMissing:
      return "missing";
    case CalibrationStatus::kFew:
      return "too few readings";
    case CalibrationStatus::kStuck:
      return "stuck";
    case CalibrationStatus::kUndetermined:
      return "undetermined";
    case CalibrationStatus::kContradicts:
      return "contradicts";
  }
  return "";
}

std::vector<SensorFit> CalibrateSensors(const HallCampaign& campaign, const HallRig& given,
                                        const FieldModel& field) {
  HallRig rig = given;
  for (const VoltageRow& row : campaign.rows)
    for (const double voltage_V : row.voltages_V)
      if (voltage_V < -0.01 || voltage_V > rig.electronics.supply_V + 0.01)
        rig.electronics.clips = false;
  const HallForward forward(campaign, rig, field);
  std::vector<SensorFit> fits;
  std::vector<double> left_V;
  for (std::size_t sensor = 0; sensor < rig.sensors.size(); ++sensor) {
    fits.push_back(CalibrateOne(forward, campaign, rig, sensor));
    if (fits.back().status == CalibrationStatus::kOk) left_V.push_back(fits.back().rms_after_V);
  }
  if (left_V.size() < 3) return fits;
  const auto middle = left_V.begin() + static_cast<std::ptrdiff_t>(left_V.size() / 2);
  std::nth_element(left_V.begin(), middle, left_V.end());
  for (std::size_t sensor = 0; sensor < fits.size(); ++sensor) {
    SensorFit& fit = fits[sensor];
    if (fit.status != CalibrationStatus::kOk ||
        fit.rms_after_V <= kContradicts * std::max(kNoiseLeast_V, *middle))
      continue;
    fit.status = CalibrationStatus::kContradicts;
    fit.sensor = rig.sensors[sensor];
    fit.shift = {};
    fit.sd_gain = fit.sd_offset_V = fit.sd_east_rad = fit.sd_north_rad = 0;
  }
  return fits;
}

}  // namespace focalfleet::sim
