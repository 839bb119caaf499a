#include "sim/campaigns/diagnosis/decide/diagnosis.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <complex>
#include <numbers>
#include <string>
#include <thread>

#include "sim/campaigns/diagnosis/terms/homings.h"
#include "sim/campaigns/effects/registry.h"
#include "tests/sim/campaigns/planting/planted_campaign.h"

namespace focalfleet::sim {
namespace {

using test::ExchangePlaces;
using test::Planted;
using test::Reported;
using test::StaticFit;
using test::TurnTheta;
using test::Verdicts;
using testing::Contains;
using testing::UnorderedElementsAre;

TEST(Diagnosis, NothingWrongIsConsistent) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const Diagnosis diagnosis = Verdicts(Planted({}, {.units = 24, .seed = seed}));
    EXPECT_EQ(diagnosis.verdict, Verdict::kConsistent)
        << "seed " << seed << ": " << Reported(diagnosis);
  }
}

struct Plant {
  const char* cause;
  const char* axis;
  double amplitude;
};

class EveryEffect : public testing::TestWithParam<Plant> {};

TEST_P(EveryEffect, IsNamedAndMeasured) {
  const Plant& plant = GetParam();
  const Diagnosis diagnosis =
      Verdicts(Planted({{.cause = plant.cause, .amplitude = plant.amplitude, .axis = plant.axis}},
                       {.units = 24, .moves = 80, .seed = 3}));
  ASSERT_EQ(diagnosis.causes.size(), 1u) << Reported(diagnosis);
  EXPECT_THAT(diagnosis.causes[0].candidates, Contains(plant.cause)) << Reported(diagnosis);
  EXPECT_TRUE(diagnosis.unknown.empty()) << Reported(diagnosis);
  if (diagnosis.causes[0].cause != plant.cause) return;  // a true tie
  // The tolerance is wide because another shape of the same cause has another scale of its
  // amplitude.
  EXPECT_NEAR(std::abs(diagnosis.causes[0].amplitude), plant.amplitude, 0.3 * plant.amplitude);
}

INSTANTIATE_TEST_SUITE_P(
    Planted, EveryEffect,
    testing::Values(Plant{"gear_scale", "theta", 3e-4}, Plant{"scale_asymmetry", "phi", 5e-5},
                    Plant{"ramp_travel", "theta", 0.004}, Plant{"backlash", "theta", 0.05},
                    Plant{"friction_windup", "phi", 0.05}, Plant{"eccentricity", "theta", 0.1},
                    Plant{"pinion_runout", "theta", 0.03}, Plant{"stage_ripple", "theta", 0.03},
                    Plant{"tooth_mesh", "theta", 0.03}, Plant{"tooth_damage", "theta", 0.1},
                    Plant{"cogging", "theta", 0.015}, Plant{"phase_imbalance", "theta", 0.016},
                    Plant{"load_angle_lag", "theta", 0.03}, Plant{"supply_droop", "theta", 0.05},
                    Plant{"supply_drift", "theta", 0.4}, Plant{"thermal_backlash", "theta", 0.006},
                    Plant{"thermal_arm_growth", "both", 6e-5}, Plant{"self_heating", "theta", 0.1},
                    Plant{"plate_expansion", "none", 3e-5}, Plant{"gravity_sag", "none", 6},
                    Plant{"gravity_torque", "theta", 0.06}, Plant{"relaxation", "theta", 0.05},
                    Plant{"axis_crosstalk", "theta", 5e-4}, Plant{"fibre_torque", "theta", 0.08},
                    Plant{"axis_tilt", "theta", 5e-4}, Plant{"neighbour_coupling", "theta", 0.02},
                    Plant{"mode_threshold", "theta", 0.04}),
    [](const auto& plant) { return std::string(plant.param.cause); });

TEST(Diagnosis, APlateThatBendsOneWayForAllIsNamed) {
  const Diagnosis diagnosis =
      Verdicts(Planted({{.cause = "plate_gradient", .amplitude = 1e-4, .form = 1}}));
  ASSERT_EQ(diagnosis.causes.size(), 1u) << Reported(diagnosis);
  EXPECT_EQ(diagnosis.causes[0].cause, "plate_gradient");
}

