// The map from the sensor to the plate of one exposure. The map is solved from lights whose places
// are known: the fiducials, and units that are known not to have moved. Beyond the camera's model
// these show a polynomial b of the plate: the similarity of this exposure and the rest of the
// distortion. They also show the air, a Gaussian process of covariance s^2 exp(-r^2 / (2 l^2)),
// plus each light's own noise. Both are solved at once, by generalised least squares and kriging:
//
//   C = s^2 K + diag(noise^2)                   b = (F' C^-1 F)^-1 F' C^-1 y
//   correction at x = f(x) b + k(x)' C^-1 (y - F b)
//   variance at x   = s^2 - k' C^-1 k + |f - F' C^-1 k|^2 in the metric (F' C^-1 F)^-1
//
// s and l are not assumed: they are those under which the residuals are likeliest. The air's part
// and the variance are computed on a grid of l / 3 and interpolated. The error of the air's part is
// below 1.5 % of s. The variance, which is expensive and smooth, is computed at every second node
// each way.
// Cost: n^3 / 6 + n^2 nodes / 8 for n lights.
// Source: [RasmussenWilliams2006] section 2.7.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "fleet/camera/fiducials.h"

namespace focalfleet {

/// A light that was seen, and its true place.
struct KnownLight {
  PointFp seen_fp;  // by the camera's model, after the alignment
  PointFp true_fp;
  double noise_mm = 0;  // of one coordinate: centroid, and uncertainty of true_fp
};

/// The air of one exposure: covariance of one coordinate sigma^2 exp(-r^2 / (2 length^2)).
struct AirLaw {
  double sigma_mm = 0;
  double length_mm = 150;
};

struct PlateMapOptions {
  int degree = 5;           // of the polynomial; lower where there are fewer than 3 lights a term
  double radius_mm = 1000;  // normalises the polynomial
  AirLaw usual_air{0.006, 150};
  double outlier_sigmas = 4.5;
  double residual_mm_min = 0.02;  // below this no light is an outlier
};

/// A polynomial fit without the air, from the lights that fit, and the residuals of these.
struct PolynomialFit {
  int degree = 1;
  std::vector<PointFp> coefficients;
  std::vector<bool> used;  // Shape: as the lights
  double residual_mm = 0;  // rms of one coordinate over those used, per degree of freedom
  std::size_t used_count = 0;
};
/// The fit without the lights whose residual is beyond `outlier_sigmas` of the others'; the worst
/// goes first. Empty: fewer than three lights are left. `degree` is the most; the highest that the
/// count allows is taken.
std::optional<PolynomialFit> FitPolynomial(std::span<const KnownLight> lights,
                                           const PlateMapOptions& options);

/// The place on the plate, by the fit, of a light that the camera's model sees at `seen_fp`.
PointFp PlateBy(const PolynomialFit& fit, const PlateMapOptions& options, PointFp seen_fp);

/// The law under which the lights' residuals are likeliest (restricted likelihood, with a wide
/// prior around the usual one). The search climbs a lattice of factors 1.5. With a wrong length the
/// map would be worse, and its stated errors would be too small. Cost: about 12 factorisations of
/// at most 150 lights, 5 ms.
AirLaw AirOf(std::span<const KnownLight> lights, int degree, const PlateMapOptions& options);

class PlateMap {
 public:
  /// The map from all given lights. Empty: the lights do not determine it.
  static std::optional<PlateMap> Solve(std::span<const KnownLight> lights, int degree,
                                       const AirLaw& air, const PlateMapOptions& options);

  struct Place {
    PointFp at_fp;
    double sigma_mm = 0;  // of one coordinate, of the map alone
  };
  [[nodiscard]] Place At(PointFp seen_fp) const;
  [[nodiscard]] int degree() const { return degree_; }
  [[nodiscard]] std::size_t light_count() const { return light_count_; }

 private:
  struct Node {
    PointFp air_fp;
    double variance_mm2 = 0;
  };
  void FillNodes(class PlateSolution* solution);

  std::size_t light_count_ = 0;
  int degree_ = 1;
  double radius_mm_ = 1;
  std::vector<PointFp> coefficients_;
  PointFp low_;
  double step_mm_ = 1;
  std::size_t columns_ = 1;
  std::size_t rows_ = 1;
  std::vector<Node> nodes_;
};

}  // namespace focalfleet
