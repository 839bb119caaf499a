// Moves that are proposed to tell causes apart, held against what they do.
#include "sim/diagnosis/next_moves.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "tests/sim/diagnosis/planted_campaign.h"

namespace focalfleet::sim {
namespace {

using testing::Each;
using testing::Field;
using testing::Gt;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;

// Theta there and back in steps of one length, by all units at once: what an arc over the range
// shows, and nothing else.
Campaign Arcs(double step_deg, std::vector<PlantedEffect> effects, std::uint64_t seed) {
  PlantedOptions options{.units = 6, .moves = 2, .seed = seed, .noise_um = 2};
  const Campaign first = Planted({}, options);
  std::vector<ProposedMove> moves;
  for (int k = 0; k < 48; ++k) {
    const int of_arc = k % 16;
    const int at = of_arc < 8 ? of_arc : 16 - of_arc;
    moves.push_back({.theta_fp_deg = -60 + step_deg * at, .phi_fp_deg = 80});
  }
  options.next = SpreadOver(first.units, moves);
  return Planted(std::move(effects), options);
}

const CauseFound* Find(const Diagnosis& diagnosis, std::string_view cause) {
  const auto found = std::ranges::find(diagnosis.causes, cause, &CauseFound::cause);
  return found == diagnosis.causes.end() ? nullptr : &*found;
}

bool AsksForADrive(const ProposedMove& move) { return move.conditions.drive_amplitude != 1; }
bool IsShort(const ProposedMove& a, const ProposedMove& b) {
  const double theta = std::abs(a.theta_fp_deg - b.theta_fp_deg);
  return theta > 0 && theta < 5;
}

TEST(NextMoves, ConfusionIsHowFarTwoTracesStandApart) {
  EXPECT_DOUBLE_EQ(ConfusionAt(0), 0.5);
  EXPECT_NEAR(ConfusionAt(10.8), 0.05, 5e-4);
  EXPECT_NEAR(ConfusionAt(21.6), 0.01, 2e-4);
  EXPECT_NEAR(ConfusionAt(38), 0.001, 1e-4);
}

// A travel that is lost at each move is a share of the travel as long as all moves are alike.
TEST(NextMoves, ShortMovesTellAConstantTravelFromAScale) {
  const Campaign campaign =
      Arcs(15, {{.cause = "ramp_travel", .amplitude = 0.05, .axis = "theta"}}, 3);
  const Diagnosis before = Diagnose(campaign, {.with_gain = false});
  ASSERT_THAT(before.next.prospects, Not(IsEmpty()));
  ASSERT_THAT(before.next.moves, Not(IsEmpty()));
  EXPECT_LE(before.next.moves.size(), kNextMovesMax);
  EXPECT_THAT(before.next.prospects, Each(Field(&Prospect::d_then, Gt(20.0))));
  bool has_short = false;
  for (std::size_t m = 1; m < before.next.moves.size(); ++m)
    has_short = has_short || IsShort(before.next.moves[m], before.next.moves[m - 1]);
  EXPECT_TRUE(has_short);
  EXPECT_THAT(before.next.moves, Each(Field(&ProposedMove::separates, HasSubstr(" | "))));
}

TEST(NextMoves, MadeAndMeasuredTheyDecide) {
  for (const std::uint64_t seed : {11u, 12u, 13u}) {
    const std::vector<PlantedEffect> effects = {
        {.cause = "ramp_travel", .amplitude = 0.05, .axis = "theta"}};
    PlantedOptions options{.units = 6, .moves = 10, .seed = seed, .noise_um = 3};
    const Campaign few = Planted(effects, options);
    const Diagnosis before = Diagnose(few, {.with_gain = false});
    if (before.next.moves.empty()) continue;  // these few moves decide already
    options.next = SpreadOver(few.units, before.next.moves);
    const Campaign more = Planted(effects, options);
    ASSERT_EQ(more.rows(), few.rows() + few.units.size() * before.next.moves.size());
    const Diagnosis after = Diagnose(more, {.with_gain = false, .with_next_moves = false});
    const CauseFound* found = Find(after, "ramp_travel");
    ASSERT_NE(found, nullptr) << "seed " << seed;
    EXPECT_THAT(found->candidates, SizeIs(1)) << "seed " << seed;
  }
}

// Play and the lag of a loaded rotor are one at one drive.
TEST(NextMoves, AskForTheDriveWhereOnlyItDecides) {
  Campaign campaign = Planted({{.cause = "backlash", .amplitude = 0.2, .axis = "theta"}},
                              {.units = 6, .moves = 60, .seed = 5});
  std::erase_if(campaign.covariates,
                [](const Covariate& column) { return column.name == "drive_amplitude"; });
  const Diagnosis diagnosis = Diagnose(campaign, {.with_gain = false});
  const CauseFound* play = Find(diagnosis, "backlash");
  ASSERT_NE(play, nullptr);
  ASSERT_THAT(play->candidates, testing::Contains("load_angle_lag"));
  EXPECT_TRUE(std::ranges::any_of(diagnosis.next.moves, AsksForADrive));
}

TEST(NextMoves, ThereAreNoneWhereNothingIsConfusable) {
  const Diagnosis diagnosis =
      Diagnose(Planted({{.cause = "eccentricity", .amplitude = 0.1, .axis = "theta"}},
                       {.moves = 60, .seed = 7}),
               {.with_gain = false});
  ASSERT_EQ(diagnosis.verdict, Verdict::kExplained);
  EXPECT_THAT(diagnosis.next.moves, IsEmpty());
  EXPECT_THAT(diagnosis.next.prospects, IsEmpty());
}

TEST(Ahead, AUnitGoesWhereItIsSentAndStaysWhereItIsNot) {
  const Campaign made = Planted({}, {.units = 8, .moves = 10, .seed = 2});
  const std::vector<ProposedMove> moves = {
      {.theta_fp_deg = 0, .phi_fp_deg = 90},
      {.theta_fp_deg = 30, .phi_fp_deg = 90, .every = 4, .conditions = {.drive_amplitude = 0.6}},
      {.theta_fp_deg = 0, .phi_fp_deg = 90, .conditions = {.delay_s = 30, .home_first = true}}};
  const Campaign ahead = Ahead(made, SpreadOver(made.units, moves));
  ASSERT_TRUE(Validate(ahead));
  std::size_t sent = 0;
  for (std::size_t u = 0; u < ahead.units.size(); ++u) {
    const std::size_t end = ahead.first_row[u + 1];
    ASSERT_EQ(end - ahead.first_row[u], 13u);
    for (std::size_t row = end - 3; row < end; ++row) {
      EXPECT_EQ(ahead.from_deg[kTheta][row], ahead.cmd_deg[kTheta][row - 1]);
      EXPECT_EQ(ahead.from_deg[kPhi][row], ahead.cmd_deg[kPhi][row - 1]);
    }
    sent += ahead.cmd_deg[kTheta][end - 2] == 30 ? 1 : 0;
    EXPECT_EQ(ahead.Find("drive_amplitude")[end - 2], 0.6);
    EXPECT_EQ(ahead.Find("movers_on_rail")[end - 2], 2);
    EXPECT_EQ(ahead.Find("movers_on_rail")[end - 1], 8);
    EXPECT_EQ(ahead.Find("rehomed")[end - 1], 1);
    EXPECT_EQ(ahead.Find("temp_C")[end - 1], ahead.Find("temp_C")[end - 4]);
    EXPECT_GT(ahead.Find("t_s")[end - 1], ahead.Find("t_s")[end - 2] + 30);
  }
  EXPECT_EQ(sent, 2u);
}

TEST(Ahead, AnglesStayClearOfTheEndsWhateverTheZero) {
  CampaignUnit unit = Planted({}, {.units = 1, .moves = 2}).units[0];
  for (const double zero : {-725.0, -170.0, 0.0, 33.0, 200.0}) {
    unit.zero_deg[kTheta] = zero;
    for (const double stance : {-150.0, -40.0, 0.0, 120.0}) {
      const auto spread = SpreadOver({unit}, {{.theta_fp_deg = stance, .phi_fp_deg = 200}});
      const auto& to = spread.at(0).to_deg.at(0);
      ASSERT_TRUE(to);
      EXPECT_GE((*to)[kTheta], unit.min_deg[kTheta] + 3);
      EXPECT_LE((*to)[kTheta], unit.max_deg[kTheta] - 3);
      EXPECT_EQ((*to)[kPhi], unit.max_deg[kPhi] - 3);
      const double off = std::remainder((*to)[kTheta] + zero - stance, 360);
      EXPECT_LT(std::abs(off), 10) << zero << " " << stance;  // 380 degrees less two margins
    }
  }
}

}  // namespace
}  // namespace focalfleet::sim