TEST(Diagnosis, WithoutAnOutputStageTheLastPinionSitsOnAStagesCarrier) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 80, .seed = 3});
  for (CampaignUnit& unit : campaign.units)
    unit.gear[kTheta] = unit.gear[kPhi] = std::pow(60.0 / 14, 4);
  TurnTheta(
      [&](std::size_t row) {
        const double turn = campaign.cmd_deg[kTheta][row] * std::numbers::pi / 180;
        return 0.05 * std::sin(60.0 / 14 * turn + 1);
      },
      &campaign);
  const Diagnosis diagnosis = Verdicts(campaign);
  ASSERT_EQ(diagnosis.causes.size(), 1u) << Reported(diagnosis);
  EXPECT_THAT(diagnosis.causes[0].candidates,
              testing::UnorderedElementsAre("pinion_runout", "stage_ripple"));
}

// The sensors at the units see a hundredth of the gradient that bends the plate.
TEST(Diagnosis, AGradientThatSensorsSeeLittleOfIsNamed) {
  constexpr double kPerKelvin = 1.5e-3, kGradient_C_per_mm = 0.01;
  Campaign campaign = Planted({}, {.units = 24, .moves = 80, .seed = 3});
  const Exposures exposures = FindExposures(campaign);
  const auto temperature =
      std::ranges::find(campaign.covariates, std::string("temp_C"), &Covariate::name);
  ASSERT_NE(temperature, campaign.covariates.end());
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit)
    for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row) {
      const double turned = 0.05 * static_cast<double>(exposures.of_row[row]);
      const double a = kGradient_C_per_mm * std::cos(turned);
      const double b = kGradient_C_per_mm * std::sin(turned);
      const double x = campaign.x_mm[row], y = campaign.y_mm[row];
      temperature->values[row] +=
          a * campaign.units[unit].base_x_mm + b * campaign.units[unit].base_y_mm;
      campaign.x_mm[row] += kPerKelvin * (a * (x * x - y * y) / 2 + b * x * y);
      campaign.y_mm[row] += kPerKelvin * (b * (y * y - x * x) / 2 + a * x * y);
    }
  const Diagnosis diagnosis = Verdicts(campaign);
  ASSERT_FALSE(diagnosis.causes.empty());
  EXPECT_EQ(diagnosis.verdict, Verdict::kExplained) << Reported(diagnosis);
  EXPECT_THAT(diagnosis.causes[0].candidates, testing::ElementsAre("plate_gradient"));
  EXPECT_NEAR(diagnosis.causes[0].amplitude, kPerKelvin, 0.2 * kPerKelvin);
}

// On a wide plate a lens shifts each unit far more than it bends what the unit sees.
TEST(Diagnosis, ALensOverAWidePlateIsNoTiltOfEachUnit) {
  const Diagnosis diagnosis =
      Verdicts(Planted({{.cause = "camera_distortion", .amplitude = 40}}, {.units = 120}));
  ASSERT_FALSE(diagnosis.causes.empty());
  EXPECT_EQ(diagnosis.causes[0].cause, "camera_distortion") << Reported(diagnosis);
  EXPECT_NEAR(diagnosis.causes[0].amplitude, 40, 2);
}

// Oblong pixels shear the image. Within each unit's reach that is what an axis does that leans, in
// one direction in all units.
TEST(Diagnosis, AShearedImageIsNoTiltForSure) {
  constexpr double kShear = 3e-4;
  Campaign campaign = Planted({}, {.units = 60});
  for (std::size_t row = 0; row < campaign.rows(); ++row)
    campaign.x_mm[row] *= 1 + kShear, campaign.y_mm[row] *= 1 - kShear;
  const Diagnosis diagnosis = Verdicts(campaign);
  const auto sheared = std::ranges::find_if(diagnosis.causes, [](const CauseFound& cause) {
    return std::ranges::find(cause.candidates, "camera_distortion") != cause.candidates.end();
  });
  ASSERT_NE(sheared, diagnosis.causes.end()) << Reported(diagnosis);
  for (const CauseFound& cause : diagnosis.causes)
    EXPECT_THAT(cause.candidates, testing::Not(testing::ElementsAre("axis_tilt")))
        << Reported(diagnosis);
}

