// Units whose place is not known are found in a picture, and not taken for each other.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "fleet/camera/expectation.h"
#include "tests/fleet/camera/identify_fixture.h"

namespace focalfleet {
namespace {

using test::kNoTroubles;
using IdentifyLost = test::IdentifyTest;

TEST_F(IdentifyLost, AUnitOfUnknownPlaceIsFoundByElimination) {
  field_.Move(kNoTroubles);
  auto expectations = field_.Expectations();
  expectations[30] = {};
  Picture(field_.Sources());
  const auto seen = Ask(expectations);
  ASSERT_TRUE(seen);
  EXPECT_EQ(seen->units[30].status, MeasurementStatus::kStrayed);
  ASSERT_NE(seen->units[30].spot, kNoSpot);
  EXPECT_EQ(image_.light[seen->units[30].spot], std::vector<std::uint32_t>{30});
}

// Power was lost in mid-move: the units report where their moves began, and are anywhere on the
// way. Many of them never left. A dark one's report may then lead to the fibre of another lost one.
TEST_F(IdentifyLost, TakesThemForEachOtherAsSeldomAsStated) {
  constexpr BlindError kBlind{.theta_sigma_deg = 0.7, .phi_sigma_deg = 0.7, .place_sigma_mm = 0.06};
  constexpr double kSlack_deg = 3;
  constexpr double kSurest = 1e-5;  // doubt: one of many in which two claims agree
  const std::uint64_t seed = test::TestSeed(1);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng = Rng::Stream(seed, "interrupted");
  traits_.missing_share = 0.05;
  options_.shares.missing = traits_.missing_share;
  double stated = 0;
  std::uint32_t wrong = 0, found = 0, surest = 0, swapped = 0;
  for (int k = 0; k < 100; ++k) {
    field_.Move(kNoTroubles);
    auto expectations = field_.Expectations();
    for (std::uint32_t i = 0; i < expectations.size(); ++i) {
      if (rng.Uniform() < 0.3) continue;
      test::PlantedUnit& unit = field_.units()[i];
      const double way = rng.Uniform() < 0.5 ? rng.Uniform(0, 0.05) : rng.Uniform();
      AxisAngles at = unit.before;
      at.theta_deg += way * (unit.commanded.theta_deg - unit.before.theta_deg);
      at.phi_deg += way * (unit.commanded.phi_deg - unit.before.phi_deg);
      unit.place_mm = field_.PlaceOf(i, at);
      const auto range = [](double a, double b) {
        return AngleBox::Range{std::min(a, b) - kSlack_deg, std::max(a, b) + kSlack_deg};
      };
      const AngleBox box{{range(unit.before.theta_deg, unit.commanded.theta_deg),
                          range(unit.before.phi_deg, unit.commanded.phi_deg)}};
      expectations[i] = ExpectLost(field_.layout().unit({i}), unit.before, box, kBlind);
    }
    Picture(field_.Sources());
    const auto seen = Ask(expectations);
    ASSERT_TRUE(seen) << seen.error().text;
    for (std::uint32_t i = 0; i < expectations.size(); ++i) {
      const UnitMeasurement& one = seen->units[i];
      if (one.status == MeasurementStatus::kSwapped) ++swapped;
      if (!IsCertain(one.status)) continue;
      ++found;
      if (!(one.doubt < kSurest)) continue;
      ++surest;
      stated += one.doubt;
      const std::vector<std::uint32_t>& light = image_.light[one.spot];
      if (std::ranges::count(light, i) == 0) ++wrong;
    }
  }
  EXPECT_GT(found, 0.8 * 217 * 100) << "of all";
  EXPECT_EQ(swapped, 0u) << "a report is no command";
  EXPECT_GT(surest, 10'000u);
  EXPECT_LT(stated, 0.01) << "chance would make one wrong in a hundred runs";
  EXPECT_EQ(wrong, 0u);
}

}  // namespace
}  // namespace focalfleet
