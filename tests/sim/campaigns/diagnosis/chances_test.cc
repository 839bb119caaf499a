// Numbers of chance that names are judged by are compared with those by hand.
#include "sim/campaigns/diagnosis/model/chances.h"

#include <gtest/gtest.h>

#include <cmath>

namespace focalfleet::sim {
namespace {

TEST(Chances, WaysToChooseAreCounted) {
  EXPECT_NEAR(LogChoose(6, 2), std::log(15), 1e-12);
  EXPECT_NEAR(LogChoose(9, 0), 0, 1e-12);
}

TEST(Chances, TheMiddleOfAnEvenNumberLiesBetweenTwo) {
  EXPECT_NEAR(MiddleOf({4, 1, 3, 2}), 2.5, 1e-12);
  EXPECT_NEAR(MiddleOf({3, 1, 2}), 2, 1e-12);
  EXPECT_NEAR(MiddleOf({5}), 5, 1e-12);
}

}  // namespace
}  // namespace focalfleet::sim
