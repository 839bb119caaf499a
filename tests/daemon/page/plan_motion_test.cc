#include "daemon/page/plan_motion.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "fleet/hex_layout.h"
#include "fleet/kinematics.h"

namespace focalfleet {
namespace {

template <class Value>
Value At(const std::string& bytes, std::size_t offset) {
  Value value{};
  EXPECT_LE(offset + sizeof value, bytes.size());
  std::memcpy(&value, bytes.data() + offset, sizeof value);
  return value;
}
double RealAt(const std::string& bytes, std::size_t offset) {
  return double{At<float>(bytes, offset)};
}

class PlanMotion : public ::testing::Test {
 protected:
  /// Unit 4 turns theta by 300 vectors, rests, and turns 200 back; phi by 50.
  PlanMotion() {
    UnitPlan move{.unit = {4}, .from = {1000, 500}, .to = {1100, 550}};
    move.path[0].Append({.start_ticks = 0, .delta = 300, .repeat = 108});
    move.path[0].Append({.start_ticks = 20'000, .delta = -200, .repeat = 108});
    move.path[1].Append({.start_ticks = 5000, .delta = 50, .repeat = 108});
    plan_.moves.push_back(move);
  }

  Layout layout_ = Layout::Create(MakeHexLayout({.count = 20}), {}).value();
  std::vector<UnitDrive> drives_ = std::vector<UnitDrive>(layout_.size());
  Plan plan_;
};

TEST_F(PlanMotion, HasTheRowsOfThePlanToTheLastByte) {
  const std::string bytes = EncodeMotion(plan_, layout_, drives_);
  ASSERT_EQ(bytes.size(), 16u + 16u + 3u * 12u);
  EXPECT_EQ(At<std::uint32_t>(bytes, 0), bytes.size() - 4);
  EXPECT_EQ(At<std::uint8_t>(bytes, 4), 1u);
  EXPECT_EQ(At<std::uint32_t>(bytes, 8), 1u);
  EXPECT_EQ(At<std::uint32_t>(bytes, 16), 4u);
  EXPECT_EQ(At<std::uint8_t>(bytes, 28), 2u);
  EXPECT_EQ(At<std::uint8_t>(bytes, 29), 1u);
  const double vector_s = SecondsPerVector(drives_[4].axis[0]);
  EXPECT_NEAR(RealAt(bytes, 32), 0, 1e-6);
  EXPECT_NEAR(RealAt(bytes, 36), 300 * vector_s, 1e-5);
  EXPECT_NEAR(RealAt(bytes, 44), 2.0, 1e-6);
  EXPECT_NEAR(RealAt(bytes, 48), 2.0 + 200 * vector_s, 1e-5);
  EXPECT_NEAR(RealAt(bytes, 56), 0.5, 1e-6);
  EXPECT_NEAR(RealAt(bytes, 12), EndOf(plan_.moves[0], drives_[4]), 1e-5);
}

TEST_F(PlanMotion, ItsEndIsWhereThePlanPutsTheFibre) {
  const std::string bytes = EncodeMotion(plan_, layout_, drives_);
  const double theta = RealAt(bytes, 20) + RealAt(bytes, 40) + RealAt(bytes, 52);
  const double both = theta + RealAt(bytes, 24) + RealAt(bytes, 64);
  const Unit& unit = layout_.unit({4});
  const PointFp fibre = FibreAt(unit, drives_[4], plan_.moves[0].to);
  EXPECT_NEAR(unit.base_fp.x_mm + unit.theta().arm_mm * std::cos(theta) +
                  unit.phi().arm_mm * std::cos(both),
              fibre.x_mm, 1e-4);
  EXPECT_NEAR(unit.base_fp.y_mm + unit.theta().arm_mm * std::sin(theta) +
                  unit.phi().arm_mm * std::sin(both),
              fibre.y_mm, 1e-4);
}

TEST_F(PlanMotion, APlanWithoutMovesIsAHeadAlone) {
  const std::string bytes = EncodeMotion(Plan{}, layout_, drives_);
  EXPECT_EQ(bytes.size(), 16u);
  EXPECT_EQ(At<std::uint32_t>(bytes, 8), 0u);
}

TEST_F(PlanMotion, TheLargestPlanThatAWireCarriesIsAsLongAsItsHeaderSays) {
  Plan most;
  for (std::uint32_t n = 0; n < layout_.size(); ++n) {
    UnitPlan move{.unit = {n}};
    for (AxisPath& path : move.path)
      for (std::uint32_t k = 0; k < limits::kSegmentsPerAxis; ++k)
        path.Append({.start_ticks = 1000 * k, .delta = 1, .repeat = 108});
    most.moves.push_back(move);
  }
  const std::size_t unit_bytes = 16 + 2 * limits::kSegmentsPerAxis * 12;
  EXPECT_EQ(EncodeMotion(most, layout_, drives_).size(), 16 + layout_.size() * unit_bytes);
  EXPECT_LT(limits::kUnits * unit_bytes, std::size_t{13} << 20);
}

}  // namespace
}  // namespace focalfleet
