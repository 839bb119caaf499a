// Tails of the distributions that names are judged by are compared with sums by hand.
#include "sim/campaigns/diagnosis/score/chances.h"

#include <gtest/gtest.h>

#include <cmath>

namespace focalfleet::sim {
namespace {

TEST(Chances, BinomialTailsAreSumsOverTheirTerms) {
  EXPECT_NEAR(BinomialTail(4, 5, 0.5), 6.0 / 32, 1e-12);
  EXPECT_NEAR(BinomialTail(3, 3, 0.2), 0.008, 1e-12);
  EXPECT_NEAR(BinomialTail(1, 300, 0.01), 1 - std::pow(0.99, 300), 1e-12);
  EXPECT_NEAR(BinomialTail(0, 7, 0.3), 1, 1e-12);
  EXPECT_EQ(BinomialTail(2, 7, 1), 1);
  EXPECT_EQ(BinomialTail(1, 7, 0), 0);
}

TEST(Chances, WaysToChooseAreCounted) {
  EXPECT_NEAR(LogChoose(6, 2), std::log(15), 1e-12);
  EXPECT_NEAR(LogChoose(9, 0), 0, 1e-12);
}

}  // namespace
}  // namespace focalfleet::sim
