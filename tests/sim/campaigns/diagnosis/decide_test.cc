#include "sim/campaigns/diagnosis/decide/decide.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "sim/campaigns/effects/other_causes.h"

namespace focalfleet::sim {
namespace {

using testing::ElementsAre;

constexpr double kAlone = 13.5 / 286;  // where nothing is unknown

CauseFound NameOf(double size_um) {
  CauseFound cause = CauseNamed("backlash");
  cause.size_um = size_um;
  return cause;
}

Diagnosis Found(std::vector<CauseFound> causes, std::vector<UnknownFound> unknown) {
  Diagnosis diagnosis;
  diagnosis.causes = std::move(causes);
  diagnosis.unknown = std::move(unknown);
  Decide(&diagnosis);
  return diagnosis;
}

TEST(Decide, DoubtGrowsWithTheSizeOfWhatIsUnknown) {
  const auto doubt = [](double name_um, std::vector<UnknownFound> unknown) {
    return DoubtOf(NameOf(name_um), unknown);
  };
  EXPECT_DOUBLE_EQ(doubt(10, {}), kAlone);
  EXPECT_DOUBLE_EQ(doubt(10, {{.size_um = 10}}), 1 - (1 - kAlone) * 0.5);
  EXPECT_DOUBLE_EQ(doubt(30, {{.size_um = 10}}), 1 - (1 - kAlone) * 0.75);
  EXPECT_DOUBLE_EQ(doubt(30, {{.size_um = 6}, {.size_um = 8}}), 1 - (1 - kAlone) * 0.75);
  EXPECT_GT(doubt(1, {{.size_um = 1e3}}), 0.99);
}

TEST(Decide, NoStructureCastsDoubtOnWhatItCannotBe) {
  const std::vector<UnknownFound> large = {{.size_um = 1e3}};
  EXPECT_DOUBLE_EQ(DoubtOf(CauseNamed(kZeroOffset), large), 0);
  EXPECT_DOUBLE_EQ(DoubtOf(NameOf(1), {{{.size_um = 1e3, .casts_doubt = false}}}), kAlone);
}

TEST(Decide, ACurveThatDoesAsWellIsADoubt) {
  const auto doubt = [](double log_odds_of_curve) {
    CauseFound cause = NameOf(10);
    cause.log_odds["unknown"] = log_odds_of_curve;
    return DoubtOf(cause, {});
  };
  EXPECT_DOUBLE_EQ(doubt(0), 1 - (1 - kAlone) / 2);
  EXPECT_NEAR(doubt(-kTemperature * std::log(9)), 1 - (1 - kAlone) * 0.9, 1e-12);
  EXPECT_NEAR(doubt(-1e4), kAlone, 1e-12);
}

TEST(Decide, AnAmplitudeAsLargeAsPhysicsAllowsIsADoubt) {
  const auto doubt = [](double share) {
    CauseFound cause = NameOf(10);
    cause.bound_share = share;
    return DoubtOf(cause, {});
  };
  EXPECT_DOUBLE_EQ(doubt(1), 1 - (1 - kAlone) / 2);
  EXPECT_DOUBLE_EQ(doubt(0.1), 1 - (1 - kAlone) * 0.95);
}

TEST(Decide, ANameThatMayBePartOfAStructureHasUnknownAsACandidate) {
  const Diagnosis diagnosis = Found({NameOf(50), NameOf(2)}, {{.size_um = 2}});
  EXPECT_EQ(diagnosis.verdict, Verdict::kUnknown);
  EXPECT_THAT(diagnosis.causes[0].candidates, ElementsAre("backlash"));
  ASSERT_THAT(diagnosis.causes[1].candidates, ElementsAre("backlash", "unknown"));
  const std::vector<double> posterior = PosteriorOf(diagnosis.causes[1]);
  EXPECT_NEAR(posterior[0], (1 - kAlone) / 2, 1e-12);
  EXPECT_NEAR(posterior[0] + posterior[1], 1, 1e-12);
}

TEST(Decide, RivalsShareWhatTheDoubtLeaves) {
  CauseFound cause = NameOf(2);
  cause.candidates.push_back("stiction");
  const Diagnosis diagnosis = Found({cause}, {{.size_um = 2}});
  ASSERT_THAT(diagnosis.causes[0].candidates, ElementsAre("backlash", "stiction", "unknown"));
  const std::vector<double> posterior = PosteriorOf(diagnosis.causes[0]);
  EXPECT_DOUBLE_EQ(posterior[0], posterior[1]);
  EXPECT_DOUBLE_EQ(posterior[2], diagnosis.causes[0].doubt);
  EXPECT_NEAR(posterior[0] + posterior[1] + posterior[2], 1, 1e-12);
}

// Evidence supposes exact shapes and noise, and is too sure by a factor.
TEST(Decide, EvidenceBetweenRivalsCountsLessThanItSays) {
  CauseFound cause = NameOf(2);
  cause.candidates.push_back("stiction");
  cause.log_odds["stiction"] = -2.3;
  const std::vector<double> posterior = PosteriorOf(Found({cause}, {}).causes[0]);
  EXPECT_NEAR(posterior[1] / posterior[0], std::exp(-1), 1e-12);
}

TEST(Decide, ANameOfTheSizeOfAnothersDiscrepancyMayBeItsMisfit) {
  const auto candidates = [](double size_um, const char* axis) {
    CauseFound strong = NameOf(100), weak = CauseNamed("stiction");
    strong.axis = "phi", weak.axis = axis, weak.size_um = size_um;
    return Found({strong, weak}, {}).causes[1].candidates.size();
  };
  EXPECT_EQ(candidates(8, "phi"), 2u);  // one sigma of 8 %
  EXPECT_EQ(candidates(30, "phi"), 1u);
  EXPECT_EQ(candidates(8, "both"), 2u);
  EXPECT_EQ(candidates(8, "theta"), 1u);
  EXPECT_EQ(candidates(8, "none"), 1u);
}

TEST(Decide, WhatAnythingCouldBeIsUnknown) {
  const auto decided = [](int rivals) {
    CauseFound cause = NameOf(5);
    cause.axis = "phi";
    for (int k = 0; k < rivals; ++k) cause.candidates.push_back("rival" + std::to_string(k));
    return Found({cause}, {});
  };
  EXPECT_EQ(decided(6).causes.size(), 1u);
  const Diagnosis diagnosis = decided(7);
  EXPECT_TRUE(diagnosis.causes.empty());
  ASSERT_EQ(diagnosis.unknown.size(), 1u);
  EXPECT_EQ(diagnosis.unknown[0].channel, "phi: what 8 causes could be");
  EXPECT_EQ(diagnosis.unknown[0].size_um, 5);
  EXPECT_EQ(diagnosis.verdict, Verdict::kUnknown);
}

TEST(Decide, GivesTheVerdict) {
  CauseFound ambiguous = NameOf(5);
  ambiguous.candidates.push_back("stiction");
  EXPECT_EQ(Found({}, {}).verdict, Verdict::kConsistent);
  EXPECT_EQ(Found({NameOf(5)}, {}).verdict, Verdict::kExplained);
  EXPECT_EQ(Found({NameOf(5), ambiguous}, {}).verdict, Verdict::kAmbiguous);
  EXPECT_EQ(Found({}, {{.size_um = 1}}).verdict, Verdict::kUnknown);
}

std::vector<std::string> CandidatesBeside(std::string_view cause, const char* untested,
                                          const char* why,
                                          std::vector<std::string> cannot_be = {}) {
  std::vector<CauseFound> causes = {CauseNamed(cause)};
  causes[0].cannot_be = std::move(cannot_be);
  AddUntested({{untested, why}}, &causes);
  return causes[0].candidates;
}

TEST(Decide, WhereAColumnIsMissingItsCauseIsACandidateOfWhatItPassesFor) {
  constexpr const char* kNoDrive = "column drive_amplitude is missing";
  EXPECT_THAT(CandidatesBeside("phase_imbalance", "cogging", kNoDrive),
              ElementsAre("phase_imbalance", "cogging"));
  EXPECT_THAT(CandidatesBeside("backlash", "cogging", kNoDrive), ElementsAre("backlash"));
  EXPECT_THAT(CandidatesBeside("camera_similarity", "plate_expansion", "column temp_C is missing"),
              ElementsAre("camera_similarity", "plate_expansion"));
  EXPECT_THAT(CandidatesBeside("camera_similarity", "plate_expansion", "the moves never excite it"),
              ElementsAre("camera_similarity"));
  EXPECT_THAT(CandidatesBeside("camera_similarity", "gravity_sag",
                               "column elevation_deg is missing", {"gravity_sag"}),
              ElementsAre("camera_similarity"));
}

TEST(Decide, WhatTurnsItsSignWithTheMovePassesForItsLikeWithoutItsColumn) {
  constexpr const char* kNoDelay = "column delay_s is missing";
  for (const char* named : {"backlash", "load_angle_lag", "supply_droop", "thermal_backlash"})
    EXPECT_THAT(CandidatesBeside(named, "relaxation", kNoDelay), ElementsAre(named, "relaxation"));
  EXPECT_THAT(CandidatesBeside("eccentricity", "relaxation", kNoDelay),
              ElementsAre("eccentricity"));
  EXPECT_THAT(CandidatesBeside("backlash", "wear", "column cycles_theta is missing"),
              ElementsAre("backlash"));
}

}  // namespace
}  // namespace focalfleet::sim
