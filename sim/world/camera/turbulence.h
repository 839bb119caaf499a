// The air between plate and camera displaces every spot of an exposure by a smooth random field.
// Neighbours share the displacement, and each exposure has a new one. Each coordinate is a Gaussian
// process over the plate with the covariance
//
//   C(r) = sigma^2 (1 + r^2 / (2 a l^2))^-a,   a = 2 (rational quadratic)
//
// This is a mixture of Gaussian correlations of many lengths around l, as eddies have many sizes.
// The field is drawn as a sum of M waves (random Fourier features):
//
//   d(x) = sigma sqrt(2/M) sum cos(k_j x + f_j)
//
// f_j is even over a turn, k_j is normal with deviation sqrt(g_j / a) / l, and g_j has a Gamma
// distribution of shape a. The covariance over realisations is C exactly, for any M; with M = 96 a
// realisation is near enough to normal. Cost: M cosines a coordinate and spot, about 10 ms for 5000
// fibres. Source: [RahimiRecht2007].
#pragma once

#include <array>
#include <complex>
#include <vector>

#include "protocol/base/rng.h"

namespace focalfleet::sim {

struct TurbulenceLaw {
  double sigma_mm = 0;     // of one coordinate
  double length_mm = 150;  // l
};

/// A realisation: the air during one exposure.
class Turbulence {
 public:
  Turbulence(const TurbulenceLaw& law, Rng* rng);
  /// The displacement of light from this place. Frame: focal plane, mm.
  [[nodiscard]] std::complex<double> At(std::complex<double> place_mm) const;

 private:
  struct Wave {
    std::complex<double> wave_per_mm;
    double phase = 0;
  };
  double amplitude_mm_ = 0;
  std::array<std::vector<Wave>, 2> waves_;  // x, y
};

}  // namespace focalfleet::sim
