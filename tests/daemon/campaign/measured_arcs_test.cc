// The moves are a real positioner's arcs of one length each, from the hard stop. The diagnosis
// finds what is wrong with the positioner, and reports as undecided what these moves cannot
// separate.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>
#include <string>

#include "daemon/campaign/campaign_files.h"
#include "daemon/files/text_file.h"
#include "sim/campaigns/diagnosis/decide/diagnosis.h"
#include "sim/campaigns/diagnosis/design/next_moves.h"

namespace focalfleet {
namespace {

using testing::Contains;
using testing::IsSupersetOf;

sim::Campaign Measured(const std::string& arcs) {
  const std::string folder = FOCALFLEET_MEASURED_MOVES "/" + arcs;
  const std::string moves = ReadTextFile(folder + "/moves.csv").value();
  const std::string units = ReadTextFile(folder + "/units.csv").value();
  return ReadCampaign({.moves = moves, .units = units}).value();
}

struct Arcs {
  const char* folder;
  const char* axis;
  double left;  // at most; share of the rms before, over arcs that no fit has seen
};

class MeasuredArcs : public testing::TestWithParam<Arcs> {};

TEST_P(MeasuredArcs, TheStrongCauseIsFoundWithTheRivalThatMovesOfOneLengthLeaveIt) {
  const sim::Campaign campaign = Measured(GetParam().folder);
  const sim::Diagnosis diagnosis = sim::Diagnose(campaign, {});
  ASSERT_FALSE(diagnosis.causes.empty());
  const sim::CauseFound& first = diagnosis.causes.front();
  EXPECT_THAT(first.candidates, IsSupersetOf({"gear_scale", "ramp_travel"}));
  EXPECT_TRUE(first.axis == GetParam().axis || first.axis == "both") << first.axis;
  // Arcs of one length still differ among each other by something that no column shows.
  EXPECT_NE(diagnosis.verdict, sim::Verdict::kExplained);
  EXPECT_LT(diagnosis.gain.rms_after_um, GetParam().left * diagnosis.gain.rms_before_um);
  EXPECT_LT(diagnosis.gain.mad_after_um, GetParam().left * diagnosis.gain.mad_before_um);

  // The chosen moves separate these two models, whichever pair they were chosen for.
  double apart = 0;
  for (const sim::Prospect& pair : diagnosis.next.prospects) {
    const std::set<std::string> names = {pair.cause, pair.rival};
    if (names == std::set<std::string>{"gear_scale", "ramp_travel"}) apart = pair.d;
  }
  EXPECT_LT(sim::ConfusionAt(apart), 1e-3);
}

INSTANTIATE_TEST_SUITE_P(Real, MeasuredArcs,
                         testing::Values(Arcs{"theta-arcs-may", "theta", 0.06},
                                         Arcs{"phi-arcs-may", "phi", 0.3}),
                         [](const auto& arcs) { return std::string(arcs.param.axis); });

}  // namespace
}  // namespace focalfleet
