#include "fleet/camera/assignment.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "protocol/base/rng.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

// An independent count: every word of (units) letters over (spots + none), without those that give
// a spot twice. Odds of several reasons for one spot add up.
struct Exact {
  int units = 0;
  int spots = 0;
  std::map<std::pair<int, int>, double> odds;

  [[nodiscard]] std::map<std::pair<int, int>, double> Marginals() const {
    std::map<std::pair<int, int>, double> sum;
    double total = 0;
    long words = 1;
    for (int u = 0; u < units; ++u) words *= spots + 1;
    for (long word = 0; word < words; ++word) {
      long rest = word;
      double weight = 1;
      std::vector<int> letters;
      std::vector<int> uses(static_cast<std::size_t>(spots), 0);
      for (int u = 0; u < units; ++u, rest /= spots + 1) {
        const int spot = static_cast<int>(rest % (spots + 1));
        letters.push_back(spot);
        if (spot == spots) continue;
        const auto found = odds.find({u, spot});
        weight *= found == odds.end() ? 0 : found->second;
        if (++uses[static_cast<std::size_t>(spot)] > 1) weight = 0;
      }
      total += weight;
      for (int u = 0; u < units; ++u) sum[{u, letters[static_cast<std::size_t>(u)]}] += weight;
    }
    for (auto& [key, value] : sum) value /= total;
    return sum;
  }
};

TEST(Assign, ProbabilitiesAreThoseOfCountingEverything) {
  const std::uint64_t seed = test::TestSeed(11);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  for (int round = 0; round < 300; ++round) {
    Exact exact{1 + static_cast<int>(rng.Below(5)), 1 + static_cast<int>(rng.Below(4)), {}};
    std::vector<Claim> claims;
    for (int u = 0; u < exact.units; ++u)
      for (int s = 0; s < exact.spots; ++s)
        for (int reasons = static_cast<int>(rng.Below(3)); reasons > 0; --reasons) {
          const double log_odds = rng.Uniform(-3, 15);
          exact.odds[{u, s}] += std::exp(log_odds);
          claims.push_back({static_cast<std::uint32_t>(u), static_cast<std::uint32_t>(s),
                            reasons == 1 ? PlaceKind::kExpected : PlaceKind::kBefore, log_odds});
        }
    const auto marginals = exact.Marginals();
    for (const Decision& decision : Assign(claims)) {
      const int u = static_cast<int>(decision.unit);
      const int s = decision.spot == kNoSpot ? exact.spots : static_cast<int>(decision.spot);
      double best = 0;
      for (int any = 0; any <= exact.spots; ++any)
        if (const auto m = marginals.find({u, any}); m != marginals.end())
          best = std::max(best, m->second);
      EXPECT_NEAR(1 - decision.doubt, best, 1e-9);
      EXPECT_NEAR(marginals.at({u, s}), best, 1e-9);
    }
  }
}

TEST(Assign, OneUnitOneSpotIsItsOdds) {
  const auto decisions = Assign({{4, 9, PlaceKind::kBefore, std::log(99.0)}});
  ASSERT_EQ(decisions.size(), 1u);
  EXPECT_EQ(decisions[0].unit, 4u);
  EXPECT_EQ(decisions[0].spot, 9u);
  EXPECT_EQ(decisions[0].kind, PlaceKind::kBefore);
  EXPECT_NEAR(decisions[0].doubt, 0.01, 1e-12);
}

TEST(Assign, TwoEqualClaimsOnOneSpotAreUndecided) {
  const auto decisions =
      Assign({{1, 5, PlaceKind::kExpected, 20}, {2, 5, PlaceKind::kExpected, 20}});
  for (const Decision& decision : decisions) EXPECT_NEAR(decision.doubt, 0.5, 1e-6);
}

TEST(Assign, WhatHangsTogetherTooWidelyIsNotCounted) {
  std::vector<Claim> claims;
  for (std::uint32_t unit = 0; unit < 8; ++unit)
    for (std::uint32_t spot = 0; spot < 8; ++spot)
      claims.push_back({unit, spot, PlaceKind::kExpected, 10});
  const auto decisions = Assign(claims);
  ASSERT_EQ(decisions.size(), 8u);
  for (const Decision& decision : decisions) {
    EXPECT_TRUE(decision.too_large);
    EXPECT_EQ(decision.spot, kNoSpot);
    EXPECT_EQ(decision.doubt, 1);
  }
}

}  // namespace
}  // namespace focalfleet
