// The optics map a place on the plate to a place on the sensor. With u = (x + i y) / R:
//
//   w = u (1 + k3 |u|^2 + k5 |u|^4)            radial
//     + d (2 |u|^2) + conj(d) u^2              decentring (an element off the axis)
//     + i t u |u|^2                            twist: a curl, which no radial term gives
//   pixel = centre + p R exp(i rotation) w     (of the conjugate of w where the image is mirrored)
//
// Frames: plate in mm from the sky side, sensor in pixels with the first pixel's centre at 0, 0. An
// exposure adds a scale, rotation and shift of its own (focus, flexure, a camera in the wind), and
// the air (turbulence.h).
#pragma once

#include <complex>

namespace focalfleet::sim {

struct Optics {
  double pixels_per_mm = 5;
  double rotation_deg = 0;
  std::complex<double> centre_px{5500, 5500};
  bool mirrored = false;
  double radius_mm = 1000;              // R
  double radial3 = 0;                   // k3; 1e-3 moves the rim by 1 mm
  double radial5 = 0;                   // k5
  std::complex<double> decentring = 0;  // d
  double twist = 0;                     // t
};

/// The place on the sensor of light from the plate. Cost: no allocation.
std::complex<double> PixelOf(const Optics& optics, std::complex<double> place_mm);

}  // namespace focalfleet::sim
