// The whole image moves by its own unrest, by the air, or with a column of the table.
#include "sim/campaigns/diagnosis/terms/image.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>

#include "protocol/base/rng.h"
#include "sim/campaigns/diagnosis/model/term_trace.h"
#include "sim/campaigns/diagnosis/terms/image_followed.h"
#include "sim/campaigns/effects/registry.h"
#include "tests/sim/campaigns/planting/planted_campaign.h"

namespace focalfleet::sim {
namespace {

using test::Planted;
using test::Reported;
using test::StaticFit;
using test::Verdicts;
using testing::ElementsAre;
using testing::IsEmpty;

struct Shift {
  double x_um, y_um;
};

// A campaign whose image is shifted at each exposure; `shift` takes the exposure's index.
Campaign Shifted(const std::function<Shift(std::size_t)>& shift) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 80, .seed = 8});
  const Exposures exposures = FindExposures(campaign);
  for (std::size_t row = 0; row < campaign.rows(); ++row) {
    const Shift s = shift(exposures.of_row[row]);
    campaign.x_mm[row] += 1e-3 * s.x_um;
    campaign.y_mm[row] += 1e-3 * s.y_um;
  }
  return campaign;
}

TEST(Image, AWanderingImageIsTheCameras) {
  Rng rng = Rng::Stream(1, "wander");
  std::vector<Shift> walk(80);
  for (std::size_t e = 1; e < walk.size(); ++e)
    walk[e] = {walk[e - 1].x_um + 2 * rng.Normal(), walk[e - 1].y_um + 2 * rng.Normal()};
  const Diagnosis diagnosis = Verdicts(Shifted([&](std::size_t e) { return walk[e]; }));
  ASSERT_EQ(diagnosis.causes.size(), 1u) << Reported(diagnosis);
  EXPECT_THAT(diagnosis.causes[0].candidates, ElementsAre("camera_similarity"));
  EXPECT_THAT(diagnosis.unknown, IsEmpty()) << Reported(diagnosis);
}

// Units go anywhere, and then all make the same step, most steps short, on one axis or the other.
Campaign SteppingAlike(std::uint64_t seed) {
  constexpr double kSteps_deg[] = {0.2, 0.5, 1, 2, 5, 20};
  PlantedOptions options{.units = 16, .moves = 40, .seed = seed};
  const Campaign first = Planted({}, options);
  Rng rng = Rng::Stream(seed, "alike");
  std::vector<ProposedMove> moves;
  ProposedMove at{.theta_fp_deg = 20, .phi_fp_deg = 100};
  for (int k = 0; k < 50; ++k) {
    const double step = kSteps_deg[rng.Below(6)] * (rng.Uniform() < 0.5 ? 1 : -1);
    (rng.Uniform() < 0.7 ? at.theta_fp_deg : at.phi_fp_deg) += step;
    at.theta_fp_deg = std::clamp(at.theta_fp_deg, -120.0, 120.0);
    at.phi_fp_deg = std::clamp(at.phi_fp_deg, 40.0, 140.0);
    moves.push_back(at);
  }
  options.next = SpreadOver(first.units, moves);
  return Planted({}, options);
}

// Common motion of all units shifts the image, and its wander may look like a cause of theirs.
TEST(Image, AWanderIsNoCauseOfUnitsThatStepAlike) {
  for (const std::uint64_t seed : {3u, 4u}) {
    Campaign campaign = SteppingAlike(seed);
    const Exposures exposures = FindExposures(campaign);
    Rng rng = Rng::Stream(seed, "wander far");
    std::vector<Shift> walk(exposures.size());
    for (std::size_t e = 1; e < walk.size(); ++e)
      walk[e] = {0.7 * walk[e - 1].x_um + 8 * rng.Normal(),
                 0.7 * walk[e - 1].y_um + 8 * rng.Normal()};
    for (std::size_t row = 0; row < campaign.rows(); ++row) {
      campaign.x_mm[row] += 1e-3 * walk[exposures.of_row[row]].x_um;
      campaign.y_mm[row] += 1e-3 * walk[exposures.of_row[row]].y_um;
    }
    const Diagnosis diagnosis = Verdicts(campaign);
    ASSERT_FALSE(diagnosis.causes.empty());
    EXPECT_EQ(diagnosis.causes[0].cause, "camera_similarity") << Reported(diagnosis);
    for (const CauseFound& cause : diagnosis.causes) {
      if (cause.cause == "arm_length" || cause.cause == "base_offset") continue;
      EXPECT_THAT(cause.candidates, testing::Contains("camera_similarity")) << Reported(diagnosis);
    }
  }
}

