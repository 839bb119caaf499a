#include "sim/hall/orient.h"

#include <algorithm>
#include <limits>

#include "protocol/base/check.h"

namespace focalfleet::sim {
namespace {

constexpr std::size_t kTilts = 13;
constexpr std::size_t kSpins = 16;
constexpr std::size_t kNodes = kTilts * kTilts * kSpins;
constexpr std::size_t kStartsMax = 8;
constexpr double kSame_rad = 1e-4;
constexpr double kGammaRange_rad = 90 * kRadPerDeg;
// Beyond the range where the field does not repeat itself: noise may lead a little out of it.
constexpr double kGammaMargin_rad = 2 * kRadPerDeg;
constexpr int kStepsMax = 25;

// Symmetric 3 x 3, row by row.
using Matrix = std::array<std::array<double, 3>, 3>;
using Triple = std::array<double, 3>;

bool Invert(const Matrix& a, Matrix* out) {
  Matrix c;
  c[0][0] = a[1][1] * a[2][2] - a[1][2] * a[1][2];
  c[0][1] = a[0][2] * a[1][2] - a[0][1] * a[2][2];
  c[0][2] = a[0][1] * a[1][2] - a[0][2] * a[1][1];
  c[1][1] = a[0][0] * a[2][2] - a[0][2] * a[0][2];
  c[1][2] = a[0][1] * a[0][2] - a[0][0] * a[1][2];
  c[2][2] = a[0][0] * a[1][1] - a[0][1] * a[0][1];
  const double determinant = a[0][0] * c[0][0] + a[0][1] * c[0][1] + a[0][2] * c[0][2];
  if (!(determinant > 1e-14 * a[0][0] * a[1][1] * a[2][2])) return false;
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = i; j < 3; ++j) (*out)[i][j] = (*out)[j][i] = c[i][j] / determinant;
  return true;
}

Orientation Moved(const Orientation& from, const Triple& by) {
  return {from.alpha_rad + by[0], from.beta_rad + by[1], from.gamma_rad + by[2]};
}

double Away(const Orientation& a, const Orientation& b, double period_rad) {
  const double turn = std::remainder(a.gamma_rad - b.gamma_rad, period_rad);
  return std::max(
      {std::abs(a.alpha_rad - b.alpha_rad), std::abs(a.beta_rad - b.beta_rad), std::abs(turn)});
}

}  // namespace

HallReading ReadingOf(const HallRig& rig, std::span<const double> voltages_V, double scale) {
  HallReading reading;
  for (std::size_t k = 0; k < voltages_V.size() && k < kSensorsMax; ++k) {
    if (!std::isfinite(voltages_V[k])) continue;
    const auto b_T = Field_T(rig.sensors[k], rig.electronics, voltages_V[k]);
    if (!b_T) continue;
    reading.b_T[k] = *b_T / scale;
    reading.used |= 1u << k;
  }
  return reading;
}

OrientationSolver::OrientationSolver(HallRig rig, std::shared_ptr<const FieldModel> field,
                                     const Options& options)
    : rig_(std::move(rig)),
      field_(std::move(field)),
      options_(options),
      periodic_(field_->period_rad() < 91 * kRadPerDeg) {
  FOCALFLEET_CHECK(rig_.sensors.size() <= kSensorsMax);
  for (const HallSensor& sensor : rig_.sensors) {
    const HallRig::Seen seen = rig_.SeenFromRotor(sensor);
    direction_.push_back(seen.direction);
    factor_.push_back(seen.factor);
  }
  MakeAtlas();
}

void OrientationSolver::Predict(const Orientation& orientation, std::span<double> b_T) const {
  const std::size_t count = direction_.size();
  FOCALFLEET_CHECK(b_T.size() == count);
  const Rotation rotation(orientation);
  std::array<Vector3, kSensorsMax> local;
  std::array<FieldSample, kSensorsMax> samples;
  for (std::size_t k = 0; k < count; ++k) local[k] = rotation.ToRotor(direction_[k]);
  field_->Evaluate({local.data(), count}, {samples.data(), count});
  for (std::size_t k = 0; k < count; ++k) {
    b_T[k] = factor_[k] * samples[k].b_T;
    if (options_.magnitudes) b_T[k] = std::abs(b_T[k]);
  }
}

