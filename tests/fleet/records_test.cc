#include "fleet/records.h"

#include <gtest/gtest.h>

namespace focalfleet {
namespace {

UnitDrive After(Axis axis, Parameter parameter, std::int32_t value) {
  UnitDrive drive;
  TakeParameter({{7}, axis, parameter, value, Origin::kTuning}, &drive);
  return drive;
}

TEST(TakeParameter, SetsTheAxisThatTheRowNamesAndTheModeOfTheUnit) {
  EXPECT_EQ(After(Axis::kPhi, Parameter::kRepeat, 54).axis[1].repeat, 54);
  EXPECT_EQ(After(Axis::kPhi, Parameter::kRepeat, 54).axis[0], AxisDrive{});
  EXPECT_EQ(After(Axis::kTheta, Parameter::kCounter1, 250).axis[0].counter1, 250);
  EXPECT_EQ(After(Axis::kTheta, Parameter::kSubdivision, 48).axis[0].subdivision, 48);
  EXPECT_EQ(After(Axis::kTheta, Parameter::kMode, 2).mode, WaveMode::kSevenSegment);
}

TEST(TakeParameter, LeavesTheDriveWhereTheValueFitsNoDrive) {
  for (const std::int32_t value : {0, -1, 256, 1'000'000})
    EXPECT_EQ(After(Axis::kTheta, Parameter::kRepeat, value).axis[0].repeat, AxisDrive{}.repeat);
  for (const std::int32_t value : {-1, 3})
    EXPECT_EQ(After(Axis::kTheta, Parameter::kMode, value).mode, UnitDrive{}.mode);
  EXPECT_EQ(After(Axis::kTheta, Parameter::kPosition, 5).axis[0], AxisDrive{});
}

}  // namespace
}  // namespace focalfleet
