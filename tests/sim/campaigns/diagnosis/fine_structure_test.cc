// Structure that varies too fast for a smooth curve, and outliers that cluster at one place.
#include "sim/campaigns/diagnosis/check/fine_structure.h"

#include <gmock/gmock.h>

#include <cmath>
#include <string>
#include <vector>

#include "sim/campaigns/diagnosis/terms/outliers.h"
#include "tests/sim/campaigns/planting/planted_campaign.h"

namespace focalfleet::sim {
namespace {

using test::Planted;
using test::Reported;
using test::StaticFit;
using test::TurnTheta;
using test::Verdicts;

// The only unknown structure, or none.
UnknownFound OnlyUnknown(const Diagnosis& diagnosis) {
  EXPECT_EQ(diagnosis.unknown.size(), 1u) << Reported(diagnosis);
  return diagnosis.unknown.empty() ? UnknownFound{} : diagnosis.unknown.front();
}

Campaign Rounded(double step_deg) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 80, .seed = 3});
  TurnTheta(
      [&](std::size_t row) {
        const double commanded = campaign.cmd_deg[kTheta][row];
        return std::round(commanded / step_deg) * step_deg - commanded;
      },
      &campaign);
  return campaign;
}

TEST(FineStructure, RoundedAnglesAreNoNoise) {
  for (const double step_deg : {0.1, 0.237, 1.0}) {
    const UnknownFound unknown =
        OnlyUnknown(Verdicts(Rounded(step_deg), {.leave_out = {"command_quantisation"}}));
    EXPECT_EQ(unknown.covariate, "theta_cmd_deg") << step_deg;
    EXPECT_EQ(unknown.channel, "theta angle") << step_deg;
    EXPECT_LT(unknown.p_value, 1e-3) << step_deg;
  }
}

TEST(FineStructure, AFractionOfAPixelIsSeenWithoutItsShape) {
  constexpr double kPixel_mm = 0.06;
  Campaign campaign = Planted({}, {.units = 24, .moves = 80, .seed = 3});
  Covariate pixel{.name = "pixel_y", .values = {}};
  for (std::size_t row = 0; row < campaign.rows(); ++row) {
    pixel.values.push_back(1000 + campaign.y_mm[row] / kPixel_mm);
    const double fraction = pixel.values[row] - std::floor(pixel.values[row]);
    campaign.y_mm[row] += fraction < 0.3 ? 0.008 : -0.003;
  }
  campaign.covariates.push_back(std::move(pixel));
  const UnknownFound unknown = OnlyUnknown(Verdicts(campaign, {.leave_out = {"centroid_bias"}}));
  EXPECT_EQ(unknown.covariate, "pixel_y");
  EXPECT_EQ(unknown.channel, "y");
  EXPECT_GT(unknown.size_um, 3);  // 5.2 planted, some of it taken for noise
  EXPECT_LT(unknown.size_um, 6);
}

TEST(FineStructure, ArmsThatLeanOnEachOtherAreSeenByTheirGap) {
  const Diagnosis diagnosis = Verdicts(Planted({{.cause = "collision_contact", .amplitude = 0.1}},
                                               {.units = 24, .moves = 80, .seed = 3}),
                                       {.leave_out = {"collision_contact"}});
  const UnknownFound unknown = OnlyUnknown(diagnosis);
  EXPECT_EQ(unknown.covariate, "gap to the next arm");
  EXPECT_EQ(unknown.channel, "phi angle");
}

TEST(FineStructure, ChanceShowsItNoMoreOftenThanItSays) {
  constexpr int kCampaigns = 60;
  constexpr double kRate = 1, kShareOfRate = 0.3;
  int shown = 0;
  for (std::uint64_t seed = 1; seed <= kCampaigns; ++seed) {
    const Campaign campaign = Planted({}, {.units = 24, .moves = 40, .seed = seed});
    const CampaignFacts facts = MakeFacts(campaign);
    // Even the smallest share of the noise is accepted here.
    if (FindFineStructure(StaticFit(facts), kRate, 0)) ++shown;
  }
  EXPECT_LE(shown, kShareOfRate * kRate * kCampaigns);
}

TEST(Cluster, ChanceShowsItNoMoreOftenThanItSays) {
  const Campaign campaign = Planted({}, {.units = 24, .moves = 80, .seed = 2});
  const CampaignFacts facts = MakeFacts(campaign);
  const Fit fit = StaticFit(facts);
  constexpr int kDraws = 400;
  constexpr double kRate = 0.2, kShareOfRate = 0.3;
  for (const std::size_t count : {5u, 12u, 40u, 120u}) {
    int shown = 0;
    for (int draw = 0; draw < kDraws; ++draw) {
      Rng rng = Rng::Stream(count, "far", static_cast<std::uint64_t>(draw));
      std::vector<std::size_t> far;
      while (far.size() < count) far.push_back(rng.Below(campaign.rows()));
      if (FindCluster(fit, far, kRate)) ++shown;
    }
    EXPECT_LE(shown, kShareOfRate * kRate * kDraws) << count;
    RecordProperty("shown_of_" + std::to_string(count), shown);
  }
}

