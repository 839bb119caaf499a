#include "sim/hall/closed_form.h"

#include "protocol/base/check.h"

namespace focalfleet::sim {
namespace {

double Gamma_rad(std::span<const double> b_T, const SensorAngles& angles) {
  // Two angles have this tangent; the sign of the sum decides between them.
  return std::atan2((b_T[0] - b_T[1]) / std::sin(4 * angles.pair_xy_rad),
                    (b_T[0] + b_T[1]) / std::cos(4 * angles.pair_xy_rad)) /
         4;
}

bool HaveRatio(double one, double two) { return one != 0 && two != 0 && one / two > 0; }

double LatitudeOfXz_rad(const SensorAngles& angles) {
  return std::numbers::pi / 2 - angles.pair_xz_rad;
}

}  // namespace

std::optional<Orientation> OrientByHarmonic(std::span<const double> b_T,
                                            const SensorAngles& angles) {
  FOCALFLEET_CHECK(b_T.size() >= 6);
  if (!HaveRatio(b_T[4], b_T[5]) || !HaveRatio(b_T[2], b_T[3])) return std::nullopt;
  const auto tilt_rad = [](double ratio, double latitude_rad) {
    const double q = std::pow(ratio, 0.25);
    return std::atan((q - 1) / (q + 1) / std::tan(latitude_rad));
  };
  return Orientation{tilt_rad(b_T[4] / b_T[5], angles.pair_yz_rad),
                     -tilt_rad(b_T[2] / b_T[3], LatitudeOfXz_rad(angles)), Gamma_rad(b_T, angles)};
}

std::optional<Orientation> OrientBySurface(std::span<const double> b_T, const SensorAngles& angles,
                                           double width_rad) {
  FOCALFLEET_CHECK(b_T.size() >= 6);
  if (!HaveRatio(b_T[4], b_T[5]) || !HaveRatio(b_T[2], b_T[3])) return std::nullopt;
  const auto tilt_rad = [&](double ratio, double latitude_rad) {
    return width_rad * width_rad / (4 * latitude_rad) * std::log(ratio);
  };
  return Orientation{tilt_rad(b_T[4] / b_T[5], angles.pair_yz_rad),
                     -tilt_rad(b_T[2] / b_T[3], LatitudeOfXz_rad(angles)), Gamma_rad(b_T, angles)};
}

std::optional<Orientation> OrientBySurfaceOfAnyWidth(std::span<const double> b_T,
                                                     const SensorAngles& angles) {
  FOCALFLEET_CHECK(b_T.size() >= 8);
  if (!HaveRatio(b_T[4], b_T[5]) || !HaveRatio(b_T[2], b_T[3])) return std::nullopt;
  const auto tilt_rad = [](double one, double two, double middle, double latitude_rad) {
    return latitude_rad / 2 * std::log(one / two) / std::log(middle * middle / (one * two));
  };
  const Orientation orientation{tilt_rad(b_T[4], b_T[5], b_T[7], angles.pair_yz_rad),
                                -tilt_rad(b_T[2], b_T[3], b_T[6], LatitudeOfXz_rad(angles)),
                                Gamma_rad(b_T, angles)};
  if (!std::isfinite(orientation.alpha_rad) || !std::isfinite(orientation.beta_rad))
    return std::nullopt;
  return orientation;
}

}  // namespace focalfleet::sim
