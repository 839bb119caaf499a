// Oddities of the data are reported, and are no evidence.
#include "sim/campaigns/diagnosis/decide/remarks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/sim/campaigns/campaign/odd_places.h"
#include "tests/sim/campaigns/planting/planted_campaign.h"
#include "tests/support/seed.h"

namespace focalfleet::sim {
namespace {

using test::InSteps;
using test::MovedInTurns;
using test::Planted;
using test::ReadTwice;
using test::Reported;
using test::Verdicts;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

constexpr double kPlane = 1.41421356;  // rms of a place to that of a coordinate

// The remaining rms is that of rounding, and the noise that is believed is no less.
TEST(WholePixels, AreTheNoiseOfACampaignWithoutMisfit) {
  for (const double step_mm : {0.2, 0.05}) {
    const Campaign campaign = InSteps(Planted({}, {.units = 24, .moves = 40, .seed = 5}), step_mm);
    const Diagnosis diagnosis = Diagnose(campaign, {});
    const double rounding_um = kPlane * 1e3 * SpreadOfStep(step_mm);
    for (const CauseFound& cause : diagnosis.causes)
      EXPECT_LT(cause.size_um, rounding_um) << Reported(diagnosis);
    EXPECT_GT(diagnosis.gain.rms_after_um, 0.9 * rounding_um);
    EXPECT_LT(diagnosis.gain.rms_after_um, 1.4 * rounding_um);
    EXPECT_GT(diagnosis.gain.noise_floor_um, 0.99 * rounding_um);
    EXPECT_TRUE(diagnosis.steps_limit);
    EXPECT_THAT(diagnosis.remarks, ElementsAre("places come in steps of " + FourDigits(step_mm) +
                                               " mm: nothing finer can be told"));
  }
}

TEST(WholePixels, AreNotReportedWhereTheNoiseIsWider) {
  const Diagnosis diagnosis = Diagnose(InSteps(Planted({}, {.units = 24, .moves = 40}), 1e-3), {});
  EXPECT_NEAR(diagnosis.steps.x_mm, 1e-3, 1e-9);
  EXPECT_FALSE(diagnosis.steps_limit);
  EXPECT_THAT(diagnosis.remarks, IsEmpty());
}

TEST(WholePixels, LeaveAStrongCauseItsName) {
  const Campaign campaign =
      InSteps(Planted({{.cause = "eccentricity", .amplitude = 0.5, .axis = "theta"}},
                      {.units = 24, .moves = 60, .seed = 2}),
              0.1);
  const Diagnosis diagnosis = Verdicts(campaign);
  ASSERT_FALSE(diagnosis.causes.empty());
  EXPECT_EQ(diagnosis.causes.front().cause, "eccentricity") << Reported(diagnosis);
}

// The result is as if the places that were carried on had never been written.
TEST(CarriedOn, IsNoEvidence) {
  const Campaign plain = Planted({}, {.units = 24, .moves = 40, .seed = 7});
  const Diagnosis carried = Diagnose(MovedInTurns(plain, 0.5, true), {});
  const Diagnosis missing = Diagnose(MovedInTurns(plain, 0.5, false), {});
  EXPECT_EQ(Reported(carried), Reported(missing));
  EXPECT_EQ(carried.gain.rms_after_um, missing.gain.rms_after_um);
  EXPECT_THAT(carried.outliers.units, IsEmpty());
  const std::size_t rows = missing.outliers.why.at("not seen");
  EXPECT_EQ(carried.outliers.why.at("carried on, the unit was not moved"), rows);
  EXPECT_THAT(carried.remarks, Contains(HasSubstr(std::to_string(rows) + " of 960 rows repeat")));
}

TEST(CarriedOn, CampaignsWithoutCameraNoiseAreConsistent) {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const Campaign campaign = Planted({}, {.units = 24, .moves = 40, .seed = seed, .noise_um = 0});
    const Diagnosis diagnosis = Diagnose(campaign, {});
    EXPECT_GT(diagnosis.gain.rms_after_um, 1) << seed;  // the axes' rests
    EXPECT_LT(diagnosis.gain.rms_after_um, 10) << seed;
    EXPECT_THAT(diagnosis.outliers.units, IsEmpty()) << seed;
  }
}

TEST(ReadTwice, AnExposureIsSetAside) {
  const Campaign fine = Planted({}, {.units = 24, .moves = 40, .seed = 3});
  const Diagnosis diagnosis = Verdicts(ReadTwice(fine, 22));
  EXPECT_EQ(diagnosis.verdict, Verdict::kConsistent) << Reported(diagnosis);
  EXPECT_EQ(diagnosis.outliers.why.at("the exposure repeats the one before"), 24u);
  EXPECT_THAT(diagnosis.remarks, ElementsAre(HasSubstr("the exposure of move " +
                                                       std::to_string(fine.move_id[22]) + " ")));
}

std::vector<std::string> RemarksOn(const Campaign& campaign) {
  const CampaignFacts facts = MakeFacts(campaign);
  return RemarksOnOrder(facts);
}

TEST(Remarks, AreNoneOnACampaignInOrder) {
  EXPECT_THAT(RemarksOn(Planted({}, {.units = 24, .moves = 40, .homing_share = 0.1})), IsEmpty());
}

TEST(Remarks, TellTimesThatContradictTheNumbersOfMoves) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 40});
  ASSERT_FALSE(campaign.Find("t_s").empty());
  std::swap(campaign.move_id[7], campaign.move_id[8]);
  EXPECT_THAT(RemarksOn(campaign), ElementsAre(HasSubstr("in 1 of 960 rows t_s and move_id")));
  std::erase_if(campaign.covariates, [](const Covariate& c) { return c.name == "t_s"; });
  EXPECT_THAT(RemarksOn(campaign), IsEmpty());
}

