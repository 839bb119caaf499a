#include "sim/hall/field_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <complex>

#include "sim/hall/spherical_fit.h"

namespace focalfleet::sim {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;

constexpr std::size_t kPointsMin = 12;
constexpr double kSameRadius_mm = 0.5;

// B = profile(theta) (c cos 4 phi + s sin 4 phi).
struct WaveTerm {
  Vector2d coefficients;
  Matrix2d inverse;  // of the normal matrix
  double squares = 0;
};
template <class Profile>
WaveTerm FitWave(const FieldMap& map, Profile profile) {
  Matrix2d normal = Matrix2d::Zero();
  Vector2d right = Vector2d::Zero();
  double squares = 0;
  for (const FieldPoint& point : map) {
    const double height = profile(point.theta_rad);
    const Vector2d row(height * std::cos(4 * point.phi_rad), height * std::sin(4 * point.phi_rad));
    normal += row * row.transpose();
    right += row * point.b_T;
    squares += point.b_T * point.b_T;
  }
  WaveTerm wave;
  // A map along a single meridian does not determine the phase; the phase then stays as it is.
  normal += 1e-12 * (normal.trace() + 1e-300) * Matrix2d::Identity();
  wave.inverse = normal.inverse();
  wave.coefficients = wave.inverse * right;
  wave.squares = std::max(0.0, squares - right.dot(wave.coefficients));
  return wave;
}

double SurfaceSquares(const FieldMap& map, double width_rad) {
  return FitWave(map,
                 [&](double theta_rad) {
                   const double x = (theta_rad - std::numbers::pi / 2) / width_rad;
                   return std::exp(-x * x);
                 })
      .squares;
}

// The width by golden section about the best of a grid; the two wave coefficients are linear.
double BestWidth_rad(const FieldMap& map) {
  double best_deg = 5, best = SurfaceSquares(map, best_deg * kRadPerDeg);
  for (double width_deg = 6; width_deg <= 80; width_deg += 1)
    if (const double squares = SurfaceSquares(map, width_deg * kRadPerDeg); squares < best) {
      best = squares;
      best_deg = width_deg;
    }
  double low = (best_deg - 1) * kRadPerDeg, high = (best_deg + 1) * kRadPerDeg;
  constexpr double kGolden = 0.618033988749895;
  for (int step = 0; step < 60; ++step) {
    const double left = high - kGolden * (high - low), right = low + kGolden * (high - low);
    (SurfaceSquares(map, left) < SurfaceSquares(map, right) ? high : low) =
        SurfaceSquares(map, left) < SurfaceSquares(map, right) ? right : left;
  }
  return (low + high) / 2;
}

struct Polar {
  double amplitude_T = 0;
  double phase_rad = 0;
};
Polar PolarOf(const WaveTerm& wave) {
  return {wave.coefficients.norm(), std::atan2(wave.coefficients[1], wave.coefficients[0]) / 4};
}

FieldParameters FitHarmonic(const FieldMap& map) {
  const WaveTerm wave =
      FitWave(map, [](double theta_rad) { return std::pow(std::sin(theta_rad), 4); });
  const double variance = wave.squares / static_cast<double>(map.size() - 2);
  const auto [amplitude_T, phase_rad] = PolarOf(wave);
  const double sd_T = std::sqrt(variance * wave.inverse.trace() / 2);
  return HarmonicParameters{amplitude_T, phase_rad, sd_T, sd_T / (4 * amplitude_T)};
}

FieldParameters FitSurface(const FieldMap& map) {
  const double width_rad = BestWidth_rad(map);
  const WaveTerm wave = FitWave(map, [&](double theta_rad) {
    const double x = (theta_rad - std::numbers::pi / 2) / width_rad;
    return std::exp(-x * x);
  });
  const auto [amplitude_T, phase_rad] = PolarOf(wave);
  // The normal matrix of amplitude, width and phase together.
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  for (const FieldPoint& point : map) {
    const double x = (point.theta_rad - std::numbers::pi / 2) / width_rad;
    const double height = std::exp(-x * x), angle = 4 * (point.phi_rad - phase_rad);
    const double b_T = amplitude_T * height * std::cos(angle);
    const Eigen::Vector3d row(b_T / amplitude_T, b_T * 2 * x * x / width_rad,
                              4 * amplitude_T * height * std::sin(angle));
    normal += row * row.transpose();
  }
  const double variance = wave.squares / static_cast<double>(map.size() - 3);
  const Eigen::Vector3d sd =
      (variance * normal.completeOrthogonalDecomposition().pseudoInverse().diagonal())
          .cwiseMax(0)
          .cwiseSqrt();
  return SurfaceParameters{amplitude_T, width_rad, phase_rad, sd[0], sd[1], sd[2]};
}

Status Check(const FieldMap& map) {
  if (map.size() < kPointsMin)
    return Fail(ErrorCode::kInvalid, "a field map needs at least " + std::to_string(kPointsMin) +
                                         " points, there are " + std::to_string(map.size()));
  double peak_T = 0, theta_low = 10, theta_high = -10;
  for (const FieldPoint& point : map) {
    peak_T = std::max(peak_T, std::abs(point.b_T));
    theta_low = std::min(theta_low, point.theta_rad);
    theta_high = std::max(theta_high, point.theta_rad);
  }
  if (peak_T == 0) return Fail(ErrorCode::kInvalid, "the field is zero at every point of the map");
  if (theta_high - theta_low < 5 * kRadPerDeg)
    return Fail(
        ErrorCode::kInvalid,
        "all points of the map are within 5 deg of theta: its shape along theta is unknown");
  return {};
}

// The map moved to the mean radius by the exponent with the least residual.
struct Moved {
  FieldMap map;
  double radius_mm = 59;
  std::optional<double> decay;
  double sd_decay = 0;
};
Moved ToOneRadius(const FieldMap& map) {
  Moved moved{.map = map};
  double sum = 0, low = map.front().radius_mm, high = low;
  for (const FieldPoint& point : map) {
    sum += point.radius_mm;
    low = std::min(low, point.radius_mm);
    high = std::max(high, point.radius_mm);
  }
  moved.radius_mm = sum / static_cast<double>(map.size());
  if (high - low < kSameRadius_mm) return moved;
  const auto at = [&](double decay) {
    FieldMap scaled = map;
    for (FieldPoint& point : scaled)
      point.b_T *= std::pow(point.radius_mm / moved.radius_mm, decay);
    return scaled;
  };
  const auto squares = [&](double decay) {
    const FieldMap scaled = at(decay);
    return SurfaceSquares(scaled, BestWidth_rad(scaled));
  };
  double best = 0, least = squares(0);
  for (double step = 4; step > 1e-3; step /= 2)
    for (const double trial : {best - step, best + step})
      if (const double value = squares(trial); value < least) {
        least = value;
        best = trial;
      }
  const double curvature = squares(best + 0.5) + squares(best - 0.5) - 2 * least;
  moved.decay = best;
  if (curvature > 0)
    moved.sd_decay = std::sqrt(0.5 * least / static_cast<double>(map.size()) / curvature);
  moved.map = at(best);
  return moved;
}

}  // namespace

