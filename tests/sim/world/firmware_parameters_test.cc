// The parameters that a unit keeps in FLASH and the readings of its sensors, as requests read and
// write them.
#include <gtest/gtest.h>

#include <array>
#include <span>

#include "protocol/base/limits.h"
#include "tests/sim/world/firmware_rig.h"

namespace focalfleet::sim {
namespace {

using test::FirmwareRig;
using test::kBenchMax;
using test::kBenchMin;

TEST(Firmware, KeepsParametersWithinTheirBounds) {
  FirmwareRig rig;
  const auto write = [&](Parameter parameter, std::int32_t value) {
    return *rig.Ask<ParameterReply>(ParameterWrite{Axis::kTheta, parameter, value});
  };
  struct Bound {
    Parameter parameter;
    std::int32_t low, high;
  };
  for (const Bound& b :
       {Bound{Parameter::kCounter1, 50, 20'000}, Bound{Parameter::kRepeat, 1, 255},
        Bound{Parameter::kMode, 0, 2}, Bound{Parameter::kHostTimeoutMs, 100, 3'600'000},
        Bound{Parameter::kMinPosition, -limits::kPositionMax, kBenchMax},
        Bound{Parameter::kHomePosition, kBenchMin, kBenchMax}}) {
    SCOPED_TRACE(Name(b.parameter));
    const std::int32_t was =
        rig.Ask<ParameterReply>(ParameterRead{Axis::kTheta, b.parameter})->value;
    for (const std::int32_t value : {b.low, b.high}) {
      EXPECT_EQ(write(b.parameter, value).answer, Answer::kOk);
      EXPECT_EQ(rig.Ask<ParameterReply>(ParameterRead{Axis::kTheta, b.parameter})->value, value);
    }
    for (const std::int32_t value : {b.low - 1, b.high + 1, INT32_MIN, INT32_MAX}) {
      EXPECT_EQ(write(b.parameter, value).answer, Answer::kBadValue);
      EXPECT_EQ(write(b.parameter, value).value, b.high);
    }
    EXPECT_EQ(write(b.parameter, was).answer, Answer::kOk);
  }
  for (const std::int32_t bad : {0, 5, 97, 1542, -96, INT32_MAX})
    EXPECT_EQ(write(Parameter::kSubdivision, bad).answer, Answer::kBadValue);
}

TEST(Firmware, AnotherSubdivisionKeepsAllAngles) {
  FirmwareRig rig;
  const double before_deg = rig.AngleDeg(Axis::kPhi);
  ASSERT_EQ(
      rig.Ask<ParameterReply>(ParameterWrite{Axis::kPhi, Parameter::kSubdivision, 48})->answer,
      Answer::kOk);
  EXPECT_EQ(rig.flash().axis[1].position(), 480);
  EXPECT_EQ(rig.flash().axis[1].max_position, kBenchMax / 2);
  EXPECT_NEAR(rig.AngleDeg(Axis::kPhi), before_deg, 0.1);
}

TEST(Firmware, APositionIsSetOnlyToPlacesThatShowTheAppliedVector) {
  FirmwareRig rig;
  const auto reply =
      rig.Ask<ParameterReply>(ParameterWrite{Axis::kTheta, Parameter::kPosition, 1000});
  EXPECT_EQ(reply->answer, Answer::kOk);
  EXPECT_EQ(reply->value, 960);  // the vector is 0: 960 is ten turns, 1000 is not whole
  EXPECT_NEAR(rig.AngleDeg(Axis::kTheta), 0, 1e-9) << "the shaft turned";
}

/// A joint whose sensors show the number of the reading.
class CountingJoint final : public JointSensors {
 public:
  void Read(UnitId unit, std::uint32_t reading, const FibreCarrierTip& tip,
            std::span<std::uint16_t> counts) const override {
    EXPECT_EQ(unit.value, 77u);
    EXPECT_EQ(tip.length_mm, 30);
    for (std::size_t k = 0; k < counts.size(); ++k)
      counts[k] = static_cast<std::uint16_t>(100 * (reading + 1) + k);
  }
};

TEST(FirmwareSensors, TellsOneReadingInPartsUntilItIsAskedForTheFirstAgain) {
  const CountingJoint magnets;
  const Mechanism mechanism{};
  FirmwareRig rig(1, {UnitId{77}, 6, 30, &mechanism, &magnets});
  EXPECT_EQ(rig.Ask<IdentifyReply>(IdentifyRequest{})->protocol_version, 2);
  const auto part = [&](std::uint8_t number) {
    const auto reply = rig.Ask<SensorsReply>(SensorsRequest{number});
    EXPECT_EQ(reply->part, number);
    return reply->counts;
  };
  using Counts = std::array<std::uint16_t, kSensorsPerPart>;
  EXPECT_EQ(part(1), (Counts{104, 105, kNoCount, kNoCount})) << "nothing was read before";
  EXPECT_EQ(part(0), (Counts{200, 201, 202, 203}));
  EXPECT_EQ(part(1), (Counts{204, 205, kNoCount, kNoCount})) << "the rest of the same reading";
  EXPECT_EQ(part(3), (Counts{kNoCount, kNoCount, kNoCount, kNoCount}));
  EXPECT_EQ(part(0), (Counts{300, 301, 302, 303}));
}

TEST(FirmwareSensors, ABoardWithoutAnySpeaksVersion1AndDropsTheFrame) {
  FirmwareRig rig;
  EXPECT_EQ(rig.Ask<IdentifyReply>(IdentifyRequest{})->protocol_version, 1);
  const std::uint64_t malformed = rig.firmware().malformed();
  EXPECT_TRUE(rig.Give(SensorsRequest{0}).empty());
  EXPECT_EQ(rig.firmware().malformed(), malformed + 1);
}

}  // namespace
}  // namespace focalfleet::sim
