#include "daemon/page/plate_frame.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "fleet/hex_layout.h"
#include "protocol/base/rng.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

constexpr std::size_t kAngleBytes = 4;
constexpr std::size_t kHeadBytes = 44;

PlateUnit AnyUnit(Rng* rng) {
  const auto code = [&] { return static_cast<std::uint16_t>(rng->Below(65'536)); };
  const auto octet = [&] { return static_cast<std::uint8_t>(rng->Below(256)); };
  return {code(), code(), code(), code(), code(), octet(), octet(), octet(), octet()};
}

std::vector<PlateUnit> AnyUnits(std::size_t count, Rng* rng) {
  std::vector<PlateUnit> units(count);
  for (PlateUnit& unit : units) unit = AnyUnit(rng);
  return units;
}

/// Some units turn, some change otherwise, some stay.
void Change(Rng* rng, std::vector<PlateUnit>* units) {
  const std::uint64_t share = rng->Below(101);
  for (PlateUnit& unit : *units) {
    if (rng->Below(100) >= share) continue;
    const PlateUnit other = AnyUnit(rng);
    if (rng->Below(4) == 0) {
      unit = other;
    } else {
      unit.theta = other.theta;
      unit.phi = other.phi;
    }
  }
}

TEST(PlateFrame, ASnapshotComesBackWhole) {
  const std::uint64_t seed = test::TestSeed(1);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  for (const std::size_t count :
       {std::size_t{0}, std::size_t{1}, std::size_t{8}, std::size_t{9}, std::size_t{1000}}) {
    const auto units = AnyUnits(count, &rng);
    const PlateFrameHead head{.kind = PlateFrameKind::kSnapshot,
                              .number = 7,
                              .made = {1'700'000'000'000'000'000},
                              .status = {1'700'000'000'000'000'000 - 2'000'000},
                              .facts = "{}"};
    std::vector<PlateUnit> read(3);
    const auto back = DecodeFrame(EncodeSnapshot(head, units), &read);
    ASSERT_TRUE(back) << back.error().text;
    EXPECT_EQ(read, units);
    EXPECT_EQ(back->number, 7u);
    EXPECT_EQ(back->facts, "{}");
    // Milliseconds in a double are good to a quarter of a microsecond.
    EXPECT_NEAR(static_cast<double>(back->made.ns - head.made.ns), 0, 1000);
    EXPECT_NEAR(static_cast<double>(back->status.ns - head.status.ns), 0, 1000);
  }
}

TEST(PlateFrame, DeltasLeadWhereTheSnapshotIs) {
  for (std::uint64_t seed = test::TestSeed(1); seed < test::TestSeed(1) + 30; ++seed) {
    FOCALFLEET_TRACE_SEED(seed);
    Rng rng(seed);
    auto units = AnyUnits(1 + rng.Below(300), &rng);
    std::vector<PlateUnit> read = units;
    for (std::uint32_t number = 1; number < 20; ++number) {
      const auto before = units;
      Change(&rng, &units);
      const auto head = DecodeFrame(
          EncodeDelta({.kind = PlateFrameKind::kDelta, .number = number}, before, units), &read);
      ASSERT_TRUE(head) << head.error().text;
      ASSERT_EQ(read, units);
    }
  }
}

TEST(PlateFrame, AUnitThatTurnsCostsItsAnglesAlone) {
  Rng rng(3);
  const auto before = AnyUnits(800, &rng);
  auto units = before;
  for (std::size_t i = 0; i < 80; ++i) units[10 * i].theta ^= 1u;
  const PlateFrameHead head{.kind = PlateFrameKind::kDelta, .number = 1};
  EXPECT_EQ(EncodeDelta(head, before, units).size(), kHeadBytes + 800 / 8 + 80 * kAngleBytes);
  EXPECT_EQ(EncodeDelta(head, before, before).size(), kHeadBytes);
  for (PlateUnit& unit : units) unit.phi ^= 1u;
  EXPECT_EQ(EncodeDelta(head, before, units).size(), kHeadBytes + 800 * kAngleBytes)
      << "all units need no bits";
}

TEST(PlateFrame, NoBytesAreTakenForAFrame) {
  const std::uint64_t seed = test::TestSeed(5);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  const auto before = AnyUnits(50, &rng);
  auto units = before;
  Change(&rng, &units);
  units[0].phase ^= 1u;
  const std::string frame =
      EncodeDelta({.kind = PlateFrameKind::kDelta, .number = 2, .facts = "{}"}, before, units);
  for (std::size_t length = 0; length < frame.size(); ++length) {
    std::vector<PlateUnit> read = before;
    EXPECT_FALSE(DecodeFrame(frame.substr(0, length), &read)) << length;
  }
  for (int k = 0; k < 2000; ++k) {  // any bytes: an answer, or an error
    std::string bent = frame;
    bent[rng.Below(bent.size())] = static_cast<char>(rng.Below(256));
    std::vector<PlateUnit> read = before;
    static_cast<void>(DecodeFrame(bent, &read));
    EXPECT_LE(read.size(), 50u);
  }
  std::vector<PlateUnit> others(49);
  EXPECT_FALSE(DecodeFrame(frame, &others)) << "a delta onto other units";
}

TEST(PlateFrame, AnglesAreKeptToAThousandthOfATurn) {
  EXPECT_EQ(AngleCode(kNoNumber), kNoCode);
  EXPECT_EQ(AngleCode(0), 0u);
  EXPECT_EQ(AngleCode(360), 0u);
  EXPECT_EQ(AngleCode(-360), 0u);
  EXPECT_EQ(AngleCode(359.9999), 0u) << "the nearest step, never the code of no angle";
  for (double angle_deg = -720; angle_deg < 720; angle_deg += 7.3) {
    const double back_deg = AngleCode(angle_deg) * 360.0 / kTurnSteps;
    EXPECT_NEAR(std::remainder(back_deg - angle_deg, 360), 0, 0.0028) << angle_deg;
  }
}

class PlateEncoderTest : public ::testing::Test {
 protected:
  static Layout MakeLayout() { return Layout::Create(MakeHexLayout({.count = 60}), {}).value(); }
  StatusBatch Batch(std::uint32_t place, double theta_deg) {
    UnitStatusValue unit{.unit = layout_.unit({place}).id,
                         .witness = {Witness::kPredicted, Witness::kPredicted},
                         .low_deg = {theta_deg, 90},
                         .high_deg = {theta_deg, 90},
                         .phase = UnitPhase::kMoving};
    StatusBatch batch;
    batch.units.push_back(unit);
    batch.fleet = FleetStatusValue{.at = now_, .units = 60};
    return batch;
  }
  /// The next frame, onto what was read before; none where there is none.
  std::optional<PlateFrameHead> Next(std::int64_t ms_later) {
    now_.ns += ms_later * 1'000'000;
    const std::string frame = encoder_.Next(table_, now_);
    if (frame.empty()) return std::nullopt;
    return DecodeFrame(frame, &read_).value();
  }

  Layout layout_ = MakeLayout();
  WallTime now_{1'700'000'000'000'000'000};
  PlateTable table_{&layout_};
  PlateEncoder encoder_{60};
  std::vector<PlateUnit> read_ = std::vector<PlateUnit>(60);
};

TEST_F(PlateEncoderTest, FramesAreNumberedAndLeadToTheTable) {
  for (std::uint32_t k = 1; k < 50; ++k) {
    table_.Take(Batch(k, 5.0 * k));
    const auto head = Next(100);
    ASSERT_TRUE(head);
    EXPECT_EQ(head->number, k);
    ASSERT_EQ(read_, table_.units());
  }
  std::vector<PlateUnit> other;
  const auto snapshot = DecodeFrame(encoder_.Snapshot(now_), &other);
  ASSERT_TRUE(snapshot);
  EXPECT_EQ(snapshot->number, encoder_.number());
  EXPECT_EQ(other, table_.units());
  EXPECT_FALSE(snapshot->facts.empty());
}

TEST_F(PlateEncoderTest, NothingNewIsAFrameASecond) {
  table_.Take(Batch(1, 10));
  ASSERT_TRUE(Next(0));
  EXPECT_FALSE(Next(900));
  const auto alive = Next(100);
  ASSERT_TRUE(alive);
  EXPECT_EQ(alive->made, now_);
  EXPECT_LT(alive->status, now_) << "the age of the data grows";
  EXPECT_FALSE(Next(999));
  EXPECT_TRUE(Next(1));
}

TEST_F(PlateEncoderTest, ASignOfLifeComesAlsoWhereTheClockIsSetBack) {
  table_.Take(Batch(1, 10));
  ASSERT_TRUE(Next(0));
  EXPECT_TRUE(Next(-3'600'000));
}

TEST_F(PlateEncoderTest, FactsComeOnceASecondOrAtOnceWhereTheyMatter) {
  table_.Take(Batch(1, 10));
  EXPECT_FALSE(Next(0)->facts.empty());
  table_.Take(Batch(1, 20));
  EXPECT_TRUE(Next(100)->facts.empty());
  table_.NoteAlarm();
  EXPECT_FALSE(Next(100)->facts.empty()) << "an alarm is not waited for";
  StatusBatch batch = Batch(1, 30);
  batch.configuration = ConfigurationProgressValue{};
  batch.configuration->view.id = 5;
  table_.Take(batch);
  EXPECT_THAT(Next(100)->facts, ::testing::HasSubstr("\"id\":5"));
}

}  // namespace
}  // namespace focalfleet