TEST(Remarks, TellRowsThatDoNotJoin) {
  const Campaign whole = Planted({}, {.units = 24, .moves = 40});
  std::vector<bool> keep(whole.rows(), true);
  // A move away, which the next row does not show.
  for (const std::size_t unit : {std::size_t{0}, std::size_t{5}}) {
    std::size_t row = whole.first_row[unit] + 1;
    while (whole.cmd_deg[kTheta][row] == whole.from_deg[kTheta][row]) ++row;
    keep[row] = false;
  }
  Campaign campaign = Keep(whole, keep);
  const auto two_break = HasSubstr("2 of 958 rows do not begin where");
  EXPECT_THAT(RemarksOn(campaign), ElementsAre(two_break));
  // A command that is written a whole turn off is one slip of the table; a hundredth is rounding.
  for (double& from_deg : campaign.from_deg[kTheta]) from_deg += 360;
  for (double& from_deg : campaign.from_deg[kPhi]) from_deg += 0.005;
  EXPECT_THAT(RemarksOn(campaign), ElementsAre(two_break));
  // A closed loop begins where the camera sees the fibre, and homing anywhere.
  for (const char* name : {"from_measured", "rehomed"}) {
    Campaign reported = campaign;
    reported.covariates.push_back({name, std::vector<double>(campaign.rows(), 1)});
    std::erase_if(reported.covariates, [&](const Covariate& column) {
      return column.name == name && &column != &reported.covariates.back();
    });
    EXPECT_THAT(RemarksOn(reported), IsEmpty()) << name;
  }
}

TEST(Remarks, ShortenLongLists) {
  EXPECT_EQ(FirstOf(std::vector<int>{4}), "4");
  EXPECT_EQ(FirstOf(std::vector<int>{1, 2, 3, 4, 5}), "1, 2, 3, 4, 5");
  EXPECT_EQ(FirstOf(std::vector<int>{1, 2, 3, 4, 5, 6, 7}), "1, 2, 3, 4, 5 and 2 more");
  EXPECT_THAT(RemarkOnSteps({0.1, 0.05}), HasSubstr("0.1 mm in x and 0.05 mm in y"));
}

TEST(Remarks, FramesDifferByChanceAsSeldomAsStated) {
  constexpr int kDraws = 4000, kPlaces = 90;
  constexpr double kStated = 0.001, kNoise_mm = 0.005;
  const std::uint64_t seed = focalfleet::test::TestSeed(1);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng = Rng::Stream(seed, "frames");
  int otherwise = 0;
  for (int draw = 0; draw < kDraws; ++draw) {
    Frames frames{.id = {1, 2}, .of_row = {}};
    Places expected, measured;
    for (std::uint32_t row = 0; row < kPlaces; ++row) {
      frames.of_row.push_back(row % 3 == 0 ? 1 : 0);
      for (std::vector<double> Places::*const xy : {&Places::x_mm, &Places::y_mm}) {
        (expected.*xy).push_back(rng.Uniform(-100, 100));
        (measured.*xy).push_back((expected.*xy).back() + kNoise_mm * rng.Normal());
      }
    }
    const auto remarks = RemarksOnFrames(frames, expected, measured);
    ASSERT_EQ(remarks.size(), 1u);
    if (remarks[0].find("otherwise") != std::string::npos) ++otherwise;
  }
  // Four are expected; chance makes more than twelve once in 5000 times.
  EXPECT_LE(otherwise, 3 * kStated * kDraws);
  EXPECT_GT(otherwise, 0) << "the test would never say so";
}

}  // namespace
}  // namespace focalfleet::sim