TEST(Image, OneThatForgetsMayBeAir) {
  Rng rng = Rng::Stream(2, "forgets");
  std::vector<Shift> anew(80);
  for (Shift& s : anew) s = {4 * rng.Normal(), 4 * rng.Normal()};
  const Diagnosis diagnosis = Verdicts(Shifted([&](std::size_t e) { return anew[e]; }));
  ASSERT_EQ(diagnosis.causes.size(), 1u) << Reported(diagnosis);
  EXPECT_THAT(diagnosis.causes[0].candidates,
              testing::UnorderedElementsAre("camera_similarity", "air_turbulence"));
}

// Every unit makes the first one's moves.
void MoveAlike(Campaign* campaign) {
  for (std::size_t unit = 1; unit < campaign->units.size(); ++unit)
    for (std::size_t row = campaign->first_row[unit]; row < campaign->first_row[unit + 1]; ++row) {
      const std::size_t first = row - campaign->first_row[unit];
      const auto place = [&] {
        return PlaceOf(campaign->units[unit], campaign->cmd_deg[kTheta][row],
                       campaign->cmd_deg[kPhi][row]);
      };
      const PlacePoint before = place();
      for (const std::size_t axis : {kTheta, kPhi})
        for (std::vector<double>* angle : {&campaign->from_deg[axis], &campaign->cmd_deg[axis]})
          (*angle)[row] = (*angle)[first];
      const PlacePoint after = place();
      campaign->x_mm[row] += after.x_mm - before.x_mm;
      campaign->y_mm[row] += after.y_mm - before.y_mm;
    }
}

TEST(Image, OnlyOneThatMovesAlongALineMayBeGravitys) {
  const struct {
    double across, turn_um;
    bool alike, may_be_gravity;
  } cases[] = {{0, 0, false, true}, {0, 0, true, true}, {1, 0, false, false}, {0, 5, false, false}};
  for (const auto& [across, turn_um, alike, may_be_gravity] : cases) {
    SCOPED_TRACE(std::to_string(across) + " " + std::to_string(turn_um));
    Rng rng = Rng::Stream(3, "sags");
    std::vector<Shift> anew(80);
    std::vector<double> turns_um(80);
    for (std::size_t e = 0; e < anew.size(); ++e) {
      const double along = 4 * rng.Normal(), aside = 4 * across * rng.Normal();
      anew[e] = {0.6 * along - 0.8 * aside, 0.8 * along + 0.6 * aside};
      turns_um[e] = turn_um * rng.Normal();
    }
    Campaign campaign = Shifted([&](std::size_t e) { return anew[e]; });
    std::erase_if(campaign.covariates,
                  [](const Covariate& c) { return c.name == "elevation_deg"; });
    if (alike) MoveAlike(&campaign);
    const Exposures exposures = FindExposures(campaign);
    double edge_mm = 0;
    for (const CampaignUnit& unit : campaign.units)
      edge_mm = std::max(edge_mm, std::hypot(unit.base_x_mm, unit.base_y_mm));
    for (std::size_t row = 0; row < campaign.rows(); ++row) {
      const double turn = 1e-3 * turns_um[exposures.of_row[row]] / edge_mm;
      const double x_mm = campaign.x_mm[row];
      campaign.x_mm[row] -= turn * campaign.y_mm[row];
      campaign.y_mm[row] += turn * x_mm;
    }
    const Diagnosis diagnosis = Verdicts(campaign);
    const auto image = std::ranges::find(diagnosis.causes, "camera_similarity", &CauseFound::cause);
    ASSERT_NE(image, diagnosis.causes.end()) << Reported(diagnosis);
    EXPECT_EQ(std::ranges::count(image->candidates, "gravity_sag"), may_be_gravity ? 1 : 0)
        << Reported(diagnosis);
  }
}

// An image that is shifted and deformed anew at each exposure: um at the plate's edge.
Campaign Deformed(std::size_t units, double turn_and_scale_um, double shear_um) {
  Campaign campaign = Planted({}, {.units = units, .moves = 80, .seed = 8});
  const Exposures exposures = FindExposures(campaign);
  Rng rng = Rng::Stream(4, "deformed");
  std::vector<std::array<double, 6>> of(exposures.size());
  for (auto& one : of)
    for (double& draw : one) draw = rng.Normal();
  double edge_mm = 0;
  for (const CampaignUnit& unit : campaign.units)
    edge_mm = std::max(edge_mm, std::hypot(unit.base_x_mm, unit.base_y_mm));
  for (std::size_t row = 0; row < campaign.rows(); ++row) {
    const auto& d = of[exposures.of_row[row]];
    const double x = campaign.x_mm[row] / edge_mm, y = campaign.y_mm[row] / edge_mm;
    const double turn = turn_and_scale_um * d[2], scale = turn_and_scale_um * d[3];
    const double one = shear_um * d[4], other = shear_um * d[5];
    campaign.x_mm[row] += 1e-3 * (4 * d[0] - turn * y + scale * x + one * x + other * y);
    campaign.y_mm[row] += 1e-3 * (4 * d[1] + turn * x + scale * y - one * y + other * x);
  }
  return campaign;
}

