// The field of magnetised pieces against dipoles that other code sums by the midpoint rule,
// extrapolated from two step sizes.
#include "sim/hall/magnet_array.h"

#include <gtest/gtest.h>

#include "protocol/base/rng.h"
#include "sim/hall/sensors.h"
#include "tests/sim/hall/planted_rig.h"
#include "tests/support/seed.h"

namespace focalfleet::sim {
namespace {

void ExpectSameField(const std::vector<MagnetShell>& shells,
                     const std::vector<test::Shell>& planted) {
  const std::uint64_t seed = test::TestSeed(1);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  const MagnetArray array(shells);
  const test::DipoleRotor coarse(planted, 12), fine(planted, 24);
  const double peak_T = std::abs(array.Radial_T({1, 0, 0}, 59));
  for (int k = 0; k < 12; ++k) {
    // Half of the places lie within 40 deg of the equator, where sensors stand, half anywhere.
    const double z = rng.Uniform(-1, 1) * (k % 2 == 0 ? 0.64 : 1);
    const double phi = rng.Uniform(0, 6.28), flat = std::sqrt(1 - z * z);
    const Vector3 u{flat * std::cos(phi), flat * std::sin(phi), z};
    const Vector3 ours = array.Field_T(59 * u);
    const test::Vec place = {59 * u.x, 59 * u.y, 59 * u.z};
    const test::Vec one = coarse.Field(place), two = fine.Field(place);
    const double parts[] = {ours.x, ours.y, ours.z};
    for (std::size_t i = 0; i < 3; ++i)
      EXPECT_NEAR(parts[i], (4 * two[i] - one[i]) / 3, 1e-4 * peak_T) << k << " part " << i;
  }
}

TEST(MagnetArray, OneShellAgreesWithAnIndependentSumOfDipoles) {
  ExpectSameField(OneShellArray(), test::PlantedOneShell());
}
TEST(MagnetArray, TwoShellsAgreeWithAnIndependentSumOfDipoles) {
  ExpectSameField(TwoShellArray(), test::PlantedTwoShells());
}
TEST(MagnetArray, UnlikeMagnetsAgreeToo) {
  auto ours = OneShellArray();
  auto planted = test::PlantedOneShell();
  ours[0].strength = {1.02, 0.97, 1, 1.01, 0.99, 1, 1.03, 0.98};
  planted[0].strength = ours[0].strength;
  ExpectSameField(ours, planted);
}

TEST(MagnetArray, ThreeDimensionalArrayIsBeyondTheSensorsRange) {
  const SensorElectronics electronics;
  EXPECT_DOUBLE_EQ(electronics.range_T(), 0.1);
  EXPECT_LT(MagnetArray(OneShellArray()).Radial_T({1, 0, 0}, 59), electronics.range_T());
  EXPECT_GT(MagnetArray(TwoShellArray()).Radial_T({1, 0, 0}, 59), electronics.range_T());
  EXPECT_FALSE(Field_T({}, electronics, Voltage_V({}, electronics, 0.13)));
}

}  // namespace
}  // namespace focalfleet::sim