std::string_view Name(FieldKind kind) {
  switch (kind) {
    case FieldKind::kHarmonic:
      return "harmonic";
    case FieldKind::kSurface:
      return "surface";
    case FieldKind::kSpherical:
      return "spherical";
  }
  return "";
}

Vector3 DirectionAt(double theta_rad, double phi_rad) {
  return {std::sin(theta_rad) * std::cos(phi_rad), std::sin(theta_rad) * std::sin(phi_rad),
          std::cos(theta_rad)};
}

Result<FieldFit> FitField(const FieldMap& map, FieldKind kind) {
  FOCALFLEET_TRY(Check(map));
  const Moved moved = ToOneRadius(map);
  FieldFit fit{.radius_mm = moved.radius_mm, .decay = moved.decay, .sd_decay = moved.sd_decay};
  if (kind == FieldKind::kHarmonic) {
    fit.parameters = FitHarmonic(moved.map);
  } else if (kind == FieldKind::kSurface) {
    fit.parameters = FitSurface(moved.map);
  } else {
    SphericalFit spherical = FitSpherical(moved.map);
    fit.noise_T = spherical.noise_T;
    fit.all_orders = spherical.all_orders;
    fit.parameters = std::move(spherical.terms);
  }
  const auto model = MakeField(fit.parameters);
  double squares = 0;
  for (const FieldPoint& point : moved.map) {
    const double miss_T = point.b_T - model->Radial_T(DirectionAt(point.theta_rad, point.phi_rad));
    squares += miss_T * miss_T;
    fit.worst_T = std::max(fit.worst_T, std::abs(miss_T));
    fit.peak_T = std::max(fit.peak_T, std::abs(point.b_T));
  }
  fit.rms_T = std::sqrt(squares / static_cast<double>(map.size()));
  if (kind != FieldKind::kSpherical) fit.noise_T = fit.rms_T;
  if (!std::isfinite(fit.rms_T))
    return Fail(ErrorCode::kInvalid, "the points of the map do not tell the model's parameters");
  return fit;
}

}  // namespace focalfleet::sim
