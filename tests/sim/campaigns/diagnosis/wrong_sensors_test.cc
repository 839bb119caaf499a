// Boards that report another temperature than they have, and boards that have another.
#include "sim/campaigns/diagnosis/terms/wrong_sensors.h"

#include <gmock/gmock.h>

#include "sim/campaigns/effects/registry.h"
#include "tests/sim/campaigns/planting/planted_campaign.h"

namespace focalfleet::sim {
namespace {

using test::Planted;
using test::Reported;
using test::Verdicts;
using testing::ElementsAre;
using testing::IsEmpty;

constexpr double kGrowth = 6e-5;  // of the arms, a kelvin

std::vector<double>& Temperatures(Campaign* campaign) {
  return std::ranges::find(campaign->covariates, "temp_C", &Covariate::name)->values;
}

// The units' temperatures run with this gain about 12 degrees.
void ReportWithGain(const std::vector<std::size_t>& units, double gain, Campaign* campaign) {
  for (const std::size_t unit : units)
    for (std::size_t row = campaign->first_row[unit]; row < campaign->first_row[unit + 1]; ++row) {
      double& reported = Temperatures(campaign)[row];
      reported = 12 + gain * (reported - 12);
    }
}

// Arms that grow with the reported temperature.
void GrowArms(Campaign* campaign) {
  const CampaignFacts facts = MakeFacts(*campaign);
  CampaignModel plain;
  plain.units = campaign->units;
  CampaignModel warm = plain;
  ModelTerm term;
  term.form = ListTemplates(*FindEffect("thermal_arm_growth"), facts).front();
  term.sharing = Sharing::kFleet;
  term.group_of_unit.assign(campaign->units.size(), 0);
  term.amplitude = {kGrowth};
  term.sigma = {0};
  warm.terms.push_back(term);
  const Places with = Predict(warm, facts, OneAfterTheOther());
  const Places without = Predict(plain, facts, OneAfterTheOther());
  for (std::size_t row = 0; row < campaign->rows(); ++row) {
    campaign->x_mm[row] += with.x_mm[row] - without.x_mm[row];
    campaign->y_mm[row] += with.y_mm[row] - without.y_mm[row];
  }
}

struct Board {
  Campaign campaign;
  std::vector<std::size_t> units;  // of one rail of three, among the others
};
Board Plain() {
  Board board{.campaign = Planted({}, {.units = 40, .moves = 80, .seed = 5}), .units = {}};
  for (std::size_t unit = 0; unit < board.campaign.units.size(); ++unit) {
    const std::size_t rail = unit % 3;
    board.campaign.units[unit].rail = static_cast<double>(rail);
    if (rail == 1) board.units.push_back(unit);
  }
  return board;
}

const CauseFound* Find(const Diagnosis& diagnosis, std::string_view name) {
  const auto it = std::ranges::find(diagnosis.causes, name, &CauseFound::cause);
  return it == diagnosis.causes.end() ? nullptr : &*it;
}

TEST(WrongSensors, ARailThatTellsAnotherGainThanItsArmsIsNamed) {
  Board board = Plain();
  GrowArms(&board.campaign);
  ReportWithGain(board.units, 0.6, &board.campaign);
  const Diagnosis diagnosis = Verdicts(board.campaign);
  const CauseFound* sensors = Find(diagnosis, "sensor_bias");
  ASSERT_NE(sensors, nullptr) << Reported(diagnosis);
  EXPECT_EQ(sensors->scope, "rail");
  EXPECT_NEAR(sensors->amplitude, -0.4, 0.02);
  EXPECT_EQ(sensors->units.size(), board.units.size());
  EXPECT_THAT(sensors->candidates, ElementsAre("sensor_bias"));
  const CauseFound* growth = Find(diagnosis, "thermal_arm_growth");
  ASSERT_NE(growth, nullptr) << Reported(diagnosis);
  EXPECT_NEAR(growth->amplitude, kGrowth, 0.05 * kGrowth);
  EXPECT_TRUE(growth->all_units);
}

TEST(WrongSensors, OneUnitsSensorIsTheUnits) {
  Board board = Plain();
  GrowArms(&board.campaign);
  ReportWithGain({17}, 2, &board.campaign);
  const Diagnosis diagnosis = Verdicts(board.campaign);
  const CauseFound* sensors = Find(diagnosis, "sensor_bias");
  ASSERT_NE(sensors, nullptr) << Reported(diagnosis);
  EXPECT_EQ(sensors->scope, "unit");
  EXPECT_THAT(sensors->units, ElementsAre(board.campaign.units[17].id));
  EXPECT_NEAR(sensors->amplitude, 1, 0.05);
}

TEST(WrongSensors, ARailThatIsColderHasNoWrongSensors) {
  Board board = Plain();
  ReportWithGain(board.units, 0.6, &board.campaign);
  GrowArms(&board.campaign);
  const Diagnosis diagnosis = Verdicts(board.campaign);
  EXPECT_EQ(Find(diagnosis, "sensor_bias"), nullptr) << Reported(diagnosis);
  EXPECT_NE(Find(diagnosis, "thermal_arm_growth"), nullptr) << Reported(diagnosis);
}

TEST(WrongSensors, WhereNothingGoesWithTheTemperatureTheyCannotBeReported) {
  Board board = Plain();
  ReportWithGain(board.units, 0.6, &board.campaign);
  const Diagnosis diagnosis = Verdicts(board.campaign);
  EXPECT_EQ(diagnosis.verdict, Verdict::kConsistent) << Reported(diagnosis);
  const auto untested = std::ranges::find(diagnosis.not_testable, kSensorBias, &NotTestable::cause);
  ASSERT_NE(untested, diagnosis.not_testable.end());
  EXPECT_THAT(untested->why, testing::HasSubstr("nothing goes with the temperature"));
}

TEST(WrongSensors, WhoTellsNoTemperatureIsNotSuspect) {
  Board board = Plain();
  for (const std::size_t unit : board.units)
    for (std::size_t row = board.campaign.first_row[unit]; row < board.campaign.first_row[unit + 1];
         ++row)
      Temperatures(&board.campaign)[row] = std::nan("");
  EXPECT_EQ(FindSuspectSensors(MakeFacts(board.campaign)), nullptr);
}

TEST(WrongSensors, AMissingReadingIsNoReading) {
  Board board = Plain();
  ReportWithGain(board.units, 0.6, &board.campaign);
  std::vector<double>& reported = Temperatures(&board.campaign);
  for (std::size_t row = 0; row < reported.size(); row += 3) reported[row] = std::nan("");
  const auto truth = FindSuspectSensors(MakeFacts(board.campaign));
  ASSERT_NE(truth, nullptr);
  EXPECT_EQ(truth->units, board.units);
  EXPECT_NEAR(truth->gain, 0.6, 0.01);
}

// All others report one temperature, so that the only gradient is the wrong rail's.
TEST(WrongSensors, AColumnThatTheWrongOnesMadeGoesWithThem) {
  Board board = Plain();
  std::vector<double>& reported = Temperatures(&board.campaign);
  const std::size_t moves = board.campaign.first_row[1];
  for (std::size_t row = 0; row < reported.size(); ++row) reported[row] = reported[row % moves];
  GrowArms(&board.campaign);
  ReportWithGain(board.units, 0.6, &board.campaign);
  ASSERT_TRUE(MakeFacts(board.campaign).Has(kGradientX));
  const Diagnosis diagnosis = Verdicts(board.campaign);
  EXPECT_NE(Find(diagnosis, "sensor_bias"), nullptr) << Reported(diagnosis);
}

TEST(WrongSensors, OfTwoHalvesNobodyKnowsWhichIsRight) {
  Board board = Plain();
  board.units.clear();
  for (std::size_t unit = 0; unit < board.campaign.units.size(); ++unit) {
    board.campaign.units[unit].rail = static_cast<double>(unit % 2);
    if (unit % 2 == 1) board.units.push_back(unit);
  }
  GrowArms(&board.campaign);
  ReportWithGain(board.units, 0.6, &board.campaign);
  const Diagnosis diagnosis = Verdicts(board.campaign);
  const CauseFound* sensors = Find(diagnosis, "sensor_bias");
  ASSERT_NE(sensors, nullptr) << Reported(diagnosis);
  EXPECT_THAT(sensors->candidates, ElementsAre("sensor_bias", "thermal_arm_growth"));
}

TEST(WrongSensors, RightOnesAreNotSuspect) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const Campaign campaign = Planted({}, {.units = 40, .seed = seed});
    const CampaignFacts facts = MakeFacts(campaign);
    ASSERT_THAT(WhyNoSensorIsTested(facts), IsEmpty());
    EXPECT_EQ(FindSuspectSensors(facts), nullptr) << "seed " << seed;
  }
}

}  // namespace
}  // namespace focalfleet::sim