TEST(Image, OneThatTurnsAndScalesWithoutShearsIsTheCameras) {
  const Diagnosis diagnosis = Verdicts(Deformed(24, 4, 0));
  ASSERT_EQ(diagnosis.causes.size(), 1u) << Reported(diagnosis);
  EXPECT_THAT(diagnosis.causes[0].candidates, ElementsAre("camera_similarity"));
}

TEST(Image, OneThatShearsAsMuchIsAir) {
  for (const std::size_t units : {8u, 24u}) {
    const Diagnosis diagnosis = Verdicts(Deformed(units, 3, 3));
    ASSERT_FALSE(diagnosis.causes.empty()) << units;
    EXPECT_THAT(diagnosis.causes[0].candidates, ElementsAre("air_turbulence"))
        << units << Reported(diagnosis);
  }
}

// Three half turns in the course of the campaign. Shape: (exposures).
std::vector<double> SlowPhase(const Campaign& campaign) {
  const Exposures exposures = FindExposures(campaign);
  const std::span<const double> time_s = campaign.Find("t_s");
  const double last_s = *std::ranges::max_element(time_s);
  std::vector<double> phase(exposures.size());
  for (std::size_t row = 0; row < campaign.rows(); ++row)
    phase[exposures.of_row[row]] = 3 * std::numbers::pi * time_s[row] / last_s;
  return phase;
}

TEST(Image, OneThatSwingsSlowlyIsTheCamerasAndUnknown) {
  const std::vector<double> phase = SlowPhase(Shifted([](std::size_t) { return Shift{0, 0}; }));
  const Diagnosis diagnosis = Verdicts(Shifted([&](std::size_t e) {
    return Shift{6 * std::sin(phase[e]), 3 * std::cos(phase[e])};
  }));
  EXPECT_EQ(diagnosis.verdict, Verdict::kUnknown) << Reported(diagnosis);
  ASSERT_FALSE(diagnosis.causes.empty()) << Reported(diagnosis);
  EXPECT_EQ(diagnosis.causes[0].cause, "camera_similarity") << Reported(diagnosis);
  ASSERT_FALSE(diagnosis.unknown.empty()) << Reported(diagnosis);
  EXPECT_EQ(diagnosis.unknown[0].covariate, "t_s");
}

// Moves without a picture are no evidence about the image.
TEST(Image, OneThatSwingsIsSeenToThoughEverySecondMoveIsNot) {
  const std::vector<double> phase = SlowPhase(Shifted([](std::size_t) { return Shift{0, 0}; }));
  Campaign campaign = Shifted([&](std::size_t e) {
    return Shift{6 * std::sin(phase[e]), 3 * std::cos(phase[e])};
  });
  const Exposures exposures = FindExposures(campaign);
  for (std::size_t row = 0; row < campaign.rows(); ++row)
    if (exposures.of_row[row] % 2 == 0) campaign.x_mm[row] = campaign.y_mm[row] = std::nan("");
  const Diagnosis diagnosis = Verdicts(campaign);
  ASSERT_FALSE(diagnosis.causes.empty()) << Reported(diagnosis);
  EXPECT_THAT(diagnosis.causes[0].candidates, ElementsAre("camera_similarity", "unknown"))
      << Reported(diagnosis);
  EXPECT_GT(diagnosis.causes[0].size_um, 0.7 * std::sqrt(0.5 * (36 + 9)));  // geometry takes some
  ASSERT_FALSE(diagnosis.unknown.empty()) << Reported(diagnosis);
  EXPECT_EQ(diagnosis.unknown[0].covariate, "t_s");
}

// A camera that goes out of focus scales, and so does a plate that grows by a law of its own.
TEST(Image, OneThatOnlyScalesAndGoesOnMayBeThePlate) {
  Rng rng = Rng::Stream(7, "grows");
  std::vector<double> scale(80, 0);
  for (std::size_t e = 1; e < scale.size(); ++e) scale[e] = scale[e - 1] + 4e-5 * rng.Normal();
  Campaign campaign = Shifted([](std::size_t) { return Shift{0, 0}; });
  const Exposures exposures = FindExposures(campaign);
  for (std::size_t row = 0; row < campaign.rows(); ++row) {
    const double by = scale[exposures.of_row[row]];
    campaign.x_mm[row] *= 1 + by, campaign.y_mm[row] *= 1 + by;
  }
  const Diagnosis diagnosis = Verdicts(campaign);
  ASSERT_FALSE(diagnosis.causes.empty()) << Reported(diagnosis);
  EXPECT_THAT(diagnosis.causes[0].candidates, ElementsAre("camera_similarity", "plate_expansion"))
      << Reported(diagnosis);
  DiagnoseOptions options;
  options.leave_out = {"plate_expansion"};
  EXPECT_THAT(Diagnose(campaign, options).causes[0].candidates, ElementsAre("camera_similarity"));
}

