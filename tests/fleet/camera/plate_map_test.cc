#include "fleet/camera/plate_map.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "fleet/camera/camera_model.h"
#include "fleet/camera/cholesky.h"
#include "protocol/base/rng.h"
#include "sim/world/camera/turbulence.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

std::vector<PointFp> Disc(std::size_t count, double radius_mm) {
  std::vector<PointFp> places;
  for (std::size_t k = 0; k < count; ++k) {
    const double r =
        radius_mm * std::sqrt((static_cast<double>(k) + 0.5) / static_cast<double>(count));
    const double turn = 2.399963 * static_cast<double>(k);
    places.push_back({r * std::cos(turn), r * std::sin(turn)});
  }
  return places;
}

double Apart(PointFp a, PointFp b) { return std::hypot(a.x_mm - b.x_mm, a.y_mm - b.y_mm); }

TEST(Cholesky, SolvesWhatWasMultiplied) {
  Rng rng(1);
  const std::size_t n = 37;
  std::vector<double> factor(n * n);
  for (double& value : factor) value = rng.Normal();
  std::vector<double> matrix(n * n, 0);
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < n; ++j)
      for (std::size_t k = 0; k < n; ++k)
        matrix[i * n + j] += factor[i * n + k] * factor[j * n + k];
  std::vector<double> x(n);
  for (double& value : x) value = rng.Normal();
  std::vector<double> b(n, 0);
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < n; ++j) b[i] += matrix[i * n + j] * x[j];
  const auto solver = Cholesky::Of(matrix, n);
  ASSERT_TRUE(solver);
  solver->Solve(b);
  for (std::size_t i = 0; i < n; ++i) EXPECT_NEAR(b[i], x[i], 1e-6);
}

TEST(Cholesky, RefusesWhatIsNotPositive) {
  EXPECT_FALSE(Cholesky::Of({1, 0, 2, 1}, 2));
  EXPECT_FALSE(Cholesky::Of({1, 0, 1, 1}, 2)) << "singular";
  EXPECT_FALSE(Cholesky::Of({std::nan("")}, 1));
}

TEST(FitPolynomial, FindsAPolynomialAndPutsAsideWhatDoesNotBelong) {
  std::vector<KnownLight> lights;
  for (const PointFp& p : Disc(120, 1000)) {
    const double x = p.x_mm / 1000;
    const double y = p.y_mm / 1000;
    lights.push_back(
        {p, {p.x_mm + 0.4 + 0.2 * x * y * y - 0.3 * x, p.y_mm + 0.1 * x * x * x}, 0.003});
  }
  lights[17].true_fp.x_mm += 0.8;
  lights[63].true_fp.y_mm -= 0.06;
  const auto fit = FitPolynomial(lights, {});
  ASSERT_TRUE(fit);
  EXPECT_EQ(fit->degree, 5);
  EXPECT_EQ(fit->used_count, 118u);
  EXPECT_FALSE(fit->used[17]);
  EXPECT_FALSE(fit->used[63]);
  EXPECT_LT(fit->residual_mm, 1e-9);
  EXPECT_LT(Apart(PlateBy(*fit, {}, lights[3].seen_fp), lights[3].true_fp), 1e-9);
}

TEST(FitPolynomial, TakesALowerDegreeOfFewerLights) {
  for (const std::size_t count : {3u, 8u, 9u, 29u, 30u, 63u}) {
    std::vector<KnownLight> lights;
    for (const PointFp& p : Disc(count, 500)) lights.push_back({p, p, 0.003});
    const auto fit = FitPolynomial(lights, {});
    ASSERT_TRUE(fit) << count;
    EXPECT_LE(MonomialCount(fit->degree), std::max<std::size_t>(3, count / 3)) << count;
  }
}

TEST(FitPolynomial, LightsOnALineDetermineNothing) {
  std::vector<KnownLight> lights;
  for (int k = 0; k < 10; ++k) lights.push_back({{k * 10.0, 5}, {k * 10.0, 5}, 0.003});
  EXPECT_FALSE(FitPolynomial(lights, {}));
}

// Lights displaced by the simulator's air, and the map's places of others that it displaced as
// well.
struct Windy {
  std::vector<KnownLight> lights;
  std::vector<KnownLight> others;
};

Windy Blown(std::size_t count, double sigma_mm, double length_mm, Rng* rng) {
  const sim::Turbulence air({.sigma_mm = sigma_mm, .length_mm = length_mm}, rng);
  const auto seen = [&](PointFp p) {
    const std::complex<double> d = air.At({p.x_mm, p.y_mm});
    return KnownLight{
        {p.x_mm + d.real() + 0.002 * rng->Normal(), p.y_mm + d.imag() + 0.002 * rng->Normal()},
        p,
        0.002};
  };
  Windy windy;
  for (const PointFp& p : Disc(count, 1000)) windy.lights.push_back(seen(p));
  for (const PointFp& p : Disc(700, 950)) windy.others.push_back(seen(p));
  return windy;
}

