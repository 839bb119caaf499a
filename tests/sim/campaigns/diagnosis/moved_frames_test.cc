// Campaigns whose camera was moved between sessions, as the column frame_id says.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "sim/campaigns/campaign/place_steps.h"
#include "sim/campaigns/diagnosis/model/one_frame.h"
#include "sim/campaigns/diagnosis/score/score.h"
#include "sim/campaigns/diagnosis/use/compare_models.h"
#include "sim/campaigns/effects/registry.h"
#include "tests/sim/campaigns/campaign/odd_places.h"
#include "tests/sim/campaigns/planting/moved_camera.h"
#include "tests/sim/campaigns/planting/planted_campaign.h"

namespace focalfleet::sim {
namespace {

using test::MoveCamera;
using test::Planted;
using test::Reported;
using test::StaticFit;
using test::Verdicts;
using testing::AnyOf;
using testing::Contains;
using testing::Each;
using testing::HasSubstr;

// Three sessions. The camera was moved by a hundred times as much as a fibre is off by.
void MoveBetweenSessions(Campaign* campaign) {
  MoveCamera({{.id = 1, .until = 30},
              {.id = 2,
               .until = 60,
               .shift_x_um = 700,
               .shift_y_um = -300,
               .turn_urad = 900,
               .scale_ppm = 200},
              {.id = 3, .until = 80, .shift_x_um = -50, .turn_urad = -3000}},
             campaign);
}

// A camera that was taken off and put back: millimetres and a degree.
TEST(MovedFrames, MayBeFarApart) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 80, .seed = 9});
  const Diagnosis expected = Verdicts(campaign);
  MoveCamera({{.id = 1, .until = 38},
              {.id = 2, .until = 80, .shift_x_um = 9000, .shift_y_um = 4000, .turn_urad = 2e4}},
             &campaign);
  const Diagnosis diagnosis = Verdicts(campaign);
  EXPECT_EQ(Reported(diagnosis), Reported(expected));
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit)
    EXPECT_NEAR(diagnosis.model.units[unit].base_x_mm, campaign.units[unit].base_x_mm, 0.1)
        << "a model of the frame that is not the table's";
}

// No frame is that of the table: what all units are off by alike is where the camera stood.
TEST(MovedFrames, MayAllDifferFromTheTable) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 80, .seed = 9});
  MoveCamera({{.id = 1, .until = 38, .shift_x_um = 300, .turn_urad = -2000, .scale_ppm = 500},
              {.id = 2, .until = 80, .shift_y_um = -400, .turn_urad = 1500}},
             &campaign);
  EXPECT_EQ(Reported(Verdicts(campaign)), "consistent");
}

// A table that is off unit by unit is no camera's doing, and a camera that stood still moved
// nothing.
TEST(MovedFrames, TakeNothingOffOffsetsThatAreTheUnitsOwn) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    Campaign campaign =
        Planted({}, {.units = 24, .moves = 60, .seed = seed, .zero_offset_deg = 0.5});
    const Diagnosis expected = Verdicts(campaign);
    MoveCamera({{.id = 1, .until = 30}, {.id = 2, .until = 60}}, &campaign);
    const Diagnosis diagnosis = Verdicts(campaign);
    ASSERT_EQ(expected.causes.size(), 1u) << seed << " " << Reported(expected);
    ASSERT_EQ(diagnosis.causes.size(), 1u) << seed << " " << Reported(diagnosis);
    EXPECT_EQ(diagnosis.causes[0].cause, "zero_offset");
    EXPECT_THAT(diagnosis.remarks, Contains(HasSubstr("the camera stands alike in frame 2")));
  }
}

// More frames than a search is given as unknowns, with few moves each and a table that is off.
TEST(MovedFrames, MayBeMany) {
  constexpr std::size_t kFrames = 30, kMovesOfFrame = 2;
  Campaign campaign = Planted(
      {}, {.units = 24, .moves = kFrames * kMovesOfFrame, .seed = 4, .zero_offset_deg = 0.5});
  Rng rng = Rng::Stream(4, "many frames");
  std::vector<test::FrameAt> frames;
  for (std::size_t k = 0; k < kFrames; ++k)
    frames.push_back({.id = static_cast<double>(k),
                      .until = (k + 1) * kMovesOfFrame,
                      .shift_x_um = rng.Uniform(-300, 300),
                      .shift_y_um = rng.Uniform(-300, 300),
                      .turn_urad = rng.Uniform(-500, 500)});
  MoveCamera(frames, &campaign);
  const Diagnosis diagnosis = Verdicts(campaign);
  for (const CauseFound& cause : diagnosis.causes)
    EXPECT_THAT(cause.cause, AnyOf("zero_offset", "base_offset")) << Reported(diagnosis);
  EXPECT_TRUE(diagnosis.unknown.empty()) << Reported(diagnosis);
}

// Places in whole pixels come in no steps once they are turned. The floor of their noise stays.
TEST(MovedFrames, LeaveTheStepsOfPlacesAsMeasured) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 60, .seed = 5, .noise_um = 0.1});
  MoveBetweenSessions(&campaign);
  campaign = test::InSteps(campaign, 0.02);
  const double step_mm = FindPlaceSteps(campaign).wider_mm();
  ASSERT_NEAR(step_mm, 0.02, 1e-6);
  BringIntoOneFrame(OneAfterTheOther(), &campaign);
  EXPECT_EQ(FindPlaceSteps(campaign).wider_mm(), step_mm);
  EXPECT_GE(StaticFit(MakeFacts(campaign)).noise.least_um, 1e3 * SpreadOfStep(step_mm));
}

