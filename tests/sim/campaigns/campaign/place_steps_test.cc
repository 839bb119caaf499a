#include "sim/campaigns/campaign/place_steps.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "tests/sim/campaigns/campaign/odd_places.h"
#include "tests/sim/campaigns/planting/planted_campaign.h"

namespace focalfleet::sim {
namespace {

using test::InSteps;
using test::Planted;

constexpr double kMissing = std::numeric_limits<double>::quiet_NaN();

TEST(PlaceSteps, AreThoseOfWholePixels) {
  const Campaign fine = Planted({}, {.units = 24, .moves = 40});
  for (const double step_mm : {0.2, 0.1, 0.09, 0.05, 0.02, 0.0903271, 1.0 / 7}) {
    const PlaceSteps steps = FindPlaceSteps(InSteps(fine, step_mm));
    EXPECT_NEAR(steps.x_mm, step_mm, 1e-6 * step_mm);
    EXPECT_NEAR(steps.y_mm, step_mm, 1e-6 * step_mm);
  }
}

TEST(PlaceSteps, AreFoundWhereThePlacesAreRoundedOnceMore) {
  const Campaign pixels = InSteps(Planted({}, {.units = 24, .moves = 40}), 1.0 / 7);
  EXPECT_NEAR(FindPlaceSteps(InSteps(pixels, 1e-4)).x_mm, 1.0 / 7, 1e-4);
}

TEST(PlaceSteps, AreNoneInPlacesOfManyDigits) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const Campaign fine = Planted({}, {.units = 1 + seed, .moves = 8 + seed, .seed = seed});
    EXPECT_EQ(FindPlaceSteps(fine).wider_mm(), 0) << seed;
    EXPECT_NEAR(FindPlaceSteps(InSteps(fine, 1e-6)).wider_mm(), 1e-6, 1e-9) << seed;
  }
}

TEST(PlaceSteps, AreNotHiddenByAFewOtherPlaces) {
  Campaign campaign = InSteps(Planted({}, {.units = 24, .moves = 40}), 0.1);
  for (std::size_t row = 0; row < campaign.rows(); row += 200) campaign.x_mm[row] += 0.0123456;
  EXPECT_NEAR(FindPlaceSteps(campaign).x_mm, 0.1, 1e-6);
}

// Units 100 mm apart, each seen within 8 mm: gaps are near nothing or 92 mm.
TEST(PlaceSteps, AreNotTheDistancesOfUnitsFarApart) {
  Rng rng = Rng::Stream(3, "places");
  std::vector<double> places;
  for (int unit = 0; unit < 12; ++unit) {
    places.insert(places.end(), {100.0 * unit - 4, 100.0 * unit + 4});
    for (int move = 0; move < 57; ++move) places.push_back(100 * unit + rng.Uniform(-4, 4));
  }
  EXPECT_EQ(FindStep(places), 0);
}

TEST(PlaceSteps, OfAFewPlacesAreTheirDigits) {
  EXPECT_NEAR(FindStep(std::vector<double>{1.2, kMissing, 3.4, 5.7}), 0.1, 1e-12);
  EXPECT_EQ(FindStep(std::vector<double>{7, 7, kMissing}), 0);  // a single place shows no step
  EXPECT_EQ(FindStep({}), 0);
}

TEST(PlaceSteps, AlongEachAxisAreItsOwn) {
  Campaign campaign = InSteps(Planted({}, {.units = 24, .moves = 40}), 0.05);
  campaign.y_mm = InSteps(campaign, 0.1).y_mm;
  const PlaceSteps steps = FindPlaceSteps(campaign);
  EXPECT_NEAR(steps.x_mm, 0.05, 1e-9);
  EXPECT_NEAR(steps.y_mm, 0.1, 1e-9);
  EXPECT_EQ(steps.wider_mm(), steps.y_mm);
}

// The variance of an even spread over one step is a twelfth of its square.
TEST(LeastNoise, IsTheSpreadOfTheWiderStep) {
  const Campaign campaign = InSteps(Planted({}, {.units = 24, .moves = 40}), 0.1);
  EXPECT_NEAR(LeastNoise_um(campaign, FindPlaceSteps(campaign)), 28.8675, 1e-3);
}

TEST(LeastNoise, IsNeverNothing) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 40});
  std::erase_if(campaign.covariates, [](const Covariate& c) { return c.name == "sigma_um"; });
  EXPECT_EQ(LeastNoise_um(campaign, {}), kNoiseLeast_um);
  campaign.covariates.push_back({"sigma_um", std::vector<double>(campaign.rows(), 0.3)});
  campaign.covariates.back().values.front() = kMissing;
  EXPECT_NEAR(LeastNoise_um(campaign, {}), 0.1 / std::sqrt(12.0), 1e-12);
  campaign.covariates.back().values.back() = 0;  // as exact as a tenth of a micrometre is
  EXPECT_NEAR(LeastNoise_um(campaign, {}), 0.1 / std::sqrt(12.0), 1e-12);
  campaign.covariates.back().values.assign(campaign.rows(), 0);
  EXPECT_NEAR(LeastNoise_um(campaign, {}), 1 / std::sqrt(12.0), 1e-12);
}

}  // namespace
}  // namespace focalfleet::sim