TEST(AirOf, FindsTheAirsStrengthOverExposures) {
  const std::uint64_t seed = test::TestSeed(4);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  for (const double sigma_mm : {0.0, 0.004, 0.008}) {
    double sum2 = 0;
    for (int k = 0; k < 40; ++k) {
      const Windy windy = Blown(120, sigma_mm, 150, &rng);
      const auto fit = FitPolynomial(windy.lights, {});
      ASSERT_TRUE(fit);
      sum2 += std::pow(AirOf(windy.lights, fit->degree, {}).sigma_mm, 2) / 40;
    }
    // The simulator's air has another shape of covariance, hence the width. The usual law weighs
    // where there is no air.
    EXPECT_NEAR(std::sqrt(sum2), sigma_mm, 0.0025);
  }
}

TEST(PlateMap, RemovesMostOfTheAirAndClaimsWhatIsLeft) {
  const std::uint64_t seed = test::TestSeed(6);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  double with2 = 0;
  double without2 = 0;
  double sigmas2 = 0;
  int count = 0;
  for (int k = 0; k < 30; ++k) {
    const Windy windy = Blown(120, 0.008, 200, &rng);
    const auto fit = FitPolynomial(windy.lights, {});
    ASSERT_TRUE(fit);
    const auto map =
        PlateMap::Solve(windy.lights, fit->degree, AirOf(windy.lights, fit->degree, {}), {});
    ASSERT_TRUE(map);
    for (const KnownLight& light : windy.others) {
      const PlateMap::Place place = map->At(light.seen_fp);
      const double d2 = std::pow(Apart(place.at_fp, light.true_fp), 2) / 2;
      with2 += d2;
      without2 += std::pow(Apart(PlateBy(*fit, {}, light.seen_fp), light.true_fp), 2) / 2;
      sigmas2 += d2 / (place.sigma_mm * place.sigma_mm + 0.002 * 0.002);
      ++count;
    }
  }
  EXPECT_LT(std::sqrt(with2 / count), 0.6 * std::sqrt(without2 / count));
  EXPECT_NEAR(sigmas2 / count, 1, 0.35);
}

TEST(PlateMap, WithoutNoiseASmoothFieldIsFollowedEverywhere) {
  const auto light = [](PointFp p) {
    const double x = p.x_mm / 300;
    const double y = p.y_mm / 300;
    return KnownLight{
        {p.x_mm + 0.02 * std::sin(x + 0.5 * y), p.y_mm + 0.02 * std::cos(x - y)}, p, 0};
  };
  std::vector<KnownLight> lights;
  for (const PointFp& p : Disc(150, 1000)) lights.push_back(light(p));
  const auto map = PlateMap::Solve(lights, 1, {0.02, 300}, {});
  ASSERT_TRUE(map);
  // Between the lights, within the interpolation of the grid: 1.5 % of the air's 28 um, and waves
  // that are shorter than l.
  for (const PointFp& p : Disc(77, 800))
    EXPECT_LT(Apart(map->At(light(p).seen_fp).at_fp, p), 0.001);
}

TEST(CameraModel, CalibrationFindsTheDistortionFromIdentifiedPlaces) {
  CameraModel truth{.pixels_per_mm = 5,
                    .rotation_deg = 30,
                    .centre_x_px = 6000,
                    .centre_y_px = 5900,
                    .mirrored = true,
                    .radius_mm = 1000,
                    .distortion = {}};
  truth.distortion.resize(MonomialCount(3));
  truth.distortion[7] = {0.5, -0.25};
  std::vector<PixelOnPlate> pairs;
  for (const PointFp& p : Disc(200, 5000))
    pairs.push_back({p.x_mm + 6000, p.y_mm + 5900, PlateOf(truth, p.x_mm + 6000, p.y_mm + 5900)});
  CameraModel model = truth;
  model.distortion.clear();
  const auto fitted = WithDistortion(model, pairs, 3);
  ASSERT_TRUE(fitted) << fitted.error().text;
  for (std::size_t k = 0; k < truth.distortion.size(); ++k)
    EXPECT_LT(Apart(fitted->distortion[k], truth.distortion[k]), 1e-6) << k;
  EXPECT_FALSE(WithDistortion(model, pairs, 8));
  EXPECT_FALSE(WithDistortion(model, std::span(pairs).first(19), 3));
  EXPECT_FALSE(WithDistortion(model, std::vector<PixelOnPlate>(50), 1)) << "all at one place";
}

TEST(Monomials, ComeDegreeByDegree) {
  std::vector<double> terms(MonomialCount(3));
  Monomials(2, 3, 3, terms);
  EXPECT_EQ(terms, (std::vector<double>{1, 2, 3, 4, 6, 9, 8, 12, 18, 27}));
}

}  // namespace
}  // namespace focalfleet