struct OrientationSolver::Linear {
  Matrix normal{};
  Triple right{};
  double squares = 0;
};

OrientationSolver::Linear OrientationSolver::Linearise(const HallReading& reading,
                                                       const Orientation& at) const {
  const std::size_t count = direction_.size();
  std::array<Turned, kSensorsMax> turned;
  std::array<Vector3, kSensorsMax> local;
  std::array<FieldSample, kSensorsMax> samples;
  const Rotation rotation(at);
  for (std::size_t k = 0; k < count; ++k) {
    turned[k] = rotation.ToRotorWithSlopes(direction_[k]);
    local[k] = turned[k].local;
  }
  field_->Evaluate({local.data(), count}, {samples.data(), count});
  Linear linear;
  for (std::size_t k = 0; k < count; ++k) {
    if ((reading.used >> k & 1u) == 0) continue;
    double value = factor_[k] * samples[k].b_T, sign = factor_[k];
    if (options_.magnitudes && value < 0) {
      value = -value;
      sign = -sign;
    }
    const double miss = reading.b_T[k] - value;
    const Triple row = {sign * Dot(samples[k].slope_T, turned[k].by_alpha),
                        sign * Dot(samples[k].slope_T, turned[k].by_beta),
                        sign * Dot(samples[k].slope_T, turned[k].by_gamma)};
    linear.squares += miss * miss;
    for (std::size_t i = 0; i < 3; ++i) {
      linear.right[i] += row[i] * miss;
      for (std::size_t j = i; j < 3; ++j) linear.normal[i][j] += row[i] * row[j];
    }
  }
  return linear;
}

OrientationFit OrientationSolver::Refine(const HallReading& reading,
                                         const Orientation& start) const {
  OrientationFit fit{.orientation = start};
  fit.sensors = __builtin_popcount(reading.used);
  Linear here = Linearise(reading, start);
  double damping = 0;
  for (fit.steps = 1; fit.steps <= kStepsMax; ++fit.steps) {
    Matrix damped = here.normal;
    const double scale = here.normal[0][0] + here.normal[1][1] + here.normal[2][2];
    for (std::size_t i = 0; i < 3; ++i) damped[i][i] += damping * scale;
    Matrix inverse{};
    if (!Invert(damped, &inverse)) {
      damping = damping == 0 ? 1e-4 : damping * 10;
      if (damping > 1e6) return fit;
      continue;
    }
    Triple step{};
    double size = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t j = 0; j < 3; ++j) step[i] += inverse[i][j] * here.right[j];
      size = std::max(size, std::abs(step[i]));
    }
    if (size > 0.35)  // 20 deg: beyond any linear reach
      for (double& part : step) part *= 0.35 / size;
    const Orientation next = Moved(fit.orientation, step);
    if (damping == 0 && size < options_.last_step_rad) {
      fit.orientation = next;
      for (std::size_t i = 0; i < 3; ++i) here.squares -= step[i] * here.right[i];
      break;
    }
    const Linear there = Linearise(reading, next);
    if (there.squares <= here.squares) {
      const bool done =
          size < 1e-7 || (damping == 0 && there.squares > 0.999999 * here.squares && size < 1e-5);
      fit.orientation = next;
      here = there;
      damping = damping < 1e-6 ? 0 : damping / 10;
      if (done) break;
    } else {
      // At the bottom rounding decides: a step too small to matter may go up.
      if (size < 1e-9) break;
      damping = damping == 0 ? 1e-4 : damping * 10;
      if (damping > 1e6) break;
    }
  }
  fit.squares_T2 = here.squares;
  fit.converged = Invert(here.normal, &fit.unit_covariance) && fit.steps <= kStepsMax;
  return fit;
}

Orientation OrientationSolver::Wrapped(Orientation orientation) const {
  if (periodic_) orientation.gamma_rad = std::remainder(orientation.gamma_rad, kGammaRange_rad);
  return orientation;
}

