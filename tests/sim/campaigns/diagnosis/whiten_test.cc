// Rest errors that an axis keeps until it moves leave no trace once they are whitened.
#include "sim/campaigns/diagnosis/model/whiten.h"

#include <cmath>

#include "sim/campaigns/diagnosis/model/fit.h"
#include "tests/sim/campaigns/planting/planted_campaign.h"

namespace focalfleet::sim {
namespace {

using test::Planted;
using test::StaticFit;

struct Moments {
  double square = 0, next = 0, count = 0;
};

Moments MomentsOf(const Fit& fit, bool whitened) {
  Moments m;
  for (std::size_t unit = 0; unit < fit.model.units.size(); ++unit) {
    const WhiteUnit white = Whiten(fit, unit);
    std::vector<double> y(white.y.data(), white.y.data() + white.y.size());
    if (!whitened)
      for (std::size_t k = 0; k < white.moves.size(); ++k) {
        const std::size_t row = white.track.first_row + white.moves[k];
        y[2 * k] = fit.x_um[row], y[2 * k + 1] = fit.y_um[row];
      }
    for (std::size_t i = 0; i + 2 < y.size(); ++i)
      m.square += y[i] * y[i], m.next += y[i] * y[i + 2], m.count += 1;
  }
  return m;
}

TEST(Whiten, HeldRestErrorsBecomeIndependentNumbersOfUnitVariance) {
  // Rest errors are well above the camera's noise, and many moves are of one axis, in which the
  // other keeps its own.
  const Campaign campaign =
      Planted({}, {.units = 40, .moves = 120, .seed = 11, .noise_um = 1, .rest_noise_deg = 0.03});
  const CampaignFacts facts = MakeFacts(campaign);
  const Fit fit = StaticFit(facts);
  const Moments plain = MomentsOf(fit, false), white = MomentsOf(fit, true);
  EXPECT_GT(plain.next / plain.square, 0.1) << "the planted noise does not keep";
  EXPECT_NEAR(white.next / white.square, 0, 4 / std::sqrt(white.count));
  EXPECT_NEAR(white.square / white.count, 1, 0.1);
}

TEST(NegativeBic, IsNotDecidedByOutliers) {
  // Noise that is two per cent smaller explains the other rows about as well; outliers cost next to
  // nothing more.
  const Campaign campaign =
      Planted({}, {.units = 24, .moves = 80, .seed = 6, .outlier_share = 0.02});
  const CampaignFacts facts = MakeFacts(campaign);
  const Fit fit = StaticFit(facts);
  Fit smaller = fit;
  smaller.noise.place_um *= 0.98;
  for (const std::size_t axis : {kTheta, kPhi}) {
    smaller.noise.rest_deg[axis] *= 0.98;
    smaller.noise.angle_deg[axis] *= 0.98;
  }
  UpdateWeights(&smaller);
  EXPECT_NEAR(NegativeBic(smaller), NegativeBic(fit), 50);
}

}  // namespace
}  // namespace focalfleet::sim
