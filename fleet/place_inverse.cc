#include "fleet/place_inverse.h"

#include <algorithm>
#include <cmath>

#include "protocol/base/units.h"

namespace focalfleet {
namespace {

constexpr double kEnoughMm = 2e-4;  // the iteration ends this near to the wanted place
constexpr double kStepMaxDeg = 10;  // of one iteration
constexpr double kAwayMaxDeg = 30;  // from the guess: beyond, it is another way, not a correction
constexpr int kIterations = 12;

/// A damped step of Newton's method, in degrees: each joint turns all that lies beyond it.
std::array<double, kAxisCount> StepTowards(const WantedPlace& wanted, const SegmentFp& arm) {
  const PointFp &elbow = arm.a, &fibre = arm.b;
  const double theta_x = -(fibre.y_mm - wanted.base_fp.y_mm),
               theta_y = fibre.x_mm - wanted.base_fp.x_mm;
  const double phi_x = -(fibre.y_mm - elbow.y_mm), phi_y = fibre.x_mm - elbow.x_mm;
  const double x = wanted.fibre_fp.x_mm - fibre.x_mm, y = wanted.fibre_fp.y_mm - fibre.y_mm;
  // Stretched or folded, both joints turn the fibre the same way: damping shares the step among
  // them.
  const double damping =
      1e-6 * (wanted.arm_mm[0] * wanted.arm_mm[0] + wanted.arm_mm[1] * wanted.arm_mm[1]);
  const double a = theta_x * theta_x + theta_y * theta_y + damping;
  const double b = theta_x * phi_x + theta_y * phi_y;
  const double d = phi_x * phi_x + phi_y * phi_y + damping;
  const double u = theta_x * x + theta_y * y, v = phi_x * x + phi_y * y;
  const double determinant = a * d - b * b;
  const auto bounded = [](double radians) {
    return std::clamp(radians / kRadiansPerDegree, -kStepMaxDeg, kStepMaxDeg);
  };
  return {bounded((d * u - b * v) / determinant), bounded((a * v - b * u) / determinant)};
}

}  // namespace

std::optional<AxisAngles> CountAt(const WantedPlace& wanted, const PlaceModel& model) {
  AxisAngles count = wanted.guess;
  AxisAngles best = count;
  double best_mm = INFINITY;
  for (int k = 0; k < kIterations; ++k) {
    const SegmentFp arm = model(count);
    const double off_mm =
        std::hypot(arm.b.x_mm - wanted.fibre_fp.x_mm, arm.b.y_mm - wanted.fibre_fp.y_mm);
    if (!std::isfinite(off_mm)) return std::nullopt;
    if (off_mm < best_mm) {
      best_mm = off_mm;
      best = count;
    }
    if (off_mm < kEnoughMm) break;
    const auto step = StepTowards(wanted, arm);
    count = {count.theta_deg + step[0], count.phi_deg + step[1]};
  }
  if (std::abs(best.theta_deg - wanted.guess.theta_deg) > kAwayMaxDeg ||
      std::abs(best.phi_deg - wanted.guess.phi_deg) > kAwayMaxDeg)
    return std::nullopt;
  return best;
}

}  // namespace focalfleet