TEST(Image, OneThatAlsoTurnsAndScalesAsItSwingsIsTheCameras) {
  Campaign campaign = Shifted([](std::size_t) { return Shift{0, 0}; });
  const Exposures exposures = FindExposures(campaign);
  const std::vector<double> phase = SlowPhase(campaign);
  for (std::size_t row = 0; row < campaign.rows(); ++row) {
    const double at = phase[exposures.of_row[row]];
    const double turn = 1e-4 * std::sin(at + 1), scale = 1e-4 * std::sin(at + 2);
    const double x = campaign.x_mm[row], y = campaign.y_mm[row];
    campaign.x_mm[row] += 0.006 * std::sin(at) - turn * y + scale * x;
    campaign.y_mm[row] += 0.003 * std::cos(at) + turn * x + scale * y;
  }
  const Diagnosis diagnosis = Verdicts(campaign);
  ASSERT_FALSE(diagnosis.causes.empty()) << Reported(diagnosis);
  EXPECT_THAT(diagnosis.causes[0].candidates, ElementsAre("camera_similarity", "unknown"));
  for (const UnknownFound& unknown : diagnosis.unknown)
    EXPECT_FALSE(unknown.channel.starts_with(kImageShift)) << Reported(diagnosis);
}

TEST(Image, ADriftIsAsGoodAsWhatGravitySeemsToDo) {
  const Campaign campaign =
      Planted({{.cause = "gravity_sag", .amplitude = 6}}, {.units = 24, .moves = 60});
  const CampaignFacts facts = MakeFacts(campaign);
  Fit fit = StaticFit(facts);
  ModelTerm sag;
  sag.form = ListTemplates(*FindEffect("gravity_sag"), facts).front();
  sag.group_of_unit.assign(campaign.units.size(), 0);
  sag.amplitude.assign(sag.form.columns, 0), sag.sigma = sag.amplitude;
  fit.model.terms.push_back(sag);
  StepFit(&fit);
  const double size_um = SizeOf(fit, fit.model.terms[0]);
  ASSERT_GT(size_um, 1);
  Selection selection;
  selection.accepted.resize(1);
  AddDriftAsRival(0.4 * size_um, fit, &selection);
  EXPECT_THAT(selection.accepted[0].rivals, IsEmpty());
  AddDriftAsRival(0.6 * size_um, fit, &selection);
  ASSERT_EQ(selection.accepted[0].rivals.size(), 1u);
  EXPECT_EQ(selection.accepted[0].rivals[0].cause, "camera_similarity");
}

// The image shifts along x by so much a metre per second of wind.
Campaign Windy(const std::vector<double>& wind_m_s, double shift_um) {
  Campaign campaign = Shifted([&](std::size_t e) { return Shift{shift_um * wind_m_s[e], 0}; });
  const Exposures exposures = FindExposures(campaign);
  Covariate column{.name = "wind_m_s"};
  for (std::size_t row = 0; row < campaign.rows(); ++row)
    column.values.push_back(wind_m_s[exposures.of_row[row]]);
  campaign.covariates.push_back(std::move(column));
  return campaign;
}

TEST(Image, OneThatFollowsTheWindIsUnknownByTheWind) {
  Rng rng = Rng::Stream(3, "wind");
  std::vector<double> wind(80);
  for (double& w : wind) w = rng.Uniform(0, 12);
  const Diagnosis diagnosis = Verdicts(Windy(wind, 0.5));
  EXPECT_THAT(diagnosis.causes, IsEmpty()) << Reported(diagnosis);
  ASSERT_FALSE(diagnosis.unknown.empty()) << Reported(diagnosis);
  EXPECT_EQ(diagnosis.unknown[0].covariate, "wind_m_s");
}

TEST(Image, AWindThatRisesOnceIsNoStepOfTheCamera) {
  Rng rng = Rng::Stream(6, "rising");
  std::vector<double> wind(80);
  for (std::size_t e = 0; e < wind.size(); ++e)
    wind[e] = 6 + 3 * std::tanh((static_cast<double>(e) - 45) / 4) + 2.5 * rng.Normal();
  const Diagnosis diagnosis = Verdicts(Windy(wind, 0.3));
  EXPECT_THAT(diagnosis.causes, IsEmpty()) << Reported(diagnosis);
  ASSERT_FALSE(diagnosis.unknown.empty()) << Reported(diagnosis);
  EXPECT_EQ(diagnosis.unknown[0].covariate, "wind_m_s");
}

}  // namespace
}  // namespace focalfleet::sim