TEST(MovedFrames, OfALoopThatWasClosedAreNotEnough) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 60, .seed = 6});
  campaign.covariates.push_back(
      {.name = "from_measured", .values = std::vector<double>(campaign.rows(), 1)});
  MoveCamera({{.id = 1, .until = 30}, {.id = 2, .until = 60, .shift_x_um = 50}}, &campaign);
  const Diagnosis diagnosis = Verdicts(campaign);
  EXPECT_EQ(diagnosis.verdict, Verdict::kInsufficient);
  EXPECT_THAT(diagnosis.insufficient, HasSubstr("several frames"));
}

void ForgetFrames(Campaign* campaign) {
  std::erase_if(campaign->covariates, [](const Covariate& one) { return one.name == "frame_id"; });
}

TEST(MovedFrames, AreNoEffect) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const Campaign still = Planted({}, {.units = 24, .moves = 80, .seed = seed});
    const Diagnosis expected = Diagnose(still, {.with_next_moves = false});
    Campaign moved = still;
    MoveBetweenSessions(&moved);
    const Diagnosis diagnosis = Diagnose(moved, {.with_next_moves = false});
    EXPECT_EQ(Reported(diagnosis), Reported(expected)) << seed;
    EXPECT_EQ(diagnosis.verdict, expected.verdict) << seed;
    EXPECT_NEAR(diagnosis.gain.rms_after_um, expected.gain.rms_after_um,
                0.05 * expected.gain.rms_after_um)
        << seed;
    EXPECT_THAT(diagnosis.remarks,
                Contains(HasSubstr("the camera stands otherwise in frame 2 and in frame 1")));
    EXPECT_TRUE(diagnosis.model.frames.empty()) << "they are the campaign's own";
  }
}

TEST(MovedFrames, AreSeenWhereNoColumnNamesThem) {
  Campaign moved = Planted({}, {.units = 24, .moves = 40, .seed = 1});
  MoveBetweenSessions(&moved);
  ForgetFrames(&moved);
  EXPECT_NE(Verdicts(moved).verdict, Verdict::kConsistent) << "the motion was too small";
}

TEST(MovedFrames, LeaveEffectsTheirNamesAndSizes) {
  for (const PlantedEffect& effect :
       {PlantedEffect{"backlash", 0.1}, PlantedEffect{"eccentricity", 0.1}}) {
    SCOPED_TRACE(effect.cause);
    const Campaign still = Planted({effect}, {.units = 24, .moves = 80, .seed = 4});
    const Diagnosis expected = Verdicts(still);
    ASSERT_EQ(expected.causes.size(), 1u) << Reported(expected);
    Campaign moved = still;
    MoveBetweenSessions(&moved);
    const Diagnosis diagnosis = Verdicts(moved);
    ASSERT_EQ(diagnosis.causes.size(), 1u) << Reported(diagnosis);
    EXPECT_EQ(diagnosis.causes[0].candidates, expected.causes[0].candidates);
    EXPECT_NEAR(diagnosis.causes[0].amplitude, expected.causes[0].amplitude,
                0.02 * std::abs(expected.causes[0].amplitude));
  }
}

// Small motions, which no alignment before the fit has taken away.
TEST(MovedFrames, AreFittedAsUnknowns) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 80, .seed = 7});
  MoveCamera({{.id = 1, .until = 45},
              {.id = 2,
               .until = 80,
               .shift_x_um = 20,
               .shift_y_um = -8,
               .turn_urad = 300,
               .scale_ppm = -200}},
             &campaign);
  const CampaignFacts facts = MakeFacts(campaign);
  const Fit fit = StaticFit(facts);
  ASSERT_EQ(fit.model.frames.size(), 2u);
  EXPECT_THAT(fit.model.frames[0], Each(0.0));
  // Errors of means of some 800 rows of 5 um, and at 20 mm from the centre.
  EXPECT_NEAR(fit.model.frames[1][0], 20, 1.5);
  EXPECT_NEAR(fit.model.frames[1][1], -8, 1.5);
  EXPECT_NEAR(fit.model.frames[1][2], 300, 80);
  EXPECT_NEAR(fit.model.frames[1][3], -200, 80);
  EXPECT_LT(MedianMiss_um(fit), 6);
}

// A shift of the image just between two frames is the frames' own.
TEST(MovedFrames, EarnAnEffectNothing) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 80, .seed = 7});
  MoveCamera({{.id = 1, .until = 39}, {.id = 2, .until = 80}}, &campaign);
  const CampaignFacts facts = MakeFacts(campaign);
  Templates shift = ListTemplates(*FindEffect("camera_similarity"), facts);
  ASSERT_FALSE(shift.empty());
  shift = {WithShape(shift[0], 39), WithShape(shift[0], 20)};
  const ScorePass pass = ScoreTemplates(StaticFit(facts), shift);
  EXPECT_LT(pass.scores[0].fleet_g.norm(), 1e-6 * pass.scores[1].fleet_g.norm());
}

TEST(MovedFrames, AreNoDifferenceOfModels) {
  Campaign moved = Planted({}, {.units = 24, .moves = 80, .seed = 6});
  CampaignModel table, off;
  table.units = off.units = moved.units;
  for (CampaignUnit& unit : off.units) unit.arm_mm[kTheta] += 0.02;
  MoveBetweenSessions(&moved);
  const ModelComparison compared = CompareModels({&table, &off}, moved, {});
  EXPECT_LT(compared.a.rms_um, compared.b.rms_um);
  EXPECT_LT(compared.a.rms_um, 50) << "the frames were not taken to one";
}

}  // namespace
}  // namespace focalfleet::sim
