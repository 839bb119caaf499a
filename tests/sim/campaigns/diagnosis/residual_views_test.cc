#include "sim/campaigns/diagnosis/use/residual_views.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "tests/sim/campaigns/planting/planted_campaign.h"

namespace focalfleet::sim {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// A campaign whose theta angles are off by known amounts, and a diagnosis that has only its
/// residuals. Nothing is left after the model.
struct Turned {
  explicit Turned(const std::function<double(const Campaign&, std::size_t row)>& off_deg)
      : campaign(
            test::Planted({}, {.units = 12, .moves = 60, .noise_um = 0, .rest_noise_deg = 0})) {
    const Campaign exact = campaign;
    test::TurnTheta([&](std::size_t row) { return off_deg(exact, row); }, &campaign);
    diagnosis.model.units = campaign.units;
    for (std::size_t row = 0; row < campaign.rows(); ++row) {
      diagnosis.x_before_um.push_back(1e3 * (campaign.x_mm[row] - exact.x_mm[row]));
      diagnosis.y_before_um.push_back(1e3 * (campaign.y_mm[row] - exact.y_mm[row]));
    }
    diagnosis.x_after_um.assign(campaign.rows(), 0);
    diagnosis.y_after_um.assign(campaign.rows(), 0);
  }
  Campaign campaign;
  Diagnosis diagnosis;
};

TEST(AngleResiduals, HaveTheSignAndTheAxisOfTheError) {
  const auto off = [](const Campaign& campaign, std::size_t row) {
    return campaign.cmd_deg[kTheta][row] > campaign.from_deg[kTheta][row] ? -0.02 : 0.03;
  };
  const Turned turned(off);
  const CampaignFacts facts = MakeFacts(turned.campaign);
  const AngleResiduals residuals = AngleResidualsOf(facts, turned.diagnosis);
  std::size_t seen = 0;
  for (std::size_t row = 0; row < turned.campaign.rows(); ++row) {
    if (!std::isfinite(residuals.before_deg[kTheta][row])) continue;
    ++seen;
    EXPECT_NEAR(residuals.before_deg[kTheta][row], off(turned.campaign, row), 1e-4) << row;
    EXPECT_NEAR(residuals.before_deg[kPhi][row], 0, 1e-4) << row;
    EXPECT_EQ(residuals.after_deg[kTheta][row], 0) << row;
  }
  EXPECT_GT(seen, turned.campaign.rows() / 2);
}

TEST(AngleResiduals, AreNotKnownWhereNothingWasMeasured) {
  Turned turned([](const Campaign&, std::size_t) { return 0.1; });
  turned.diagnosis.x_before_um[7] = kNan;
  const CampaignFacts facts = MakeFacts(turned.campaign);
  EXPECT_TRUE(std::isnan(AngleResidualsOf(facts, turned.diagnosis).before_deg[kTheta][7]));
}

TEST(MedianCurve, FollowsASignThatLengthsHide) {
  std::vector<double> x, y;
  for (int i = -300; i < 300; ++i) x.push_back(i), y.push_back(i < 0 ? -1 : 1);
  const MedianCurve curve = MedianAlong(x, y);
  ASSERT_GT(curve.x.size(), 10u);
  for (std::size_t k = 0; k < curve.x.size(); ++k)
    if (std::abs(curve.x[k]) > 30) {
      EXPECT_EQ(curve.median[k], curve.x[k] < 0 ? -1 : 1) << k;
    }
  EXPECT_GT(curve.structure, 100);
}

TEST(MedianCurve, HasNoStructureByChance) {
  Rng rng = Rng::Stream(5, "clouds");
  double sum = 0;
  for (int cloud = 0; cloud < 40; ++cloud) {
    std::vector<double> x, y;
    for (int i = 0; i < 800; ++i) x.push_back(rng.Normal()), y.push_back(rng.Normal());
    sum += MedianAlong(x, y).structure;
  }
  EXPECT_NEAR(sum / 40, 0, 0.5);
}

TEST(MedianCurve, PutsEqualValuesInOneBin) {
  std::vector<double> x, y;
  for (int i = 0; i < 300; ++i) x.push_back(i % 3), y.push_back(i % 3 == 1 ? 5 : 0);
  x.push_back(kNan), y.push_back(1e9);
  const MedianCurve curve = MedianAlong(x, y);
  EXPECT_EQ(curve.x, (std::vector<double>{0, 1, 2}));
  EXPECT_EQ(curve.median, (std::vector<double>{0, 5, 0}));
  EXPECT_TRUE(MedianAlong({}, {}).x.empty());
}

TEST(OrderSpectrum, HasThePeakOfARipple) {
  constexpr double kOrder = 48.5, kAmplitude_deg = 0.05;
  const Turned turned([](const Campaign& campaign, std::size_t row) {
    return kAmplitude_deg *
           std::sin(kOrder * campaign.cmd_deg[kTheta][row] * std::numbers::pi / 180 + 0.7);
  });
  const CampaignFacts facts = MakeFacts(turned.campaign);
  const AngleResiduals residuals = AngleResidualsOf(facts, turned.diagnosis);
  const OrderSpectrum spectrum = SpectrumOf(turned.campaign, residuals, kTheta);
  std::size_t highest = 0;
  for (std::size_t k = 0; k < spectrum.order.size(); ++k)
    if (spectrum.before_deg[k] > spectrum.before_deg[highest]) highest = k;
  EXPECT_NEAR(spectrum.order[highest], kOrder, 0.5);
  EXPECT_NEAR(spectrum.before_deg[highest], kAmplitude_deg, 0.25 * kAmplitude_deg);
  EXPECT_EQ(spectrum.chance_deg, 0) << "nothing is left after the model";
  const OrderSpectrum other = SpectrumOf(turned.campaign, residuals, kPhi);
  for (const double amplitude : other.before_deg)
    if (std::isfinite(amplitude)) {
      EXPECT_LT(amplitude, 0.02 * kAmplitude_deg);
    }
}

TEST(OrderSpectrum, ReachesTheMotorsOwnOrders) {
  const Turned turned([](const Campaign&, std::size_t row) { return row % 2 == 0 ? 0.01 : 0; });
  const CampaignFacts facts = MakeFacts(turned.campaign);
  const OrderSpectrum spectrum =
      SpectrumOf(turned.campaign, AngleResidualsOf(facts, turned.diagnosis), kTheta);
  const double gear = turned.campaign.units.front().gear[kTheta];
  double most = 0;
  for (const double order : spectrum.order)
    if (std::isfinite(order)) most = std::max(most, order);
  EXPECT_NEAR(most, 6 * gear, 4);
}

TEST(UnitResiduals, AreOfEachUnit) {
  Turned turned([](const Campaign& campaign, std::size_t row) {
    return row < campaign.first_row[1] ? 0.1 : 0;
  });
  const UnitResiduals units = UnitResidualsOf(turned.campaign, turned.diagnosis);
  EXPECT_GT(units.before_um[0], 1);
  EXPECT_LT(units.before_um[1], 1e-3);
  EXPECT_EQ(units.after_um[0], 0);
}

TEST(WorstExposure, IsTheOneWhoseUnitsAreFarthestOff) {
  Turned turned([](const Campaign&, std::size_t) { return 0.01; });
  const CampaignFacts facts = MakeFacts(turned.campaign);
  for (std::size_t row = 0; row < turned.campaign.rows(); ++row)
    if (facts.exposures.of_row[row] == 17) turned.diagnosis.x_before_um[row] += 500;
  EXPECT_EQ(WorstExposure(facts, turned.diagnosis), 17u);
  turned.diagnosis.x_before_um.assign(turned.campaign.rows(), kNan);
  EXPECT_EQ(WorstExposure(facts, turned.diagnosis), std::nullopt);
}

}  // namespace
}  // namespace focalfleet::sim
