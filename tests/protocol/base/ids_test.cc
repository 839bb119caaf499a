#include "protocol/base/ids.h"

#include <gtest/gtest.h>

#include <type_traits>
#include <unordered_set>

#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

TEST(Ids, DoNotMixAndDoNotCalculate) {
  static_assert(!std::is_convertible_v<UnitId, PositionerIndex>);
  static_assert(!std::is_convertible_v<int, UnitId>);
  static_assert(!std::is_convertible_v<UnitId, std::uint32_t>);
  static_assert(sizeof(UnitId) == sizeof(std::uint32_t));
  static_assert(sizeof(NodeId) == 1);
}

TEST(Ids, CompareAndHashByValue) {
  EXPECT_EQ(UnitId{3}, UnitId{3});
  EXPECT_LT(UnitId{3}, UnitId{4});
  std::unordered_set<UnitId> set;
  for (std::uint32_t i = 0; i < 1000; ++i) set.insert({i % 100});
  EXPECT_EQ(set.size(), 100u);
}

TEST(Ids, NoUnitCanHaveTheBroadcastAddress) {
  EXPECT_EQ(kBroadcastNode.value, 255);
  EXPECT_LT(limits::kNodesPerBus, 255u);
}

TEST(Ids, AxesAreThetaThenPhi) {
  EXPECT_EQ(Index(Axis::kTheta), 0u);
  EXPECT_EQ(Index(Axis::kPhi), 1u);
  EXPECT_EQ(std::size(kAxes), kAxisCount);
}

}  // namespace
}  // namespace focalfleet
