#include "daemon/page/plate_feed.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "fleet/hex_layout.h"

namespace focalfleet {
namespace {

using std::chrono::milliseconds;

constexpr milliseconds kPatience{30'000};  // limit for a hang; nothing is timed

class PlateFeedTest : public ::testing::Test {
 protected:
  static constexpr std::uint32_t kUnits = 60;

  PlateFeedTest() { Open(); }
  void Open() {
    feed_ = std::make_unique<PlateFeed>(
        PlateFeed::Options{.layout = &layout_, .viewers_max = 2, .pause = milliseconds(0)});
  }
  void Turn(double theta_deg) {
    StatusBatch batch;
    for (std::uint32_t n = 0; n < kUnits; ++n)
      batch.units.push_back({.unit = layout_.unit({n}).id,
                             .witness = {Witness::kPredicted, Witness::kPredicted},
                             .low_deg = {theta_deg, 90},
                             .high_deg = {theta_deg, 90},
                             .phase = UnitPhase::kMoving});
    batch.fleet = FleetStatusValue{.at = WallTime::Now(), .units = kUnits};
    feed_->Take(batch);
  }

  struct Reader {
    HttpStream stream;
    std::vector<PlateUnit> units;
    std::vector<PlateFrameKind> kinds;

    /// Reads until unit 0 stands there. False: a frame did not fit, or the feed has ended.
    bool ReadUntil(std::uint16_t theta) {
      while (units.empty() || units[0].theta != theta) {
        const auto piece = stream(kPatience);
        if (!piece) return false;
        if (*piece == nullptr) continue;
        const auto head = DecodeFrame(**piece, &units);
        if (!head) return false;
        kinds.push_back(head->kind);
      }
      return true;
    }
  };
  std::uint16_t CodeOf(double theta_deg) const {
    return AngleCode(theta_deg + layout_.unit({0}).theta().zero_deg);
  }

  Layout layout_ = Layout::Create(MakeHexLayout({.count = kUnits}), {}).value();
  std::unique_ptr<PlateFeed> feed_;
};

TEST_F(PlateFeedTest, AStreamBeginsWithASnapshotAndGoesOnByDeltas) {
  Turn(10);
  Reader reader{.stream = feed_->Join().value()};
  ASSERT_TRUE(reader.ReadUntil(CodeOf(10)));
  EXPECT_EQ(reader.kinds.front(), PlateFrameKind::kSnapshot);
  const std::size_t snapshots = reader.kinds.size();
  for (int k = 2; k < 20; ++k) {
    Turn(10 * k);
    ASSERT_TRUE(reader.ReadUntil(CodeOf(10 * k)));
  }
  EXPECT_EQ(std::ranges::count(reader.kinds.begin() + static_cast<std::ptrdiff_t>(snapshots),
                               reader.kinds.end(), PlateFrameKind::kSnapshot),
            0)
      << "a reader that keeps up gets deltas alone";
}

TEST_F(PlateFeedTest, AViewerThatReadsNothingHoldsUpNobodyAndThenSkipsToTheNewest) {
  Turn(1);
  Reader slow{.stream = feed_->Join().value()};
  Reader quick{.stream = feed_->Join().value()};
  ASSERT_TRUE(slow.ReadUntil(CodeOf(1)));
  for (int k = 2; k < 100; ++k) {
    Turn(k);
    ASSERT_TRUE(quick.ReadUntil(CodeOf(k)));
  }
  const std::size_t before = slow.kinds.size();
  ASSERT_TRUE(slow.ReadUntil(CodeOf(99)));
  EXPECT_EQ(slow.kinds.size(), before + 1) << "one frame, not a hundred";
  EXPECT_EQ(slow.kinds.back(), PlateFrameKind::kSnapshot);
  Turn(120);
  ASSERT_TRUE(slow.ReadUntil(CodeOf(120)));
  EXPECT_EQ(slow.units, quick.ReadUntil(CodeOf(120)) ? quick.units : slow.units);
}

TEST_F(PlateFeedTest, OneViewerMoreThanMayBeIsRefusedUntilAnotherLeaves) {
  auto first = feed_->Join();
  auto second = feed_->Join();
  ASSERT_TRUE(first && second);
  EXPECT_EQ(feed_->viewers(), 2u);
  const auto third = feed_->Join();
  ASSERT_FALSE(third);
  EXPECT_EQ(third.error().code, ErrorCode::kFull);
  EXPECT_THAT(third.error().text, ::testing::HasSubstr("all 2 places"));
  *first = {};  // the connection is gone
  EXPECT_EQ(feed_->viewers(), 1u);
  EXPECT_TRUE(feed_->Join());
}

TEST_F(PlateFeedTest, StreamsEndWithTheFeedAndMayOutliveIt) {
  Reader reader{.stream = feed_->Join().value()};
  feed_.reset();
  EXPECT_FALSE(reader.stream(kPatience).has_value());
}

TEST_F(PlateFeedTest, SignsOfLifeComeWithoutAnyStatus) {
  Reader reader{.stream = feed_->Join().value()};
  for (int frames = 0; frames < 2;) {
    const auto piece = reader.stream(kPatience);
    ASSERT_TRUE(piece);
    if (*piece == nullptr) continue;
    const auto head = DecodeFrame(**piece, &reader.units);
    ASSERT_TRUE(head);
    EXPECT_EQ(head->status.ns, 0) << "no status yet";
    ++frames;
  }
}

}  // namespace
}  // namespace focalfleet
