// Tests of what weak names beside strong ones are worth.
#include "sim/campaigns/diagnosis/families.h"

#include <gmock/gmock.h>

#include <cmath>

namespace focalfleet::sim {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::SizeIs;

constexpr std::size_t kUnits = 40;

CauseFound Cause(const char* name, const char* axis, double delta_log_likelihood,
                 std::vector<std::string> rivals = {}) {
  CauseFound cause;
  cause.cause = name;
  cause.candidates = {name};
  for (std::string& rival : rivals) cause.candidates.push_back(std::move(rival));
  cause.axis = axis;
  cause.all_units = true;
  cause.delta_log_likelihood = delta_log_likelihood;
  cause.size_um = std::sqrt(delta_log_likelihood);  // all have the same noise
  return cause;
}

TEST(Families, AFaintRelativeIsTheShapeOfTheStrongOne) {
  std::vector<CauseFound> causes = {Cause("backlash", "theta", 1000),
                                    Cause("friction_windup", "theta", 20)};
  JudgeMisfitArtefacts(kUnits, &causes);
  ASSERT_THAT(causes, SizeIs(1));
  EXPECT_THAT(causes[0].shape, HasSubstr("friction_windup"));
  EXPECT_THAT(causes[0].misfit_artefacts, ElementsAre("friction_windup"));
}

TEST(Families, AWeakRelativeIsNotSure) {
  std::vector<CauseFound> causes = {Cause("backlash", "theta", 1000),
                                    Cause("friction_windup", "theta", 60)};
  JudgeMisfitArtefacts(kUnits, &causes);
  ASSERT_THAT(causes, SizeIs(2));
  EXPECT_THAT(causes[1].candidates, ElementsAre("friction_windup", "backlash"));
}

TEST(Families, WhatTheSameFewUnitsHaveBesideIsNotSure) {
  const auto of = [](CauseFound cause, std::vector<std::uint32_t> units) {
    cause.all_units = false;
    cause.units = std::move(units);
    return cause;
  };
  std::vector<CauseFound> causes = {of(Cause("collision_contact", "phi", 800), {10, 39, 69}),
                                    of(Cause("self_heating", "theta", 80), {10}),
                                    of(Cause("stage_ripple", "theta", 70), {11})};
  JudgeMisfitArtefacts(kUnits, &causes);
  ASSERT_THAT(causes, SizeIs(3));
  EXPECT_THAT(causes[1].candidates, ElementsAre("self_heating", "collision_contact"));
  EXPECT_THAT(causes[2].candidates, ElementsAre("stage_ripple"));
}

TEST(Families, AFaintCauseOfThePlateBesideAirIsTheAirs) {
  const auto beside_air = [](const char* scope, double evidence, double size_um) {
    std::vector<CauseFound> causes = {Cause("air_turbulence", "none", 2000),
                                      Cause("relaxation", "phi", evidence)};
    causes[0].size_um = 5;
    causes[1].scope = scope, causes[1].size_um = size_um;
    JudgeMisfitArtefacts(kUnits, &causes);
    return causes.size();
  };
  EXPECT_EQ(beside_air("plate", 35, 0.5), 1u);
  EXPECT_EQ(beside_air("rail", 35, 0.5), 1u);
  EXPECT_EQ(beside_air("unit", 35, 0.5), 2u);
  EXPECT_EQ(beside_air("plate", 80, 0.5), 2u);
  EXPECT_EQ(beside_air("plate", 35, 3), 2u);
}

TEST(Families, AShapeLeavesNothingWhereItIsNot) {
  const auto split = [](CauseFound cause, std::map<std::uint32_t, double> evidence) {
    cause.all_units = false;
    for (const auto& [unit, part] : evidence) cause.units.push_back(unit);
    cause.evidence_of_unit = std::move(evidence);
    return cause;
  };
  const auto beside = [&](std::map<std::uint32_t, double> strong,
                          std::map<std::uint32_t, double> weak) {
    std::vector<CauseFound> causes = {split(Cause("gear_scale", "phi", 7000), std::move(strong)),
                                      split(Cause("phase_imbalance", "phi", 180), std::move(weak))};
    JudgeMisfitArtefacts(kUnits, &causes);
    return causes;
  };
  const std::map<std::uint32_t, double> two = {{1, 3500}, {2, 3500}};
  EXPECT_THAT(beside(two, {{1, 100}, {2, 80}}), SizeIs(1));
  EXPECT_THAT(beside(two, {{1, 90}, {2, 60}, {3, 30}}), SizeIs(1));
  for (const auto& causes : {beside(two, {{8, 100}, {9, 80}}), beside(two, {{1, 80}, {8, 100}})}) {
    ASSERT_THAT(causes, SizeIs(2));
    EXPECT_THAT(causes[1].candidates, ElementsAre("phase_imbalance"));
  }
  // In the weak one's units the strong one is not much stronger.
  const auto causes = beside({{1, 6400}, {2, 600}}, {{2, 180}});
  ASSERT_THAT(causes, SizeIs(2));
  EXPECT_THAT(causes[1].candidates, ElementsAre("phase_imbalance", "gear_scale"));
}

TEST(Families, WhatIsFaintBesideTheStrongestIsNoName) {
  std::vector<CauseFound> causes = {Cause("axis_crosstalk", "theta", 2500),
                                    Cause("self_heating", "phi", 22)};
  JudgeMisfitArtefacts(kUnits, &causes);
  EXPECT_THAT(causes, SizeIs(1));

  // A motion of the image has nothing to do with it.
  causes = {Cause("camera_similarity", "none", 30000), Cause("self_heating", "phi", 22)};
  JudgeMisfitArtefacts(kUnits, &causes);
  ASSERT_THAT(causes, SizeIs(2));
  EXPECT_THAT(causes[1].candidates, ElementsAre("self_heating"));
}

TEST(Families, WhatIsFaintByItselfIsNoNameBesideAStrongerOne) {
  const auto beside = [](const char* axis, double delta_log_likelihood) {
    std::vector<CauseFound> causes = {Cause("relaxation", "phi", 92),
                                      Cause("thermal_arm_growth", axis, delta_log_likelihood)};
    JudgeMisfitArtefacts(kUnits, &causes);
    return causes;
  };
  ASSERT_THAT(beside("both", 22), SizeIs(1));
  EXPECT_THAT(beside("both", 22)[0].shape, testing::HasSubstr("thermal_arm_growth"));
  EXPECT_THAT(beside("both", 60), SizeIs(2));
  EXPECT_THAT(beside("theta", 40), SizeIs(2));  // on another axis, and clearly there

  // An effect that moves the whole fibre leaves nothing that looks like an axis.
  std::vector<CauseFound> causes = {Cause("gravity_sag", "none", 92), Cause("wear", "phi", 22)};
  JudgeMisfitArtefacts(kUnits, &causes);
  EXPECT_THAT(causes, SizeIs(2));
  causes[1].axis = "none";
  JudgeMisfitArtefacts(kUnits, &causes);
  EXPECT_THAT(causes, SizeIs(1));
}

// The stop of a single unit explains little in the sum over all units' fibres.
TEST(Families, NoShapeLeavesMoreThanItIs) {
  const auto beside = [](double size_um) {
    std::vector<CauseFound> causes = {Cause("fibre_torque", "phi", 1000),
                                      Cause("hard_stop", "phi", 28)};
    causes[0].size_um = 7, causes[1].size_um = size_um;
    JudgeMisfitArtefacts(kUnits, &causes);
    return causes;
  };
  EXPECT_THAT(beside(3), SizeIs(1));
  EXPECT_THAT(beside(9), SizeIs(2));
}

TEST(Families, WhatIsFarBelowNoiseAndAStrongCauseIsThatOnesShape) {
  std::vector<CauseFound> causes = {Cause("base_offset", "none", 9000),
                                    Cause("gravity_sag", "none", 5000), Cause("wear", "theta", 90)};
  causes[0].size_um = 50;
  causes[1].size_um = 20;
  causes[2].size_um = 1;
  const auto cause_that_leaves = [&](const char* channel, double size_um, double noise_um) {
    const CauseFound* of =
        CauseThatLeaves({.channel = channel, .size_um = size_um}, noise_um, &causes);
    return of == nullptr ? "nobody" : of->cause;
  };
  EXPECT_EQ(cause_that_leaves("y", 0.8, 10), "gravity_sag");
  EXPECT_EQ(cause_that_leaves("y", 0.8, 2.5), "nobody");  // near the noise
  EXPECT_EQ(cause_that_leaves("y", 4, 60), "nobody");     // a large part of the strongest
  causes[1].axis = "theta";
  EXPECT_EQ(cause_that_leaves("theta angle", 0.8, 10), "gravity_sag");
  EXPECT_EQ(cause_that_leaves("phi angle", 0.8, 10), "nobody");
  causes[1].all_units = false;
  EXPECT_EQ(cause_that_leaves("theta angle", 0.8, 10), "nobody");
  causes.push_back(Cause("air_turbulence", "none", 900));
  causes.back().size_um = 4;
  EXPECT_EQ(cause_that_leaves("x", 0.8, 10), "air_turbulence");
  EXPECT_EQ(cause_that_leaves("phi angle", 0.8, 10), "nobody");
  ReportAsMisfitArtefact(0.8, "move order", &causes[1]);
  EXPECT_THAT(causes[1].shape, HasSubstr("0.8 um, looks like move order"));
}

TEST(Families, WhereAColumnIsMissingItsCauseIsACandidate) {
  std::vector<CauseFound> causes = {Cause("phase_imbalance", "phi", 300),
                                    Cause("backlash", "theta", 200)};
  JudgeUntested({{"cogging", "column drive_amplitude is missing"}}, &causes);
  EXPECT_THAT(causes[0].candidates, ElementsAre("phase_imbalance", "cogging"));
  EXPECT_THAT(causes[1].candidates, ElementsAre("backlash"));
  JudgeUntested({{"load_angle_lag", "column drive_amplitude is missing"}}, &causes);
  EXPECT_THAT(causes[1].candidates, ElementsAre("backlash", "load_angle_lag"));
  JudgeUntested({{"relaxation", "the moves never excite it"}}, &causes);
  EXPECT_THAT(causes[1].candidates, ElementsAre("backlash", "load_angle_lag"));
  JudgeUntested({{"relaxation", "column delay_s is missing"}}, &causes);
  EXPECT_THAT(causes[1].candidates, ElementsAre("backlash", "load_angle_lag", "relaxation"));
}

TEST(Families, TheOtherAxisIsAnotherMatter) {
  std::vector<CauseFound> causes = {Cause("backlash", "theta", 1000),
                                    Cause("friction_windup", "phi", 60)};
  JudgeMisfitArtefacts(kUnits, &causes);
  ASSERT_THAT(causes, SizeIs(2));
  EXPECT_THAT(causes[1].candidates, ElementsAre("friction_windup"));
}

TEST(Families, ACandidateOfTheStrongOneBesideItIsItsMisfitArtefact) {
  std::vector<CauseFound> causes = {Cause("phase_imbalance", "phi", 600, {"cogging"}),
                                    Cause("cogging", "phi", 120)};
  JudgeMisfitArtefacts(kUnits, &causes);
  EXPECT_THAT(causes, SizeIs(1));
}

TEST(Families, WhatAnythingCouldBeIsUnknownUnlessItIsAMisfitArtefact) {
  const std::vector<std::string> anything = {"a", "b", "c", "d", "e", "f", "g", "h"};
  std::vector<CauseFound> causes = {Cause("wear", "theta", 30, anything)};
  std::vector<UnknownFound> unknown;
  JudgeNames(&causes, &unknown);
  EXPECT_TRUE(causes.empty());
  ASSERT_THAT(unknown, SizeIs(1));
  EXPECT_EQ(unknown[0].covariate, "theta_cmd_deg");

  causes = {Cause("backlash", "theta", 2000), Cause("wear", "theta", 30, anything)};
  unknown.clear();
  JudgeNames(&causes, &unknown);
  EXPECT_THAT(causes, SizeIs(1));
  EXPECT_TRUE(unknown.empty());
}

TEST(Families, ABrokenToothShowsInItsUnit) {
  std::vector<UnknownFound> unknown;
  const auto judged = [&](std::size_t units, double evidence, bool all, double most = 2) {
    std::vector<CauseFound> causes = {Cause("tooth_damage", "theta", evidence)};
    causes[0].all_units = all;
    for (std::uint32_t unit = 0; unit < units; ++unit) {
      causes[0].units.push_back(unit);
      causes[0].evidence_of_unit[unit] = unit == 0 ? most : 1;
    }
    unknown.clear();
    JudgeNames(&causes, &unknown);
    return causes.size();
  };
  EXPECT_EQ(judged(25, 44, false), 0u);
  ASSERT_THAT(unknown, SizeIs(1));
  EXPECT_EQ(unknown[0].covariate, "theta_cmd_deg");
  EXPECT_EQ(judged(25, 120, false), 1u);
  EXPECT_EQ(judged(3, 11, false), 1u);
  EXPECT_EQ(judged(25, 44, true), 1u);
  EXPECT_EQ(judged(25, 44, false, 30), 1u);  // one of them shows
  EXPECT_TRUE(unknown.empty());
}

TEST(Families, WhatIsFaintBesideAMovingImageMayBeTheImages) {
  std::vector<CauseFound> causes = {Cause("camera_similarity", "none", 7000),
                                    Cause("self_heating", "both", 160),
                                    Cause("relaxation", "theta", 150)};
  causes[0].size_um = 17, causes[1].size_um = 0.5, causes[2].size_um = 2;
  causes[1].scope = causes[2].scope = "unit";
  JudgeMisfitArtefacts(kUnits, &causes);
  ASSERT_THAT(causes, SizeIs(3));
  EXPECT_THAT(causes[1].candidates, ElementsAre("self_heating", "camera_similarity"));
  EXPECT_THAT(causes[2].candidates, ElementsAre("relaxation"));
}

TEST(Families, AMovingImageHidesNeitherARelativeNorWhatIsPlain) {
  std::vector<CauseFound> causes = {
      Cause("camera_similarity", "none", 7000), Cause("backlash", "theta", 4000),
      Cause("hard_stop", "phi", 2500), Cause("load_angle_lag", "theta", 30)};
  causes[0].size_um = 60, causes[1].size_um = 20, causes[2].size_um = 2.5, causes[3].size_um = 1.5;
  for (std::size_t k = 1; k < causes.size(); ++k) causes[k].scope = "unit";
  JudgeMisfitArtefacts(kUnits, &causes);
  ASSERT_THAT(causes, SizeIs(3));
  EXPECT_THAT(causes[1].misfit_artefacts, ElementsAre("load_angle_lag"));
  EXPECT_THAT(causes[2].candidates, ElementsAre("hard_stop"));
}

TEST(Families, WhatFollowsAnAngleTakesThatAnglesNames) {
  // Slow waves; the teeth of the other axis are its own.
  std::vector<CauseFound> causes = {Cause("eccentricity", "theta", 90),
                                    Cause("backlash", "theta", 80),
                                    Cause("stage_ripple", "theta", 70)};
  std::vector<UnknownFound> unknown = {{"theta_cmd_deg", "phi angle", 0, 2, 300}};
  JudgeBesideUnknown(&causes, &unknown);
  ASSERT_THAT(causes, SizeIs(2));
  EXPECT_EQ(causes[0].cause, "backlash");
  EXPECT_EQ(causes[1].cause, "stage_ripple");
}

TEST(Families, WhereNoElevationIsReportedTheImageMayShiftByThePlate) {
  std::vector<CauseFound> causes = {Cause("camera_similarity", "none", 300)};
  JudgeUntested({{"gravity_sag", "column elevation_deg is missing"}}, &causes);
  EXPECT_THAT(causes[0].candidates, ElementsAre("camera_similarity", "gravity_sag"));
  causes = {Cause("camera_similarity", "none", 300)};
  causes[0].cannot_be = {"gravity_sag"};
  JudgeUntested({{"gravity_sag", "column elevation_deg is missing"}}, &causes);
  EXPECT_THAT(causes[0].candidates, ElementsAre("camera_similarity"));
}

TEST(Families, WhatIsHardlyThereBesideAStrongCauseOfAnyAxisIsItsMisfitArtefact) {
  const auto judged = [](double evidence, const char* strong_axis) {
    std::vector<CauseFound> causes = {Cause("load_angle_lag", strong_axis, 130),
                                      Cause("start_skew", "phi", evidence)};
    causes[1].units = {1, 2, 3}, causes[1].all_units = false;
    JudgeMisfitArtefacts(kUnits, &causes);
    return causes.size();
  };
  EXPECT_EQ(judged(11, "theta"), 1u);
  EXPECT_EQ(judged(40, "theta"), 2u);
  EXPECT_EQ(judged(11, "none"), 2u);
}

TEST(Families, WhatNearlyTheSameUnitsHaveBesideIsNotSure) {
  const auto judged = [](std::vector<std::uint32_t> units, std::size_t of = kUnits) {
    std::vector<CauseFound> causes = {Cause("gravity_torque", "theta", 500),
                                      Cause("camera_distortion", "none", 100)};
    causes[0].all_units = causes[1].all_units = false;
    causes[0].units = {1, 2, 3, 4, 5, 6}, causes[1].units = std::move(units);
    JudgeMisfitArtefacts(of, &causes);
    return causes.back().candidates.size();
  };
  EXPECT_EQ(judged({1, 2, 3, 4, 9}), 2u);
  EXPECT_EQ(judged({1, 2, 3, 8, 9}), 1u);
  EXPECT_EQ(judged({1, 2, 3, 4, 9}, 9), 1u);  // six units have the other: by accident
}

TEST(Families, WhoCannotBeTestedIsACandidateBesideItsLikeOverTheNight) {
  std::vector<CauseFound> causes = {Cause("thermal_backlash", "theta", 100),
                                    Cause("eccentricity", "phi", 90)};
  JudgeUntested({{"wear", "column cycles_theta is missing"}}, &causes);
  EXPECT_THAT(causes[0].candidates, SizeIs(1));
  JudgeUntested({{"supply_drift", "column v_bus_V is missing"}}, &causes);
  EXPECT_THAT(causes[0].candidates, ElementsAre("thermal_backlash", "supply_drift"));
  EXPECT_THAT(causes[1].candidates, SizeIs(1));
}

TEST(Families, ARotorThatIsTurnedFarIsEithersOfTwo) {
  CampaignModel model;
  model.units.resize(3);
  for (CampaignUnit& unit : model.units) unit.gear[kTheta] = 337, unit.gear[kPhi] = 893;
  std::vector<std::string> left_out;
  RotorCauses reported;
  const auto judged = [&](const char* name, double rotor_deg) {
    std::vector<CauseFound> causes = {Cause(name, "phi", 300)};
    causes[0].amplitude = -rotor_deg / 893;
    JudgeRotors(model, left_out, reported, &causes);
    return causes[0].candidates;
  };
  EXPECT_THAT(judged("cogging", 6), ElementsAre("cogging"));
  EXPECT_THAT(judged("cogging", 24), ElementsAre("cogging", "phase_imbalance"));
  EXPECT_THAT(judged("phase_imbalance", 30), ElementsAre("phase_imbalance", "cogging"));
  EXPECT_THAT(judged("stage_ripple", 30), ElementsAre("stage_ripple"));
  reported[kPhi] = "cogging";
  EXPECT_THAT(judged("cogging", 30), ElementsAre("cogging"));
  reported = {};
  left_out = {"cogging"};
  EXPECT_THAT(judged("phase_imbalance", 30), ElementsAre("phase_imbalance"));
}

TEST(Families, TheSecondOfTwoNamesOfARotorIsWhatTheFirstLeaves) {
  CampaignModel model;
  model.units.resize(3);
  for (CampaignUnit& unit : model.units) unit.gear[kTheta] = 893, unit.gear[kPhi] = 893;
  const auto judged = [&](double second_deg, double evidence, const char* axis) {
    std::vector<CauseFound> causes = {Cause("cogging", "phi", 2000),
                                      Cause("phase_imbalance", axis, evidence)};
    causes[0].amplitude = 10.0 / 893, causes[1].amplitude = second_deg / 893;
    JudgeRotors(model, {}, {}, &causes);
    return causes;
  };
  const std::vector<CauseFound> one = judged(24, 300, "phi");
  ASSERT_THAT(one, SizeIs(1));
  EXPECT_THAT(one[0].misfit_artefacts, ElementsAre("phase_imbalance"));
  EXPECT_THAT(judged(10, 300, "phi"), SizeIs(2));  // clearly not the first
  EXPECT_THAT(judged(20, 1000, "phi"), SizeIs(2));
  EXPECT_THAT(judged(20, 300, "theta"), SizeIs(2));
}

// Exact waves of some units' rotors are no evidence about those of others.
TEST(Families, ARotorsSecondNameInOtherUnitsIsNoMisfitArtefact) {
  CampaignModel model;
  model.units.resize(3);
  for (CampaignUnit& unit : model.units) unit.gear[kTheta] = 893, unit.gear[kPhi] = 893;
  RotorCauses reported;
  reported[kPhi] = "cogging";
  const auto judged = [&](std::uint32_t unit) {
    std::vector<CauseFound> causes = {Cause("cogging", "phi", 2000),
                                      Cause("phase_imbalance", "phi", 300)};
    causes[0].amplitude = causes[1].amplitude = 10.0 / 893;
    causes[0].evidence_of_unit = {{1, 2000}}, causes[1].evidence_of_unit = {{unit, 300}};
    JudgeRotors(model, {}, reported, &causes);
    return causes.size();
  };
  EXPECT_EQ(judged(1), 1u);
  EXPECT_EQ(judged(2), 2u);
}

TEST(Families, AScaleMayBeThePlatesWhereNoTemperatureIsReported) {
  std::vector<CauseFound> causes = {Cause("camera_similarity", "none", 300)};
  JudgeUntested({{"plate_expansion", "the temperature does not vary"}}, &causes);
  EXPECT_THAT(causes[0].candidates, SizeIs(1));
  JudgeUntested({{"plate_expansion", "column temp_C is missing"}}, &causes);
  EXPECT_THAT(causes[0].candidates, ElementsAre("camera_similarity", "plate_expansion"));
}

TEST(Families, WhatExplainsLessThanIsLeftOnItsAxisIsPartOfTheUnknown) {
  std::vector<CauseFound> causes = {Cause("backlash", "theta", 900), Cause("stiction", "phi", 90),
                                    Cause("tooth_damage", "theta", 60)};
  std::vector<UnknownFound> unknown = {{"theta_from_deg", "theta angle", 0, 2, 300}};
  JudgeBesideUnknown(&causes, &unknown);
  ASSERT_THAT(causes, SizeIs(2));
  EXPECT_EQ(causes[0].cause, "backlash");
  EXPECT_EQ(causes[1].cause, "stiction");
  EXPECT_DOUBLE_EQ(unknown[0].size_um, std::hypot(2, std::sqrt(60.0)));
}

TEST(Families, ASeriesOfAngleCausesOnOneAxisIsUnknown) {
  std::vector<CauseFound> causes = {Cause("eccentricity", "theta", 300),
                                    Cause("pinion_runout", "theta", 200),
                                    Cause("tooth_mesh", "theta", 100)};
  std::vector<UnknownFound> unknown;
  JudgeSeries(&causes, &unknown);
  ASSERT_THAT(unknown, SizeIs(1));
  EXPECT_EQ(unknown[0].covariate, "theta_cmd_deg");
  EXPECT_THAT(causes[0].candidates, Contains("tooth_mesh"));
}

}  // namespace
}  // namespace focalfleet::sim