TEST(Diagnosis, TwoNamesForOneEffectAreAnAmbiguityOfTwo) {
  std::vector<Effect> library = EffectLibrary();
  Effect twin = *FindEffect("eccentricity");
  twin.cause = "eccentricity_again";
  library.insert(library.begin(), std::move(twin));
  const Diagnosis diagnosis =
      Verdicts(Planted({{.cause = "eccentricity", .amplitude = 0.1}}), {.library = library});
  ASSERT_EQ(diagnosis.causes.size(), 1u) << Reported(diagnosis);
  EXPECT_EQ(diagnosis.verdict, Verdict::kAmbiguous);
  EXPECT_THAT(diagnosis.causes[0].candidates,
              UnorderedElementsAre("eccentricity", "eccentricity_again"));
}

TEST(Diagnosis, WithoutTheTrueEffectItIsUnknown) {
  const Diagnosis diagnosis = Verdicts(Planted({{.cause = "pinion_runout", .amplitude = 0.06}}),
                                       {.leave_out = {"pinion_runout"}});
  EXPECT_EQ(diagnosis.verdict, Verdict::kUnknown) << Reported(diagnosis);
}

TEST(Diagnosis, TheOrderOfTheLibraryDoesNotMatter) {
  const Campaign campaign = Planted({{.cause = "backlash", .amplitude = 0.04},
                                     {.cause = "thermal_arm_growth", .amplitude = 5e-5}});
  const std::string first = Reported(Verdicts(campaign));
  EXPECT_EQ(first, Reported(Verdicts(campaign, {.shuffle_library = 7})));
}

TEST(Diagnosis, IsTheSameBitForBitOnTwoThreads) {
  const Campaign campaign = Planted({{.cause = "backlash", .amplitude = 0.04}});
  const Diagnosis one = Verdicts(campaign);
  const Diagnosis two = Verdicts(
      campaign, {.parallel = [](std::size_t chunks, const std::function<void(std::size_t)>& work) {
        const auto half = [&](std::size_t from) {
          for (std::size_t chunk = from; chunk < chunks; chunk += 2) work(chunk);
        };
        std::thread other(half, 1);
        half(0);
        other.join();
      }});
  EXPECT_EQ(Reported(one), Reported(two));
  EXPECT_EQ(one.x_after_um, two.x_after_um);
}

// The plate turned under the sky, with base, zero of theta and places.
Campaign Turned(Campaign campaign, double turn_deg) {
  const std::complex<double> turn = std::polar(1.0, turn_deg * std::numbers::pi / 180);
  for (CampaignUnit& unit : campaign.units) {
    const auto base = turn * std::complex(unit.base_x_mm, unit.base_y_mm);
    unit.base_x_mm = base.real(), unit.base_y_mm = base.imag();
    unit.zero_deg[kTheta] += turn_deg;
  }
  for (std::size_t row = 0; row < campaign.rows(); ++row) {
    const auto place = turn * std::complex(campaign.x_mm[row], campaign.y_mm[row]);
    campaign.x_mm[row] = place.real(), campaign.y_mm[row] = place.imag();
  }
  return campaign;
}

class OnATurnedPlate : public testing::TestWithParam<Plant> {};

TEST_P(OnATurnedPlate, TheCausesAreTheSame) {
  const Plant& plant = GetParam();
  const Campaign campaign =
      Planted({{.cause = plant.cause, .amplitude = plant.amplitude, .axis = plant.axis}},
              {.units = 24, .moves = 80, .seed = 3});
  const Diagnosis straight = Verdicts(campaign), turned = Verdicts(Turned(campaign, 37));
  ASSERT_EQ(straight.causes.size(), 1u) << Reported(straight);
  ASSERT_EQ(turned.causes.size(), 1u) << Reported(turned);
  EXPECT_EQ(turned.verdict, straight.verdict);
  EXPECT_EQ(turned.causes[0].cause, straight.causes[0].cause);
  EXPECT_EQ(turned.causes[0].candidates, straight.causes[0].candidates);
  EXPECT_EQ(turned.causes[0].units, straight.causes[0].units);
  EXPECT_NEAR(turned.causes[0].amplitude, straight.causes[0].amplitude,
              0.02 * std::abs(straight.causes[0].amplitude));
}

