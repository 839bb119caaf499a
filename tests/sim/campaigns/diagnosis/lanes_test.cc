// Columns side by side give the same result as each alone.
#include "sim/campaigns/diagnosis/model/lanes.h"

#include "sim/campaigns/diagnosis/model/fit.h"
#include "sim/campaigns/diagnosis/model/neighbour_sum.h"
#include "sim/campaigns/effects/registry.h"
#include "tests/sim/campaigns/planting/planted_campaign.h"

namespace focalfleet::sim {
namespace {

using test::Planted;
using test::StaticFit;

TEST(Lanes, EachIsWhitenedAsIfItWereAlone) {
  const Campaign campaign = Planted({}, {.units = 7, .rest_noise_deg = 0.03});
  const CampaignFacts facts = MakeFacts(campaign);
  const Fit fit = StaticFit(facts);
  const WhiteUnit white = Whiten(fit, 2);
  // Effects of an angle, of arms, of the place.
  for (const char* cause : {"backlash", "thermal_arm_growth", "axis_tilt"}) {
    const Template form = ListTemplates(*FindEffect(cause), facts).front();
    PoseErrors errors;
    ApplyColumn(white.track, form, 0, 1, &errors);
    std::vector<double> alone(2 * white.moves.size());
    WhiteDisplacement(white, errors, alone.data());
    std::vector<Lanes> rows(alone.size());
    for (const std::size_t lane : {0u, 5u}) PutDisplacement(white, errors, lane, rows.data());
    WhitenLanes(white.filter, white.turn_um.data(), rows.data(), rows.data());
    for (std::size_t r = 0; r < alone.size(); ++r) {
      EXPECT_EQ(rows[r].at[0], alone[r]) << cause;
      EXPECT_EQ(rows[r].at[5], alone[r]) << cause;
      EXPECT_EQ(rows[r].at[1], 0) << cause;
    }
  }
}

TEST(Lanes, ColumnsAreTakenOffEach) {
  const Eigen::MatrixXd columns = Eigen::MatrixXd::Random(40, 3).householderQr().householderQ() *
                                  Eigen::MatrixXd::Identity(40, 3);
  std::vector<Lanes> rows(40), left(40), parts(3);
  const Eigen::MatrixXd plain = Eigen::MatrixXd::Random(40, kLanes);
  for (Eigen::Index r = 0; r < 40; ++r)
    for (std::size_t j = 0; j < kLanes; ++j)
      rows[static_cast<std::size_t>(r)].at[j] = plain(r, static_cast<Eigen::Index>(j));
  MultiplyLanes(columns, rows.data(), parts.data());
  SubtractColumns(columns, parts.data(), rows.data(), left.data());
  const Eigen::MatrixXd wanted = plain - columns * (columns.transpose() * plain);
  for (Eigen::Index r = 0; r < 40; ++r)
    for (std::size_t j = 0; j < kLanes; ++j)
      EXPECT_NEAR(left[static_cast<std::size_t>(r)].at[j], wanted(r, static_cast<Eigen::Index>(j)),
                  1e-14);
}

TEST(Lanes, BlocksAreMultipliedLaneByLane) {
  const Eigen::MatrixXd plain = Eigen::MatrixXd::Random(30, 2 * kLanes);
  std::vector<Lanes> a(30), b(30);
  for (Eigen::Index r = 0; r < 30; ++r)
    for (std::size_t j = 0; j < kLanes; ++j) {
      a[static_cast<std::size_t>(r)].at[j] = plain(r, static_cast<Eigen::Index>(j));
      b[static_cast<std::size_t>(r)].at[j] = plain(r, static_cast<Eigen::Index>(kLanes + j));
    }
  const Eigen::MatrixXd wanted = plain.leftCols(kLanes).transpose() * plain.rightCols(kLanes);
  const LaneProducts products = MultiplyBlocks(a.data(), b.data(), a.size());
  for (std::size_t i = 0; i < kLanes; ++i)
    for (std::size_t j = 0; j < kLanes; ++j)
      EXPECT_NEAR(products[i].at[j],
                  wanted(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)), 1e-13);
}

TEST(Lanes, AlikeNeighboursSumAsInOneColumn) {
  constexpr std::size_t kMoves = 40;
  Rng rng = Rng::Stream(5, "alike");
  std::vector<Lanes> b(kMoves), g(kMoves);
  Lanes own;
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    own.at[lane] = rng.Uniform(-1, 1);
    for (std::size_t k = 0; k < kMoves; ++k)
      b[k].at[lane] = rng.Normal(), g[k].at[lane] = rng.Uniform(0, 2);
  }
  const Lanes sums = SumAlikeNeighbours(b.data(), g.data(), own, kMoves);
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    using Sum = NeighbourSum<1>;
    Sum sum(Sum::Square::Constant(1));
    for (std::size_t k = 0; k < kMoves; ++k)
      sum.Add(Sum::Small::Constant(b[k].at[lane] - g[k].at[lane] * own.at[lane]));
    EXPECT_NEAR(sums.at[lane], sum.sum(), 1e-12 * (1 + sum.sum())) << lane;
  }
}

}  // namespace
}  // namespace focalfleet::sim
