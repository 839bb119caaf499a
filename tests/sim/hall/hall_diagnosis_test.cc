// The diagnosis of a Hall rig where a single campaign shows it: names, sizes, honesty.
// hall_campaigns measures its rates over many campaigns.
#include "sim/hall/diagnosis/hall_diagnosis.h"

#include <gmock/gmock.h>

#include "tests/sim/hall/planted_rig.h"
#include "tests/support/seed.h"

namespace focalfleet::sim {
namespace {

HallCampaign Read(const test::PlantedCampaign& planted, bool temperature = true) {
  HallCampaign campaign;
  double sum = 0;
  for (const auto& pose : planted.poses) {
    campaign.poses.push_back(
        {pose.alpha_deg * kRadPerDeg, pose.beta_deg * kRadPerDeg, pose.gamma_deg * kRadPerDeg});
    VoltageRow row{pose.volts};
    if (temperature) row.temperature_C = pose.temp_C;
    campaign.rows.push_back(row);
    sum += pose.temp_C;
  }
  campaign.has_temperature = temperature;
  campaign.temperature_mean_C = sum / static_cast<double>(planted.poses.size());
  return campaign;
}

test::PlantedCampaign Plant(const test::Planted& planted, std::size_t rows = 120) {
  const auto law = test::OfSurface(0.08, 21);
  return test::MakeCampaign({.rows = rows, .seed = test::TestSeed(31)}, law, law, planted);
}

HallDiagnosis Diagnosed(const HallCampaign& campaign) {
  return DiagnoseHall(campaign, {}, *MakeField(SurfaceParameters{.amplitude_T = 0.05}));
}

TEST(HallDiagnosis, FindsNothingWhereNothingIsWrong) {
  const HallDiagnosis diagnosis = Diagnosed(Read(Plant({})));
  EXPECT_EQ(diagnosis.verdict, HallVerdict::kConsistent);
  EXPECT_TRUE(diagnosis.causes.empty());
  EXPECT_NEAR(diagnosis.noise_V, 0.0125, 0.002);
}

TEST(HallDiagnosis, NamesTheSensorTheCauseAndItsSize) {
  const HallDiagnosis gain = Diagnosed(Read(Plant({"sensor_gain", 0.03, 4})));
  ASSERT_EQ(gain.causes.size(), 1u);
  EXPECT_EQ(gain.causes[0].candidates, std::vector{HallCause::kSensorGain});
  EXPECT_THAT(gain.causes[0].sensors, ::testing::ElementsAre(4u));
  EXPECT_NEAR(gain.causes[0].amplitude, 0.03, 0.008);
  EXPECT_LT(gain.causes[0].ci95[0], 0.03);
  EXPECT_GT(gain.causes[0].ci95[1], 0.03);
  EXPECT_LT(gain.gain.rms_after_V, 1.05 * gain.noise_V);

  const HallDiagnosis offset = Diagnosed(Read(Plant({"sensor_offset", -0.03, 1})));
  ASSERT_EQ(offset.causes.size(), 1u);
  EXPECT_EQ(offset.causes[0].candidates, std::vector{HallCause::kSensorOffset});
  EXPECT_THAT(offset.causes[0].sensors, ::testing::ElementsAre(1u));
  EXPECT_NEAR(offset.causes[0].amplitude, -0.03, 0.006);

  const HallDiagnosis place = Diagnosed(Read(Plant({"sensor_position", 1, 3})));
  ASSERT_EQ(place.causes.size(), 1u);
  EXPECT_EQ(place.causes[0].candidates, std::vector{HallCause::kSensorPosition});
  EXPECT_NEAR(place.causes[0].amplitude, 1, 0.25);

  const HallDiagnosis warm = Diagnosed(Read(Plant({"temperature_coefficient", -0.002})));
  ASSERT_EQ(warm.causes.size(), 1u);
  EXPECT_EQ(warm.causes[0].candidates, std::vector{HallCause::kTemperatureCoefficient});
  EXPECT_NEAR(warm.causes[0].amplitude, -0.002, 0.0004);
}

TEST(HallDiagnosis, TellsAWiderFieldFromAnotherOne) {
  const auto law = test::OfSurface(0.08, 21);
  const auto wide = test::MakeCampaign({.seed = 3}, law, test::OfSurface(0.09, 24), {});
  const HallDiagnosis width = Diagnosed(Read(wide));
  ASSERT_EQ(width.causes.size(), 1u);
  EXPECT_EQ(width.causes[0].candidates, std::vector{HallCause::kFieldWidth});
  EXPECT_NEAR(width.causes[0].amplitude, 24.0 / 21 - 1, 0.01);
  const auto sine = [](const test::Vec& place, const test::Vec&) {
    const double r2 = place[0] * place[0] + place[1] * place[1] + place[2] * place[2];
    const double s2 = 1 - place[2] * place[2] / r2;
    return 0.08 * s2 * s2 * std::cos(4 * std::atan2(place[1], place[0]));
  };
  const HallDiagnosis shape =
      Diagnosed(Read(test::MakeCampaign({.noise_T = 1e-4, .seed = 4}, law, sine, {})));
  ASSERT_FALSE(shape.causes.empty());
  EXPECT_EQ(shape.causes[0].candidates.front(), HallCause::kFieldHarmonics);
}

TEST(HallDiagnosis, SaysWhatCannotBeTested) {
  const HallDiagnosis diagnosis =
      Diagnosed(Read(Plant({"temperature_coefficient", -0.003}), false));
  ASSERT_EQ(diagnosis.not_testable.size(), 1u);
  EXPECT_EQ(diagnosis.not_testable[0].first, HallCause::kTemperatureCoefficient);
  EXPECT_EQ(diagnosis.verdict, HallVerdict::kUnknown) << "the drift is seen and not named";
  EXPECT_TRUE(diagnosis.causes.empty());
}

// Some causes together imitate these effects nearly to within the noise; none is named as sure.
TEST(HallDiagnosis, WhatIsNoneOfTheCausesIsUnknown) {
  const std::pair<test::Planted, const char*> outside[] = {
      {{"pose_scale", -0.02}, "alpha_deg is told wrongly, by alpha: its scale"},
      {{"crosstalk", 0.05, 2}, "v3 hears v4"},
      {{"drift", 0.05, 5}, "v6 drifts from row to row"}};
  for (const auto& [planted, what] : outside) {
    const HallDiagnosis diagnosis = Diagnosed(Read(Plant(planted)));
    EXPECT_EQ(diagnosis.verdict, HallVerdict::kUnknown) << what;
    EXPECT_TRUE(diagnosis.causes.empty()) << what;
    ASSERT_FALSE(diagnosis.unknown.empty()) << what;
    EXPECT_EQ(diagnosis.unknown[0].covariate, what);
    EXPECT_FALSE(diagnosis.next_poses.empty());
  }
}

TEST(HallDiagnosis, SaysThatDataAreTooFew) {
  const HallDiagnosis diagnosis = Diagnosed(Read(Plant({}, 8)));
  EXPECT_EQ(diagnosis.verdict, HallVerdict::kInsufficient);
  EXPECT_THAT(diagnosis.missing, ::testing::HasSubstr("8 poses"));
  EXPECT_FALSE(diagnosis.next_poses.empty());
}

TEST(HallDiagnosis, FindsSwappedStuckAndFarOffVoltages) {
  HallCampaign campaign = Read(Plant({}));
  for (VoltageRow& row : campaign.rows) {
    std::swap(row.voltages_V[1], row.voltages_V[5]);
    row.voltages_V[7] = 2.9;
  }
  campaign.rows[10].voltages_V[0] += 1;
  const HallDiagnosis diagnosis = Diagnosed(campaign);
  ASSERT_EQ(diagnosis.troubles.size(), 2u);
  EXPECT_EQ(diagnosis.troubles[0].what, "stuck");
  EXPECT_THAT(diagnosis.troubles[0].sensors, ::testing::ElementsAre(7u));
  EXPECT_EQ(diagnosis.troubles[1].what, "swapped");
  EXPECT_THAT(diagnosis.troubles[1].sensors, ::testing::ElementsAre(1u, 5u));
  EXPECT_EQ(diagnosis.outliers.at("far off"), 1u);
  EXPECT_TRUE(diagnosis.causes.empty());
}

}  // namespace
}  // namespace focalfleet::sim