// Effects of gravity and of pixels are left out: they do not turn with the plate.
INSTANTIATE_TEST_SUITE_P(
    Planted, OnATurnedPlate,
    testing::Values(Plant{"gear_scale", "theta", 3e-4}, Plant{"backlash", "theta", 0.05},
                    Plant{"eccentricity", "theta", 0.1}, Plant{"pinion_runout", "theta", 0.03},
                    Plant{"thermal_arm_growth", "both", 6e-5},
                    Plant{"plate_expansion", "none", 3e-5}, Plant{"axis_crosstalk", "theta", 5e-4},
                    Plant{"self_heating", "theta", 0.1}),
    [](const auto& plant) { return std::string(plant.param.cause); });

// The amplitude is large, but possible.
TEST(Diagnosis, WhatOneUnitDoesAlmostAloneIsNamed) {
  const Diagnosis diagnosis = Verdicts(
      Planted({{.cause = "gravity_torque", .amplitude = 2.5, .axis = "phi", .unit_share = 0.04}}));
  ASSERT_EQ(diagnosis.causes.size(), 1u) << Reported(diagnosis);
  EXPECT_EQ(diagnosis.causes[0].cause, "gravity_torque");
  EXPECT_EQ(diagnosis.causes[0].candidates.size(), 1u) << Reported(diagnosis);
  EXPECT_EQ(diagnosis.causes[0].units.size(), 1u);
}

TEST(Diagnosis, AMissingColumnIsNotTestable) {
  Campaign campaign = Planted({});
  std::erase_if(campaign.covariates, [](const Covariate& c) { return c.name == "delay_s"; });
  const Diagnosis diagnosis = Verdicts(campaign);
  EXPECT_TRUE(std::any_of(
      diagnosis.not_testable.begin(), diagnosis.not_testable.end(), [](const NotTestable& cause) {
        return cause.cause == "relaxation" && cause.why.find("delay_s") != std::string::npos;
      }));
}

TEST(Diagnosis, TooFewMovesAreInsufficient) {
  const Diagnosis diagnosis = Verdicts(Planted({}, {.units = 24, .moves = 3}));
  EXPECT_EQ(diagnosis.verdict, Verdict::kInsufficient);
  EXPECT_FALSE(diagnosis.insufficient.empty());
}

TEST(Diagnosis, OtherUnitsGeometryIsInsufficient) {
  Campaign campaign = Planted({});
  for (double& x : campaign.x_mm) x = 40 * std::sin(1e3 * x);
  EXPECT_EQ(Verdicts(campaign).verdict, Verdict::kInsufficient);
}

TEST(Diagnosis, OutliersAreCountedAndNameNoCause) {
  const Diagnosis diagnosis = Verdicts(Planted(
      {}, {.units = 24, .moves = 80, .seed = 6, .outlier_share = 0.01, .lost_share = 0.02}));
  EXPECT_TRUE(diagnosis.causes.empty()) << Reported(diagnosis);
  EXPECT_GT(diagnosis.outliers.rows, 20u);
}

TEST(Diagnosis, GeometryThatDiffersIsNamed) {
  const Diagnosis diagnosis =
      Verdicts(Planted({}, {.units = 24, .seed = 2, .zero_offset_deg = 0.5}));
  EXPECT_EQ(diagnosis.verdict, Verdict::kExplained) << Reported(diagnosis);
  ASSERT_EQ(diagnosis.causes.size(), 1u) << Reported(diagnosis);
  EXPECT_EQ(diagnosis.causes[0].cause, "zero_offset");
  EXPECT_NEAR(diagnosis.causes[0].amplitude, 0.5, 0.15);
}

TEST(Diagnosis, CommandsThatAreRoundedDownAreNamed) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 80, .seed = 5});
  TurnTheta(
      [&](std::size_t row) {
        const double steps = campaign.cmd_deg[kTheta][row] / 0.1;
        return 0.1 * (std::floor(steps) - steps);
      },
      &campaign);
  const Diagnosis diagnosis = Verdicts(campaign);
  ASSERT_FALSE(diagnosis.causes.empty()) << Reported(diagnosis);
  EXPECT_EQ(diagnosis.causes[0].cause, "command_quantisation") << Reported(diagnosis);
  EXPECT_THAT(diagnosis.causes[0].shape, testing::HasSubstr("rounded down; step, deg, 0.1"));
  EXPECT_NEAR(diagnosis.causes[0].amplitude, 1, 0.05);
}

