// The map from the sensor to the plate, as far as it is known before an exposure. With p the pixel
// and c the centre,
//
//   w  = (p - c) / (pixels_per_mm exp(i rotation))      (its conjugate where mirrored), mm
//   at = w + sum over i + j <= degree of d_ij (x_w / R)^i (y_w / R)^j
//
// The polynomial stands for the optics' distortion. The fit is in this direction, so a measurement
// needs no inverse. The exposure's own similarity, and what is left of the distortion, are solved
// from the fiducials (plate_map.h). This model only has to be near enough to find them.
#pragma once

#include <complex>
#include <cstddef>
#include <span>
#include <vector>

#include "fleet/layout.h"
#include "protocol/base/result.h"

namespace focalfleet {

struct CameraModel {
  double pixels_per_mm = 1;
  double rotation_deg = 0;  // of the image against the plate, counter-clockwise
  double centre_x_px = 0;   // pixel at which the plate's 0, 0 is seen
  double centre_y_px = 0;
  bool mirrored = false;
  double radius_mm = 1000;          // R: about the plate's radius, so that the terms are of order 1
  std::vector<PointFp> distortion;  // d_ij in mm, in the order of Monomials; empty: no distortion
};

/// The terms 1, x, y, x^2, xy, y^2, x^3 ... up to `degree`, written to `terms`. Pre: terms.size()
/// == MonomialCount(degree).
void Monomials(double x, double y, int degree, std::span<double> terms);
constexpr std::size_t MonomialCount(int degree) {
  return static_cast<std::size_t>((degree + 1) * (degree + 2) / 2);
}
inline constexpr int kDistortionDegreeMax = 7;
inline constexpr std::size_t kDistortionTermsMax = MonomialCount(kDistortionDegreeMax);

PointFp PlateOf(const CameraModel& model, double x_px, double y_px);

struct PixelOnPlate {
  double x_px = 0;
  double y_px = 0;
  PointFp at_fp;
};

/// The model with the distortion of this degree that fits the pairs best (least squares). An
/// earlier distortion is dropped. The pairs are identified fibres of one or more exposures: the
/// calibration. Errors: kInvalid: degree out of 1..7, or too few pairs, or pairs that do not
/// determine the distortion.
Result<CameraModel> WithDistortion(CameraModel model, std::span<const PixelOnPlate> pairs,
                                   int degree);

}  // namespace focalfleet
