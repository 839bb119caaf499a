// Fits return the planted field, state their uncertainty, and hold where they were not fitted.
#include "sim/hall/field_fit.h"

#include <gtest/gtest.h>

#include "protocol/base/rng.h"
#include "tests/sim/hall/planted_rig.h"
#include "tests/support/seed.h"

namespace focalfleet::sim {
namespace {

// The map of a law at 59 mm (or at `radius_mm`), every `step_deg`.
FieldMap MapOf(const test::FieldLaw& law, int step_deg, double noise_T, std::uint64_t seed,
               double radius_mm = 59) {
  Rng rng(seed);
  FieldMap map;
  for (int theta = 0; theta <= 180; theta += step_deg)
    for (int phi = 0; phi < 360; phi += step_deg) {
      const Vector3 u = DirectionAt(theta * kRadPerDeg, phi * kRadPerDeg);
      const double b_T = law({radius_mm * u.x, radius_mm * u.y, radius_mm * u.z}, {u.x, u.y, u.z});
      map.push_back(
          {theta * kRadPerDeg, phi * kRadPerDeg, b_T + noise_T * rng.Normal(), radius_mm});
    }
  return map;
}

double WorstElsewhere_T(const FieldFit& fit, const test::FieldLaw& law, std::uint64_t seed) {
  Rng rng(seed);
  const auto model = MakeField(fit.parameters);
  double worst_T = 0;
  for (int k = 0; k < 60; ++k) {
    const Vector3 u = Unit({rng.Normal(), rng.Normal(), 0.5 * rng.Normal()});
    worst_T = std::max(worst_T, std::abs(model->Radial_T(u) -
                                         law({59 * u.x, 59 * u.y, 59 * u.z}, {u.x, u.y, u.z})));
  }
  return worst_T;
}

TEST(FieldFit, FindsThePlantedSurfaceWithinItsUncertainty) {
  const std::uint64_t seed = test::TestSeed(5);
  FOCALFLEET_TRACE_SEED(seed);
  double chi2 = 0;
  constexpr int kTrials = 40;
  for (int k = 0; k < kTrials; ++k) {
    const auto fit =
        FitField(MapOf(test::OfSurface(0.08, 21), 6, 5e-4, seed + static_cast<std::uint64_t>(k)),
                 FieldKind::kSurface);
    ASSERT_TRUE(fit);
    const auto surface = std::get<SurfaceParameters>(fit->parameters);
    EXPECT_NEAR(surface.width_rad / kRadPerDeg, 21, 5 * surface.sd_width_rad / kRadPerDeg);
    EXPECT_NEAR(surface.phase_rad, 0, 5 * surface.sd_phase_rad);
    EXPECT_NEAR(fit->rms_T, 5e-4, 5e-5);
    chi2 += std::pow((surface.width_rad - 21 * kRadPerDeg) / surface.sd_width_rad, 2);
  }
  EXPECT_GT(chi2, 0.45 * kTrials);
  EXPECT_LT(chi2, 1.9 * kTrials);
}

TEST(FieldFit, SphericalModelHoldsBetweenThePointsOfItsMap) {
  const test::DipoleRotor rotor(test::PlantedTwoShells(), 6);
  const auto law = test::OfRotor(rotor);
  const FieldMap map = MapOf(law, 6, 0, 1);
  const auto spherical = FitField(map, FieldKind::kSpherical);
  const auto surface = FitField(map, FieldKind::kSurface);
  const auto harmonic = FitField(map, FieldKind::kHarmonic);
  ASSERT_TRUE(spherical && surface && harmonic);
  EXPECT_LT(spherical->rms_T, 1e-4 * spherical->peak_T);
  EXPECT_LT(WorstElsewhere_T(*spherical, law, 2), 1e-3 * spherical->peak_T);
  EXPECT_LT(20 * spherical->rms_T, surface->rms_T);
  EXPECT_LT(4 * surface->rms_T, harmonic->rms_T);
  EXPECT_FALSE(spherical->all_orders);
}

TEST(FieldFit, TellsUnlikeMagnetsFromNoise) {
  auto shells = test::PlantedOneShell();
  shells[0].strength = {1.02, 0.97, 1, 1.01, 0.99, 1, 1.03, 0.98};
  const test::DipoleRotor rotor(shells, 5);
  const auto law = test::OfRotor(rotor);
  const auto fit = FitField(MapOf(law, 6, 2e-4, 7), FieldKind::kSpherical);
  ASSERT_TRUE(fit);
  EXPECT_TRUE(fit->all_orders);
  EXPECT_LT(WorstElsewhere_T(*fit, law, 8), 4e-4);
  const auto even = FitField(MapOf(test::OfSurface(0.08, 21), 6, 2e-4, 9), FieldKind::kSpherical);
  ASSERT_TRUE(even);
  EXPECT_FALSE(even->all_orders) << "noise is no magnet";
  EXPECT_NEAR(even->noise_T, 2e-4, 2e-5);
}

TEST(FieldFit, TwoCutsAreEnoughOfAnIdealArray) {
  const test::DipoleRotor rotor(test::PlantedOneShell(), 6);
  const auto law = test::OfRotor(rotor);
  FieldMap map;
  const auto add = [&](double theta_deg, double phi_deg) {
    const Vector3 u = DirectionAt(theta_deg * kRadPerDeg, phi_deg * kRadPerDeg);
    map.push_back({theta_deg * kRadPerDeg, phi_deg * kRadPerDeg,
                   law({59 * u.x, 59 * u.y, 59 * u.z}, {u.x, u.y, u.z})});
  };
  for (int phi = 0; phi < 360; phi += 3) add(90, phi);
  for (int theta = 0; theta <= 180; theta += 2) add(theta, 0);
  const auto fit = FitField(map, FieldKind::kSpherical);
  ASSERT_TRUE(fit);
  EXPECT_LT(WorstElsewhere_T(*fit, law, 3), 0.05 * fit->peak_T);
}

TEST(FieldFit, FindsHowTheFieldFallsOffFromMapsAtTwoRadii) {
  const test::DipoleRotor rotor(test::PlantedOneShell(), 4);
  const auto law = test::OfRotor(rotor);
  FieldMap map = MapOf(law, 10, 0, 1, 58);
  const FieldMap outer = MapOf(law, 10, 0, 1, 60);
  map.insert(map.end(), outer.begin(), outer.end());
  const auto fit = FitField(map, FieldKind::kSpherical);
  ASSERT_TRUE(fit);
  ASSERT_TRUE(fit->decay);
  EXPECT_NEAR(fit->radius_mm, 59, 1e-9);
  // The sources lie within: the decay is at least the lowest degree's l + 2 = 6.
  EXPECT_GT(*fit->decay, 6);
  EXPECT_LT(*fit->decay, 9);
}

TEST(FieldFit, RefusesWhatTellsNothing) {
  FieldMap map(11, FieldPoint{1, 0, 0.01});
  EXPECT_FALSE(FitField(map, FieldKind::kSurface)) << "too few";
  map.assign(30, FieldPoint{1, 0, 0.01});
  EXPECT_FALSE(FitField(map, FieldKind::kSpherical)) << "one theta";
  for (std::size_t k = 0; k < map.size(); ++k) map[k] = {0.1 * static_cast<double>(k), 0, 0};
  EXPECT_FALSE(FitField(map, FieldKind::kHarmonic)) << "no field";
}

}  // namespace
}  // namespace focalfleet::sim