// Rows up to 2 mm off: anywhere, or only where theta is between 40 and 48 degrees.
Campaign WithFarRows(bool clustered) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 80, .seed = 8});
  Rng rng = Rng::Stream(8, "far rows");
  for (std::size_t row = 0; row < campaign.rows(); ++row) {
    const double theta_deg = campaign.cmd_deg[kTheta][row];
    if (clustered ? theta_deg < 40 || theta_deg > 48 : rng.Uniform() > 0.02) continue;
    campaign.x_mm[row] += rng.Uniform(-1.4, 1.4);
    campaign.y_mm[row] += rng.Uniform(-1.4, 1.4);
  }
  return campaign;
}

TEST(Cluster, OutliersAtOneAngleAreUnknown) {
  const Diagnosis diagnosis = Verdicts(WithFarRows(true));
  ASSERT_GE(diagnosis.outliers.rows, 10u);
  const UnknownFound unknown = OnlyUnknown(diagnosis);
  EXPECT_EQ(unknown.covariate, "theta_cmd_deg");
  EXPECT_EQ(unknown.channel, "rows far from every prediction");
}

// A share of the rows is up to 2 mm off where the arm comes as near to a neighbour's; some others
// are off anywhere.
Campaign Touched(double gap_mm, double share) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 80, .seed = 8, .outlier_share = 0.003});
  const CampaignFacts facts = MakeFacts(campaign);
  const FilledColumn& gap = *facts.Find(kArmGap);
  Rng rng = Rng::Stream(8, "touched");
  for (std::size_t row = 0; row < campaign.rows(); ++row) {
    if (gap.values[row] > gap_mm || rng.Uniform() > share) continue;
    campaign.x_mm[row] += rng.Uniform(-1.4, 1.4);
    campaign.y_mm[row] += rng.Uniform(-1.4, 1.4);
  }
  return campaign;
}

TEST(Cluster, OutliersWhereArmsAreNearestHaveTouched) {
  const Diagnosis diagnosis = Verdicts(Touched(1.5, 0.9));
  EXPECT_EQ(diagnosis.verdict, Verdict::kExplained) << Reported(diagnosis);
  ASSERT_EQ(diagnosis.causes.size(), 1u) << Reported(diagnosis);
  EXPECT_EQ(diagnosis.causes[0].cause, "collision_contact");
  EXPECT_EQ(diagnosis.causes[0].amplitude_unit, "moves");
  EXPECT_GE(diagnosis.causes[0].amplitude, 10);
}

// Arms that press on each other as long as they are so near are far for many rows. No window is as
// wide as all of these.
TEST(Cluster, ContactsThatLastAndAreManyLeaveNothingUnknown) {
  Campaign campaign = Planted({}, {.units = 90, .moves = 200, .seed = 8, .outlier_share = 0.003});
  const CampaignFacts facts = MakeFacts(campaign);
  const FilledColumn& gap = *facts.Find(kArmGap);
  Rng rng = Rng::Stream(8, "leaned");
  std::size_t visits = 0, rows = 0;
  double dx_mm = 0, dy_mm = 0;
  for (std::size_t row = 0; row < campaign.rows(); ++row) {
    if (gap.values[row] > 2.8) continue;
    // The error stays as long as the arm does.
    if (row == 0 || gap.values[row] != gap.values[row - 1])
      dx_mm = rng.Uniform(-1.4, 1.4), dy_mm = rng.Uniform(-1.4, 1.4), ++visits;
    campaign.x_mm[row] += dx_mm, campaign.y_mm[row] += dy_mm, ++rows;
  }
  ASSERT_GT(visits, 250u);
  ASSERT_GT(rows, visits + 50);
  const Diagnosis diagnosis = Verdicts(campaign);
  EXPECT_EQ(diagnosis.verdict, Verdict::kExplained) << Reported(diagnosis);
  ASSERT_EQ(diagnosis.causes.size(), 1u) << Reported(diagnosis);
  EXPECT_EQ(diagnosis.causes[0].cause, "collision_contact");
}

TEST(Cluster, OutliersAmongMostThatAreAsNearAreUnknown) {
  const UnknownFound unknown = OnlyUnknown(Verdicts(Touched(4, 0.15)));
  EXPECT_EQ(unknown.covariate, kArmGap);
}

TEST(Cluster, ContactsAreUnknownToALibraryWithoutThem) {
  DiagnoseOptions options;
  options.leave_out = {"collision_contact"};
  EXPECT_EQ(OnlyUnknown(Verdicts(Touched(1.5, 0.9), options)).covariate, kArmGap);
}

// A random walk of its own is noise to the unit's fit, but the unit has to be named.
TEST(Cluster, AUnitThatIsFarMoreOffThanOthersIsNamed) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 60, .seed = 8});
  Rng rng = Rng::Stream(8, "walks");
  double x_mm = 0, y_mm = 0;
  for (std::size_t row = campaign.first_row[5]; row < campaign.first_row[6]; ++row) {
    x_mm += 0.004 * rng.Normal(), y_mm += 0.004 * rng.Normal();
    campaign.x_mm[row] += x_mm, campaign.y_mm[row] += y_mm;
  }
  EXPECT_THAT(Verdicts(campaign).outliers.units, testing::ElementsAre(campaign.units[5].id));
}

TEST(Cluster, OutliersAnywhereAreOutliers) {
  const Diagnosis diagnosis = Verdicts(WithFarRows(false));
  ASSERT_GE(diagnosis.outliers.rows, 20u);
  EXPECT_EQ(diagnosis.verdict, Verdict::kConsistent) << Reported(diagnosis);
}

}  // namespace
}  // namespace focalfleet::sim
