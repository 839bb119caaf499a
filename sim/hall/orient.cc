#include "sim/hall/orient.h"

#include <algorithm>
#include <limits>

#include "protocol/base/check.h"

namespace focalfleet::sim {
namespace {

constexpr std::size_t kTilts = 13;
constexpr std::size_t kSpins = 16;
constexpr std::size_t kGridNodes = kTilts * kTilts * kSpins;
constexpr std::size_t kStartsMax = 8;
constexpr double kSame_rad = 1e-4;
constexpr double kGammaRange_rad = 90 * kRadPerDeg;
// The search goes beyond the range where the field does not repeat itself: noise may lead a little
// out of that range.
constexpr double kGammaMargin_rad = 2 * kRadPerDeg;
constexpr int kStepsMax = 25;

// A symmetric 3 x 3 matrix, row by row.
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

// ---- eight sensors at a time

// Directions in the rotor's frame and their derivatives by alpha and beta. The derivative by gamma
// is (y, -x, 0) of the direction.
struct TurnedLanes {
  DirectionLanes local, by_alpha, by_beta;
};
FOCALFLEET_WIDE void Turn(const Rotation& rotation, const DirectionLanes& stator,
                          TurnedLanes* __restrict out) {
  const Rotation at = rotation;
  for (std::size_t k = 0; k < kLanes; ++k) {
    const Turned turned = at.ToRotorWithSlopes({stator.x.at[k], stator.y.at[k], stator.z.at[k]});
    out->local.x.at[k] = turned.local.x;
    out->local.y.at[k] = turned.local.y;
    out->local.z.at[k] = turned.local.z;
    out->by_alpha.x.at[k] = turned.by_alpha.x;
    out->by_alpha.y.at[k] = turned.by_alpha.y;
    out->by_alpha.z.at[k] = turned.by_alpha.z;
    out->by_beta.x.at[k] = turned.by_beta.x;
    out->by_beta.y.at[k] = turned.by_beta.y;
    out->by_beta.z.at[k] = turned.by_beta.z;
  }
}

// The sums over the sensors: J^T J by rows from the diagonal on, J^T r, r^T r. Each stays in four
// lanes until the end, so that its order does not depend on the machine's width.
constexpr std::size_t kSums = 10;
struct Sums {
  double lane[kSums][4];
  [[nodiscard]] double Total(std::size_t sum) const {
    return (lane[sum][0] + lane[sum][1]) + (lane[sum][2] + lane[sum][3]);
  }
};
struct Seen {
  const Lane& factor;
  const Lane& weight;  // 0 for sensors that are not to be trusted
  const Lane& wanted_T;
};
FOCALFLEET_WIDE void Accumulate(const TurnedLanes& turned, const SampleLanes& field,
                                const Seen& seen, bool magnitudes, Sums* __restrict sums) {
  Lane row[4];
  for (std::size_t k = 0; k < kLanes; ++k) {
    const double sx = field.slope_x.at[k], sy = field.slope_y.at[k], sz = field.slope_z.at[k];
    const double value = seen.factor.at[k] * field.b_T.at[k];
    const double sign = magnitudes && value < 0 ? -1.0 : 1.0;
    const double scale = seen.weight.at[k] * sign * seen.factor.at[k];
    row[0].at[k] = scale * (sx * turned.by_alpha.x.at[k] + sy * turned.by_alpha.y.at[k] +
                            sz * turned.by_alpha.z.at[k]);
    row[1].at[k] = scale * (sx * turned.by_beta.x.at[k] + sy * turned.by_beta.y.at[k] +
                            sz * turned.by_beta.z.at[k]);
    row[2].at[k] = scale * (sx * turned.local.y.at[k] - sy * turned.local.x.at[k]);
    row[3].at[k] = seen.weight.at[k] * (seen.wanted_T.at[k] - sign * value);
  }
  for (std::size_t k = 0; k < 4; ++k) {
    const double a = row[0].at[k], a4 = row[0].at[k + 4];
    const double b = row[1].at[k], b4 = row[1].at[k + 4];
    const double c = row[2].at[k], c4 = row[2].at[k + 4];
    const double r = row[3].at[k], r4 = row[3].at[k + 4];
    sums->lane[0][k] += a * a + a4 * a4;
    sums->lane[1][k] += a * b + a4 * b4;
    sums->lane[2][k] += a * c + a4 * c4;
    sums->lane[3][k] += b * b + b4 * b4;
    sums->lane[4][k] += b * c + b4 * c4;
    sums->lane[5][k] += c * c + c4 * c4;
    sums->lane[6][k] += a * r + a4 * r4;
    sums->lane[7][k] += b * r + b4 * r4;
    sums->lane[8][k] += c * r + c4 * r4;
    sums->lane[9][k] += r * r + r4 * r4;
  }
}

Orientation MovedBy(const Orientation& from, const Triple& by) {
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
  FOCALFLEET_CHECK(!rig_.sensors.empty() && rig_.sensors.size() <= kSensorsMax);
  for (std::size_t k = 0; k < kSensorsMax; ++k) {
    const HallRig::Seen seen = rig_.SeenFromRotor(rig_.sensors[k < count() ? k : 0]);
    DirectionLanes& block = directions_[k / kLanes];
    block.x.at[k % kLanes] = seen.direction.x;
    block.y.at[k % kLanes] = seen.direction.y;
    block.z.at[k % kLanes] = seen.direction.z;
    factors_[k / kLanes].at[k % kLanes] = seen.factor;
  }
  MakeAtlas();
}

void OrientationSolver::Predict(const Orientation& orientation, std::span<double> b_T) const {
  FOCALFLEET_CHECK(b_T.size() == count());
  const Rotation rotation(orientation);
  TurnedLanes turned;
  SampleLanes samples;
  for (std::size_t begin = 0; begin < count(); begin += kLanes) {
    Turn(rotation, directions_[begin / kLanes], &turned);
    field_->EvaluateLanes(turned.local, &samples);
    for (std::size_t k = begin; k < std::min(begin + kLanes, count()); ++k) {
      b_T[k] = factors_[begin / kLanes].at[k - begin] * samples.b_T.at[k - begin];
      if (options_.magnitudes) b_T[k] = std::abs(b_T[k]);
    }
  }
}

struct OrientationSolver::Linear {
  Matrix normal{};
  Triple right{};
  double squares = 0;
};

OrientationSolver::Linear OrientationSolver::Linearise(const HallReading& reading,
                                                       const Orientation& at) const {
  const Rotation rotation(at);
  TurnedLanes turned;
  SampleLanes samples;
  Sums sums{};
  for (std::size_t begin = 0; begin < count(); begin += kLanes) {
    Turn(rotation, directions_[begin / kLanes], &turned);
    field_->EvaluateLanes(turned.local, &samples);
    Lane weight, wanted;
    for (std::size_t k = 0; k < kLanes; ++k) {
      weight.at[k] = (reading.used >> (begin + k) & 1u) != 0 ? 1 : 0;
      wanted.at[k] = reading.b_T[begin + k];
    }
    Accumulate(turned, samples, {factors_[begin / kLanes], weight, wanted}, options_.magnitudes,
               &sums);
  }
  Linear linear;
  std::size_t entry = 0;
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = i; j < 3; ++j) linear.normal[i][j] = sums.Total(entry++);
  for (double& part : linear.right) part = sums.Total(entry++);
  linear.squares = sums.Total(entry);
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
    const Orientation next = MovedBy(fit.orientation, step);
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
      // At the minimum rounding decides: a step too small to matter may go up.
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
  const std::size_t sensors = count();
  atlas_.resize(sensors * kGridNodes);
  std::array<double, kSensorsMax> b_T{};
  for (std::size_t node = 0; node < kGridNodes; ++node) {
    Predict(Node(node), {b_T.data(), sensors});
    for (std::size_t k = 0; k < sensors; ++k)
      atlas_[k * kGridNodes + node] = static_cast<float>(b_T[k]);
  }
}

std::vector<Orientation> OrientationSolver::Starts(const HallReading& reading) const {
  std::vector<float> miss(kGridNodes, 0.0F);
  for (std::size_t k = 0; k < count(); ++k) {
    if ((reading.used >> k & 1u) == 0) continue;
    const float* row = atlas_.data() + k * kGridNodes;
    const auto b_T = static_cast<float>(reading.b_T[k]);
    for (std::size_t node = 0; node < kGridNodes; ++node)
      miss[node] += (row[node] - b_T) * (row[node] - b_T);
  }
  // The nodes that are lower than their six neighbours; gamma is periodic.
  std::vector<std::size_t> lowest;
  for (std::size_t node = 0; node < kGridNodes; ++node) {
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
