#include "sim/world/camera/optics.h"

#include <numbers>

namespace focalfleet::sim {

std::complex<double> PixelOf(const Optics& optics, std::complex<double> place_mm) {
  const std::complex<double> u = place_mm / optics.radius_mm;
  const double r2 = std::norm(u);
  std::complex<double> w = u * (1 + r2 * (optics.radial3 + r2 * optics.radial5));
  w += 2 * r2 * optics.decentring + std::conj(optics.decentring) * u * u;
  w += std::complex<double>(0, optics.twist * r2) * u;
  if (optics.mirrored) w = std::conj(w);
  return optics.centre_px + std::polar(optics.pixels_per_mm * optics.radius_mm,
                                       optics.rotation_deg * std::numbers::pi / 180) *
                                w;
}

}  // namespace focalfleet::sim