TEST(Diagnosis, SwappedFibresAreFound) {
  Campaign campaign = Planted({});
  ExchangePlaces(3, 9, &campaign);
  const Diagnosis diagnosis = Verdicts(campaign);
  ASSERT_EQ(diagnosis.causes.size(), 1u) << Reported(diagnosis);
  EXPECT_EQ(diagnosis.causes[0].cause, "identity_swap");
  EXPECT_THAT(diagnosis.causes[0].units, UnorderedElementsAre(4u, 10u));
}

// Each homing finds another zero, by `sigma_deg`.
Campaign Homed(double sigma_deg, std::uint64_t seed) {
  Campaign campaign = Planted(
      {}, {.units = 24, .moves = 100, .seed = seed, .outlier_share = 0.01, .homing_share = 0.05});
  const std::span<const double> rehomed = campaign.Find("rehomed");
  Rng rng = Rng::Stream(seed, "zeros");
  std::vector<double> zero_deg(campaign.rows(), 0);
  for (std::size_t row = 1; row < campaign.rows(); ++row)
    zero_deg[row] = rehomed[row] > 0.5 ? sigma_deg * rng.Normal() : zero_deg[row - 1];
  TurnTheta([&](std::size_t row) { return zero_deg[row]; }, &campaign);
  return campaign;
}

TEST(Diagnosis, TheScatterOfHomingsIsWhatTheirZerosDoAtTheFibre) {
  for (const double sigma_deg : {0.0, 0.05}) {
    const Campaign campaign = Homed(sigma_deg, 4);
    const CampaignFacts facts = MakeFacts(campaign);
    Fit fit = StaticFit(facts);
    FreeHomings(&fit);
    const HomingScatter scatter = ScatterOfHomings(fit);
    // Each unit's own zero takes a part of what is planted; noise alone makes below 2 um.
    const double planted_um = 1e3 * 16.5 * sigma_deg * std::numbers::pi / 180;
    EXPECT_LT(scatter.both_um(), planted_um + 2.5);
    EXPECT_GT(scatter.both_um(), 0.5 * planted_um);
    EXPECT_NEAR(scatter.rms_deg[kPhi], 0, 0.01);
  }
}

TEST(Diagnosis, WhatAddsUpFromAFarHomingIsNotTakenForItsZero) {
  // A survey: whole moves of both axes, of which geometry explains most of a cross-talk.
  constexpr double kPerDeg = 3e-4, kHome_deg = 182;
  Campaign campaign = Planted({}, {.units = 24, .seed = 12});
  Rng rng = Rng::Stream(12, "survey");
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit) {
    const std::size_t first = campaign.first_row[unit];
    for (std::size_t row = first; row < campaign.first_row[unit + 1]; ++row) {
      double* cmd[2] = {&campaign.cmd_deg[kTheta][row], &campaign.cmd_deg[kPhi][row]};
      *cmd[kTheta] = rng.Uniform(-170, 170), *cmd[kPhi] = rng.Uniform(5, 175);
      for (const std::size_t axis : {kTheta, kPhi})
        campaign.from_deg[axis][row] = row > first      ? campaign.cmd_deg[axis][row - 1]
                                       : axis == kTheta ? -170
                                                        : kHome_deg;
      const PlacePoint at = PlaceOf(campaign.units[unit],
                                    *cmd[kTheta] + kPerDeg * (*cmd[kPhi] - kHome_deg), *cmd[kPhi]);
      campaign.x_mm[row] = at.x_mm + 0.002 * rng.Normal();
      campaign.y_mm[row] = at.y_mm + 0.002 * rng.Normal();
    }
  }
  const Diagnosis diagnosis = Verdicts(campaign);
  const auto named = std::ranges::find(diagnosis.causes, "axis_crosstalk", &CauseFound::cause);
  ASSERT_NE(named, diagnosis.causes.end()) << Reported(diagnosis);
  EXPECT_THAT(named->candidates, testing::SizeIs(1)) << Reported(diagnosis);
  EXPECT_NEAR(named->amplitude, kPerDeg, 0.2 * kPerDeg);
}

}  // namespace
}  // namespace focalfleet::sim
