#include "daemon/loop/bus_lines.h"

#include <gtest/gtest.h>

#include "protocol/base/limits.h"
#include "protocol/wire/codec.h"

namespace focalfleet {
namespace {

struct FakePort : PollablePort {
  std::size_t Send(std::span<const CanFrame> frames) override {
    const std::size_t taken = std::min(room, frames.size());
    sent += taken;
    return taken;
  }
  void Receive(HostInstant, std::vector<ReceivedFrame>* out) override {
    ++received;
    out->resize(out->size() + gives);
  }
  [[nodiscard]] LinkState state() const override { return link; }
  [[nodiscard]] int fd() const override { return -1; }
  [[nodiscard]] HostInstant wake_at() const override { return wake; }
  [[nodiscard]] DurationNs retry_full() const override { return kRetryFull; }
  [[nodiscard]] const PortCounters& counters() const override { return none; }
  [[nodiscard]] const std::string& name() const override { return text; }
  [[nodiscard]] const std::string& trouble() const override { return text; }

  std::size_t room = 1000;
  std::size_t sent = 0;
  int received = 0;
  std::size_t gives = 0;  // frames in each Receive
  LinkState link = LinkState::kUp;
  HostInstant wake = kNever;
  PortCounters none;
  std::string text;
};

class BusLinesTest : public ::testing::Test {
 protected:
  BusLinesTest() {
    std::vector<std::unique_ptr<PollablePort>> ports;
    for (FakePort*& fake : fakes_) {
      auto port = std::make_unique<FakePort>();
      fake = port.get();
      ports.push_back(std::move(port));
    }
    lines_ = std::make_unique<BusLines>(std::vector<BusId>{{2}, {5}}, std::move(ports));
  }
  void Receive(std::int64_t ns) {
    links_.clear();
    lines_->Receive(HostInstant{ns}, &frames_, &links_);
  }

  std::array<FakePort*, 2> fakes_{};
  std::unique_ptr<BusLines> lines_;
  std::vector<ReceivedFrame> frames_;
  std::vector<LinkEvent> links_;
  const HostClock clock_;
  const CanFrame frame_ = Encode(HostMessage(IdentifyRequest{}), {NodeId{1}, 1});
};

TEST_F(BusLinesTest, ReportsEveryLinkAtFirstAndThenOnlyChanges) {
  Receive(1);
  EXPECT_EQ(links_.size(), 2u);
  Receive(2);
  EXPECT_TRUE(links_.empty());
  fakes_[1]->link = LinkState::kPassive;
  Receive(3);
  ASSERT_EQ(links_.size(), 1u);
  EXPECT_EQ(links_[0].bus, BusId{5});
  EXPECT_EQ(links_[0].state, LinkState::kPassive);
}

TEST_F(BusLinesTest, ReportsAnotherTroubleOfALinkThatIsUp) {
  Receive(1);
  fakes_[0]->text = "the controller warns of errors";
  Receive(2);
  ASSERT_EQ(links_.size(), 1u);
  EXPECT_EQ(links_[0].state, LinkState::kUp);
  EXPECT_EQ(links_[0].cause, "the controller warns of errors");
  Receive(3);
  EXPECT_TRUE(links_.empty()) << "once";
  fakes_[0]->text.clear();
  Receive(4);
  EXPECT_TRUE(links_.empty()) << "an end of trouble is no trouble";
  fakes_[0]->link = LinkState::kDown;
  fakes_[0]->text = "unplugged";
  Receive(5);
  ASSERT_EQ(links_.size(), 1u);
  EXPECT_EQ(links_[0].cause, "unplugged");
  fakes_[0]->text = "not there";
  Receive(6);
  EXPECT_TRUE(links_.empty()) << "looking for it in vain is no news";
}

TEST_F(BusLinesTest, ReceivesOnlyWhereSomethingIsReadyOrDue) {
  Receive(1);
  EXPECT_EQ(fakes_[0]->received, 1);
  lines_->MarkReady(1);
  fakes_[0]->wake = HostInstant{100};
  Receive(50);
  EXPECT_EQ(fakes_[0]->received, 1);
  EXPECT_EQ(fakes_[1]->received, 2);
  Receive(100);
  EXPECT_EQ(fakes_[0]->received, 2);
}

TEST_F(BusLinesTest, ATurnTakesSoManyFramesAndBusesTakeTurns) {
  Receive(1);
  for (FakePort* fake : fakes_) fake->gives = limits::kFramesPerStep;
  const auto ready = [&] {
    frames_.clear();
    for (std::size_t line = 0; line < fakes_.size(); ++line) lines_->MarkReady(line);
    Receive(2);
  };
  for (int turn = 1; turn <= 6; ++turn) {
    ready();
    EXPECT_EQ(frames_.size(), limits::kFramesPerStep) << "a command is looked at in between";
    EXPECT_EQ(fakes_[0]->received, 1 + (turn + 1) / 2) << "turn " << turn;
    EXPECT_EQ(fakes_[1]->received, 1 + turn / 2) << "turn " << turn;
    EXPECT_EQ(lines_->wake_at(HostInstant{2}, clock_), HostInstant{2}) << "the rest is due at once";
  }
  frames_.clear();
  Receive(3);
  EXPECT_EQ(fakes_[0]->received, 5) << "what was left stays ready";
  EXPECT_EQ(lines_->wake_at(HostInstant{3}, clock_), kNever);
}

TEST_F(BusLinesTest, ADeadLinkDiscardsWaitingFramesAndTakesNone) {
  Receive(1);
  fakes_[0]->room = 0;
  lines_->Put({BusId{2}, frame_}, HostInstant{1});
  lines_->Flush(clock_);
  EXPECT_EQ(lines_->Facts()[0].waiting, 1u);
  fakes_[0]->link = LinkState::kDown;
  Receive(2);
  lines_->Put({BusId{2}, frame_}, HostInstant{2});
  EXPECT_EQ(lines_->Facts()[0].waiting, 0u);
  EXPECT_EQ(lines_->Facts()[0].transmit_queue.stale, 1u);
  fakes_[0]->link = LinkState::kUp;
  fakes_[0]->room = 1000;
  lines_->Flush(clock_);
  EXPECT_EQ(fakes_[0]->sent, 0u) << "nothing of before the gap is sent after it";
}

TEST_F(BusLinesTest, AFullPortIsTriedAgainSoonAndDoesNotHoldUpTheOther) {
  Receive(1);
  fakes_[0]->room = 0;
  lines_->Put({BusId{2}, frame_}, HostInstant{1});
  lines_->Put({BusId{5}, frame_}, HostInstant{1});
  lines_->Flush(clock_);
  EXPECT_EQ(fakes_[1]->sent, 1u);
  EXPECT_EQ(lines_->wake_at(HostInstant{10}, clock_), HostInstant{10} + Milliseconds(1));
  fakes_[0]->room = 1;
  lines_->Flush(clock_);
  EXPECT_EQ(fakes_[0]->sent, 1u);
  EXPECT_EQ(lines_->wake_at(HostInstant{10}, clock_), kNever);
}

}  // namespace
}  // namespace focalfleet
