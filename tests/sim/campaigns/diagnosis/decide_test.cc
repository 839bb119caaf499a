#include "sim/campaigns/diagnosis/decide.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "sim/campaigns/effects/other_causes.h"

namespace focalfleet::sim {
namespace {

using testing::ElementsAre;

constexpr double kAlone = 5.5 / 193;  // of a name where nothing is unknown

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

TEST(Decide, GivesTheVerdict) {
  CauseFound ambiguous = NameOf(5);
  ambiguous.candidates.push_back("stiction");
  EXPECT_EQ(Found({}, {}).verdict, Verdict::kConsistent);
  EXPECT_EQ(Found({NameOf(5)}, {}).verdict, Verdict::kExplained);
  EXPECT_EQ(Found({NameOf(5), ambiguous}, {}).verdict, Verdict::kAmbiguous);
  EXPECT_EQ(Found({}, {{.size_um = 1}}).verdict, Verdict::kUnknown);
}

}  // namespace
}  // namespace focalfleet::sim
