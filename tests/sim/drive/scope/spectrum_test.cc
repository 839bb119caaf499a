#include "sim/drive/scope/spectrum.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <numbers>

#include "protocol/base/rng.h"
#include "tests/support/seed.h"

namespace focalfleet::sim {
namespace {

using Complex = std::complex<double>;
using ::focalfleet::test::TestSeed;

TEST(Spectrum, IsTheSumThatDefinesIt) {
  const std::uint64_t seed = TestSeed(1);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  for (const std::size_t size : {1u, 2u, 8u, 64u}) {
    std::vector<Complex> samples(size);
    for (Complex& sample : samples) sample = {rng.Normal(), rng.Normal()};
    const auto components = Components(samples);
    for (std::size_t m = 0; m < size; ++m) {
      Complex sum;
      for (std::size_t k = 0; k < size; ++k)
        sum += samples[k] * std::polar(1.0 / static_cast<double>(size),
                                       -2 * std::numbers::pi * static_cast<double>(m * k) /
                                           static_cast<double>(size));
      EXPECT_NEAR(std::abs(components[m] - sum), 0, 1e-13) << size << " " << m;
    }
  }
}

TEST(Spectrum, APhaseSeesBothDirectionsAsOneHarmonic) {
  std::vector<Complex> samples(32);
  for (std::size_t k = 0; k < samples.size(); ++k) {
    const double angle = 2 * std::numbers::pi * static_cast<double>(k) / 32;
    // The signal goes forward once and backwards five times, and has a mean.
    samples[k] = std::polar(3.0, angle) + std::polar(2.0, -5 * angle) + 0.5;
  }
  const auto harmonics = PhaseHarmonics(Components(samples));
  ASSERT_EQ(harmonics.size(), 16u);
  for (std::size_t m = 0; m < harmonics.size(); ++m)
    EXPECT_NEAR(harmonics[m], m == 0 ? 0.5 : m == 1 ? 3.0 : m == 5 ? 2.0 : 0.0, 1e-14) << m;
}

}  // namespace
}  // namespace focalfleet::sim
