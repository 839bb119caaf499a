#include "daemon/loop/sync_pulse.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

namespace focalfleet {
namespace {

using ::testing::HasSubstr;

struct Recorded {
  std::vector<bool> levels;
  bool broken = false;
};
class RecordingLine : public SyncLine {
 public:
  explicit RecordingLine(Recorded* recorded) : recorded_(*recorded) {}
  Status Set(bool active) override {
    if (recorded_.broken) return Fail(ErrorCode::kUnavailable, "recorder: broken");
    recorded_.levels.push_back(active);
    return {};
  }
  [[nodiscard]] const std::string& name() const override { return name_; }

 private:
  Recorded& recorded_;
  std::string name_ = "recorder";
};

constexpr HostInstant kStart{Seconds(20).ns};

TEST(SyncPulse, IsActiveFromTheStartOnForItsWidth) {
  Recorded line;
  SyncPulse pulse(std::make_unique<RecordingLine>(&line), {});
  EXPECT_EQ(pulse.wake_at(), kNever);
  EXPECT_EQ(pulse.Serve(kStart - Seconds(1)), "");
  pulse.Plan(kStart);
  EXPECT_EQ(pulse.wake_at(), kStart);
  EXPECT_EQ(pulse.Serve(kStart - DurationNs{1}), "");
  EXPECT_TRUE(line.levels.empty());
  EXPECT_EQ(pulse.Serve(kStart + Microseconds(40)), "");
  EXPECT_EQ(line.levels, std::vector<bool>{true});
  EXPECT_EQ(pulse.wake_at(), kStart + Microseconds(10'040));
  EXPECT_EQ(pulse.Serve(pulse.wake_at()), "");
  EXPECT_EQ(line.levels, (std::vector<bool>{true, false}));
  EXPECT_EQ(pulse.wake_at(), kNever);
  EXPECT_EQ(pulse.pulses(), 1u);
  EXPECT_EQ(pulse.missed(), 0u);
}

TEST(SyncPulse, IsLeftOutWhereUnitsHaveBegunByThemselves) {
  Recorded line;
  SyncPulse pulse(std::make_unique<RecordingLine>(&line), {});
  pulse.Plan(kStart);
  EXPECT_THAT(pulse.Serve(kStart + Microseconds(5001)), HasSubstr("5001 us ago"));
  EXPECT_TRUE(line.levels.empty());
  EXPECT_EQ(pulse.wake_at(), kNever);
  EXPECT_EQ(pulse.missed(), 1u);
}

TEST(SyncPulse, ReportsALineThatFails) {
  Recorded line;
  line.broken = true;
  SyncPulse pulse(std::make_unique<RecordingLine>(&line), {});
  pulse.Plan(kStart);
  EXPECT_EQ(pulse.Serve(kStart), "recorder: broken");
  EXPECT_EQ(pulse.missed(), 1u);
  EXPECT_EQ(pulse.wake_at(), kNever);
}

}  // namespace
}  // namespace focalfleet