Orientation OrientationSolver::Node(std::size_t index) const {
  const auto tilt = [&](std::size_t k) {
    return options_.tilt_max_rad * (2.0 * static_cast<double>(k) / (kTilts - 1) - 1);
  };
  const std::size_t spin = index % kSpins, rest = index / kSpins;
  return {tilt(rest / kTilts), tilt(rest % kTilts),
          kGammaRange_rad * (static_cast<double>(spin) / (kSpins - (periodic_ ? 0 : 1)) - 0.5)};
}

void OrientationSolver::MakeAtlas() {
  const std::size_t count = direction_.size();
  atlas_.resize(count * kNodes);
  std::array<double, kSensorsMax> b_T{};
  for (std::size_t node = 0; node < kNodes; ++node) {
    Predict(Node(node), {b_T.data(), count});
    for (std::size_t k = 0; k < count; ++k) atlas_[k * kNodes + node] = static_cast<float>(b_T[k]);
  }
}

std::vector<Orientation> OrientationSolver::Starts(const HallReading& reading) const {
  std::vector<float> miss(kNodes, 0.0F);
  for (std::size_t k = 0; k < direction_.size(); ++k) {
    if ((reading.used >> k & 1u) == 0) continue;
    const float* row = atlas_.data() + k * kNodes;
    const auto b_T = static_cast<float>(reading.b_T[k]);
    for (std::size_t node = 0; node < kNodes; ++node)
      miss[node] += (row[node] - b_T) * (row[node] - b_T);
  }
  // Lower than the six neighbours; gamma goes round.
  std::vector<std::size_t> lowest;
  for (std::size_t node = 0; node < kNodes; ++node) {
    const std::size_t spin = node % kSpins, rest = node / kSpins;
    const std::size_t a = rest / kTilts, b = rest % kTilts;
    const auto at = [&](std::size_t i, std::size_t j, std::size_t k) {
      return miss[(i * kTilts + j) * kSpins + k % kSpins];
    };
    const float here = miss[node];
    if ((periodic_ || spin + 1 < kSpins) && at(a, b, spin + 1) < here) continue;
    if ((periodic_ || spin > 0) && at(a, b, spin + kSpins - 1) < here) continue;
    if ((a > 0 && at(a - 1, b, spin) < here) || (a + 1 < kTilts && at(a + 1, b, spin) < here))
      continue;
    if ((b > 0 && at(a, b - 1, spin) < here) || (b + 1 < kTilts && at(a, b + 1, spin) < here))
      continue;
    lowest.push_back(node);
  }
  std::sort(lowest.begin(), lowest.end(), [&](std::size_t one, std::size_t two) {
    return miss[one] != miss[two] ? miss[one] < miss[two] : one < two;
  });
  if (lowest.size() > kStartsMax) lowest.resize(kStartsMax);
  std::vector<Orientation> starts;
  for (const std::size_t node : lowest) starts.push_back(Node(node));
  return starts;
}

std::vector<OrientationFit> OrientationSolver::Solve(const HallReading& reading) const {
  std::vector<OrientationFit> fits;
  if (__builtin_popcount(reading.used) < 3) return fits;
  const double reach_rad = options_.tilt_max_rad + 1e-6;
  const double gamma_max_rad = kGammaRange_rad / 2 + (periodic_ ? 1e-6 : kGammaMargin_rad);
  for (const Orientation& start : Starts(reading)) {
    OrientationFit fit = Refine(reading, start);
    if (!fit.converged) continue;
    fit.orientation = Wrapped(fit.orientation);
    if (std::abs(fit.orientation.alpha_rad) > reach_rad ||
        std::abs(fit.orientation.beta_rad) > reach_rad ||
        std::abs(fit.orientation.gamma_rad) > gamma_max_rad)
      continue;
    const bool known = std::any_of(fits.begin(), fits.end(), [&](const OrientationFit& other) {
      return Away(fit.orientation, other.orientation, kGammaRange_rad) < kSame_rad;
    });
    if (!known) fits.push_back(fit);
  }
  std::sort(fits.begin(), fits.end(), [](const OrientationFit& one, const OrientationFit& two) {
    return one.squares_T2 < two.squares_T2;
  });
  return fits;
}

}  // namespace focalfleet::sim
