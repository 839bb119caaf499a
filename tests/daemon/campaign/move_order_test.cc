#include "daemon/campaign/move_order.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace focalfleet {
namespace {

using ::testing::ElementsAre;

const double kNoTime = std::nan("");

TEST(MoveOrder, IsByUnitThenByTimeThenByNumber) {
  const MoveOrder order = OrderMoves({{1, 9, 10}, {0, 1, 30}, {1, 2, 20}, {0, 3, 5}, {0, 2, 5}});
  EXPECT_THAT(order.rows, ElementsAre(4, 3, 1, 0, 2));
  EXPECT_EQ(order.out_of_order, 2u);  // moves 3 and 2 of unit 0, behind move 1
}

TEST(MoveOrder, OfRowsThatStandInItIsKept) {
  const MoveOrder order = OrderMoves({{1, 5, 0}, {0, 1, 0}, {1, 6, 0}, {0, 2, 1}});
  EXPECT_THAT(order.rows, ElementsAre(1, 3, 0, 2));
  EXPECT_EQ(order.out_of_order, 0u);
}

TEST(MoveOrder, OfARowWithoutTimeIsThatOfItsExposure) {
  // Move 7 was made between moves 2 and 3, as the rows of unit 0 show.
  const MoveOrder order =
      OrderMoves({{0, 7, 25}, {1, 2, 20}, {1, 3, 30}, {1, 7, kNoTime}, {0, 8, 26}});
  EXPECT_THAT(order.rows, ElementsAre(0, 4, 1, 3, 2));
  EXPECT_EQ(order.out_of_order, 1u);
}

TEST(MoveOrder, OfAnExposureWithoutTimeIsThatOfTheMoveBefore) {
  const MoveOrder order =
      OrderMoves({{0, 4, kNoTime}, {0, 1, kNoTime}, {0, 3, 10}, {0, 2, 30}, {0, 5, 40}});
  EXPECT_THAT(order.rows, ElementsAre(1, 2, 0, 3, 4));
}

TEST(MoveOrder, OfNothingIsNothing) {
  EXPECT_THAT(OrderMoves({}).rows, ElementsAre());
  EXPECT_THAT(OrderMoves({{0, 3, kNoTime}, {0, 1, kNoTime}}).rows, ElementsAre(1, 0));
}

}  // namespace
}  // namespace focalfleet
