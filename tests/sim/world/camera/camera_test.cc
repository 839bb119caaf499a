#include "sim/world/camera/camera.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <set>

#include "tests/support/seed.h"

namespace focalfleet::sim {
namespace {

using Complex = std::complex<double>;

std::vector<LightSource> Grid(int side, double step_mm) {
  std::vector<LightSource> sources;
  for (int i = 0; i < side; ++i)
    for (int j = 0; j < side; ++j)
      sources.push_back({LightKind::kFibre, static_cast<std::uint32_t>(sources.size()),
                         Complex((i - side / 2) * step_mm, (j - side / 2) * step_mm), 1});
  return sources;
}

CameraTraits Quiet() {
  CameraTraits traits;
  traits.centroid_sigma_px = 0;
  return traits;
}

TEST(Turbulence, HasItsCovarianceOverRealisations) {
  const std::uint64_t seed = test::TestSeed(3);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  const TurbulenceLaw law{.sigma_mm = 0.008, .length_mm = 120};
  const double distances_mm[] = {0, 60, 120, 240, 480};
  double sums[5] = {};
  double cross = 0;
  double mean = 0;
  const int realisations = 4000;
  for (int k = 0; k < realisations; ++k) {
    const Turbulence air(law, &rng);
    const Complex here = air.At({30, -70});
    for (int d = 0; d < 5; ++d)
      sums[d] += here.real() * air.At(Complex(30, -70) + std::polar(distances_mm[d], 1.0)).real();
    cross += here.real() * here.imag();
    mean += here.real();
  }
  const double variance = law.sigma_mm * law.sigma_mm;
  for (int d = 0; d < 5; ++d) {
    const double r = distances_mm[d] / law.length_mm;
    const double expected = variance * std::pow(1 + r * r / 4, -2);
    EXPECT_NEAR(sums[d] / realisations, expected, 5 * variance / std::sqrt(realisations))
        << distances_mm[d];
  }
  EXPECT_NEAR(cross / realisations, 0, 5 * variance / std::sqrt(realisations));
  EXPECT_NEAR(mean / realisations, 0, 5 * law.sigma_mm / std::sqrt(realisations));
}

TEST(Turbulence, IsSmoothAndNothingWithoutAir) {
  Rng rng(1);
  const Turbulence air({.sigma_mm = 0.008, .length_mm = 150}, &rng);
  EXPECT_LT(std::abs(air.At({10, 10}) - air.At({11, 10})), 0.001);
  EXPECT_EQ(Turbulence({}, &rng).At({5, 5}), Complex(0, 0));
}

TEST(Optics, WithoutDistortionIsASimilarity) {
  const Optics optics{.pixels_per_mm = 4, .rotation_deg = 90, .centre_px = {100, 200}};
  EXPECT_LT(std::abs(PixelOf(optics, {10, 0}) - Complex(100, 240)), 1e-9);
  EXPECT_LT(std::abs(PixelOf(optics, {0, 10}) - Complex(60, 200)), 1e-9);
}

TEST(Optics, MirrorsAcrossThePlatesXAxis) {
  const Optics optics{.pixels_per_mm = 1, .centre_px = {0, 0}, .mirrored = true};
  EXPECT_LT(std::abs(PixelOf(optics, {3, 4}) - Complex(3, -4)), 1e-12);
}

TEST(Optics, EachTermMovesTheRimAsItsHeaderSays) {
  const Complex rim = std::polar(1000.0, 0.7);
  const auto moved = [&](const Optics& optics) { return PixelOf(optics, rim); };
  Optics plain{.pixels_per_mm = 1, .centre_px = {0, 0}};
  Optics radial = plain;
  radial.radial3 = 1e-3;
  EXPECT_LT(std::abs(moved(radial) - rim * 1.001), 1e-9);
  Optics twist = plain;
  twist.twist = 1e-3;
  EXPECT_LT(std::abs(moved(twist) - rim * Complex(1, 1e-3)), 1e-9);
  Optics decentred = plain;
  decentred.decentring = {1e-4, 0};
  EXPECT_LT(std::abs(moved(decentred) - rim - 1000.0 * (2e-4 + 1e-4 * std::polar(1.0, 1.4))), 1e-9);
}

TEST(Camera, WithoutTroublesEveryLightIsASpotInItsPlace) {
  const auto sources = Grid(10, 25);
  Rng rng(1);
  const Image image = TakeImage(sources, Quiet(), &rng);
  ASSERT_EQ(image.spots.size(), sources.size());
  for (std::size_t k = 0; k < image.spots.size(); ++k) {
    ASSERT_EQ(image.light[k].size(), 1u);
    const Complex seen(image.spots[k].x_px, image.spots[k].y_px);
    EXPECT_LT(std::abs(seen - PixelOf(Quiet().optics, sources[image.light[k][0]].place_mm)), 1e-9);
    EXPECT_EQ(image.spots[k].flux, 1);
    if (k > 0) {
      EXPECT_LE(image.spots[k - 1].y_px, image.spots[k].y_px);
    }
  }
}

TEST(Camera, TheSameSeedTakesTheSamePicture) {
  CameraTraits traits;
  traits.air.sigma_mm = 0.008;
  traits.missing_share = 0.1;
  traits.extra_share = 0.1;
  traits.flux_scatter = 0.1;
  Rng a(7);
  Rng b(7);
  const Image one = TakeImage(Grid(12, 25), traits, &a);
  const Image two = TakeImage(Grid(12, 25), traits, &b);
  ASSERT_EQ(one.spots.size(), two.spots.size());
  for (std::size_t k = 0; k < one.spots.size(); ++k) {
    EXPECT_EQ(one.spots[k].x_px, two.spots[k].x_px);
    EXPECT_EQ(one.spots[k].flux, two.spots[k].flux);
  }
}

TEST(Camera, NoiseFallsWithTheRootOfTheFlux) {
  const std::uint64_t seed = test::TestSeed(5);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  CameraTraits traits = Quiet();
  traits.centroid_sigma_px = 0.02;
  double sum2[2] = {};
  for (int k = 0; k < 4000; ++k) {
    const std::vector<LightSource> sources = {{LightKind::kFibre, 1, {-50, 0}, 1},
                                              {LightKind::kFibre, 2, {50, 1}, 4}};
    const Image image = TakeImage(sources, traits, &rng);
    for (std::size_t s = 0; s < 2; ++s) {
      const double x = PixelOf(traits.optics, sources[image.light[s][0]].place_mm).real();
      sum2[image.light[s][0]] += std::pow(image.spots[s].x_px - x, 2);
    }
  }
  EXPECT_NEAR(std::sqrt(sum2[0] / 4000), 0.02, 0.0012);
  EXPECT_NEAR(std::sqrt(sum2[1] / 4000), 0.01, 0.0006);
}

TEST(Camera, TwoNearLightsAreOneSpotAtTheirCentreOfLight) {
  Rng rng(1);
  CameraTraits traits = Quiet();  // 2.2 px wide, 5 px a mm: spots within 0.44 mm become one
  const std::vector<LightSource> sources = {{LightKind::kFibre, 1, {0, 0}, 1},
                                            {LightKind::kFibre, 2, {0.3, 0}, 2},
                                            {LightKind::kFibre, 3, {0, 0.6}, 1}};
  const Image image = TakeImage(sources, traits, &rng);
  ASSERT_EQ(image.spots.size(), 2u);
  const std::size_t blend = image.light[0].size() == 2 ? 0 : 1;
  EXPECT_EQ(std::set<std::uint32_t>(image.light[blend].begin(), image.light[blend].end()),
            (std::set<std::uint32_t>{0, 1}));
  EXPECT_NEAR(image.spots[blend].flux, 3, 1e-12);
  EXPECT_NEAR(image.spots[blend].x_px, traits.optics.centre_px.real() + 5 * 0.2, 1e-9);
  // The blend adds 2/9 of the squared distance of 1.5 px, half of it in each direction.
  EXPECT_NEAR(image.spots[blend].fwhm_px,
              std::sqrt(2.2 * 2.2 + 2.35482 * 2.35482 * 2.25 * 2 / 9 / 2), 1e-4);
}

TEST(Camera, LosesItsShareAndAddsItsShare) {
  const std::uint64_t seed = test::TestSeed(9);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  CameraTraits traits = Quiet();
  traits.missing_share = 0.02;
  traits.extra_share = 0.01;
  const auto sources = Grid(50, 25);
  std::size_t lit = 0;
  std::size_t extra = 0;
  for (int k = 0; k < 40; ++k)
    for (const auto& light : TakeImage(sources, traits, &rng).light)
      light.empty() ? ++extra : lit += light.size();
  EXPECT_NEAR(static_cast<double>(lit), 40 * 2500 * 0.98, 5 * std::sqrt(40 * 2500 * 0.02));
  // Some extras fall onto a fibre's spot; no other is lost.
  EXPECT_LE(extra, 40u * 25);
  EXPECT_GE(extra, 40u * 25 - 10);
}

TEST(Camera, TheSensorsEdgeCutsOff) {
  Rng rng(1);
  CameraTraits traits = Quiet();
  traits.sensor_px = {5500, 11000};  // the left half
  const Image image = TakeImage(Grid(10, 25), traits, &rng);
  EXPECT_EQ(image.spots.size(), 50u);
}

}  // namespace
}  // namespace focalfleet::sim
