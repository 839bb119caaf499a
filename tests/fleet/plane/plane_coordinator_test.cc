#include "fleet/plane/plane_coordinator.h"

#include <gtest/gtest.h>

#include "fleet/hex_layout.h"

namespace focalfleet {
namespace {

constexpr std::uint64_t kSelf = 7;

PlaneLayout TwoSectors() {
  auto layout = Layout::Create(MakeHexLayout({.count = 20, .units_per_bus = 10}), {});
  return std::move(*PlaneLayout::Create(std::move(*layout), {{{0}}, {{1}}}));
}

/// Configuration 5 of 20 targets is over.
PlaneRecord Ended(ConfigurationState state) {
  PlaneRecord kept{.epoch = {3, kSelf}, .next_configuration = 6, .under_way = {}};
  kept.last = PlaneConfiguration{.id = 5, .source = "test"};
  kept.last->targets.assign(20, Pose{4, 4});
  kept.last_state = state;
  return kept;
}

/// A sector of ten units asks for a plan; one of them does not stand at its target.
void AskInLast(SectorReport* report) {
  report->configuration = {kSelf, 5};
  report->stage = SectorStage::kAsking;
  report->job = 2;
  SectorJob job{.job = 2};
  const Pose there{4, 4};
  job.start.assign(10, Exactly(Witness::kReported, there));
  job.start[7] = Exactly(Witness::kReported, {4, 5});
  job.targets.assign(10, there);
  job.frozen.resize(10);
  job.offsets.resize(10);
  job.drives.resize(10);
  report->body = std::make_shared<const SectorJob>(std::move(job));
}

/// A coordinator, and what its two sectors report.
class Bench {
 public:
  explicit Bench(PlaneRecord earlier = {}) : coordinator_(&plane_, {}, kSelf, std::move(earlier)) {
    for (std::uint32_t n = 0; n < 2; ++n) {
      SectorReport& report = reports[n];
      report.sector = n;
      report.incarnation = 1;
      report.layout = DigestOf(*plane_.layout().Part(plane_.own(n)));
      report.unordered = Seconds(100);
    }
  }
  void Step(double after_s = 0.1) {
    now = now + Seconds(after_s);
    out = {};
    std::vector<SectorReport> heard;
    for (SectorReport& report : reports) {
      if (!speaks[report.sector]) continue;
      ++report.number;
      report.echo = SectorReport::Echo{now, now, now};
      heard.push_back(report);
    }
    coordinator_.Step({.now = now, .reports = heard, .commands = commands, .kept = kept}, &out);
    commands.clear();
    if (out.record) kept = out.record_number;
    if (out.record) record = *out.record;
    for (const PlaneOrder& order : out.orders) {
      orders[order.sector] = order;
      if (!obeys || order.epoch < reports[order.sector].accepted) continue;
      reports[order.sector].accepted = order.epoch;
      reports[order.sector].unordered = {};
    }
  }
  bool Until(PlanePhase phase, double limit_s = 20) {
    for (const HostInstant end = now + Seconds(limit_s); now < end;) {
      Step();
      if (view().phase == phase) return true;
    }
    return false;
  }
  PlaneApplyCommand Apply() const {
    return {
        "test", false, std::vector<std::optional<Pose>>(plane_.layout().size(), Pose{1, 1}), {}};
  }
  [[nodiscard]] const PlaneView& view() const { return coordinator_.view(); }
  [[nodiscard]] const PlaneCoordinator& coordinator() const { return coordinator_; }

 private:
  PlaneLayout plane_ = TwoSectors();
  PlaneCoordinator coordinator_;

 public:
  HostInstant now{Seconds(100).ns};
  SectorReport reports[2];
  bool speaks[2] = {true, true};
  bool obeys = true;
  std::vector<PlaneCommand> commands;
  PlaneEffects out;
  PlaneRecord record;
  std::uint64_t kept = 0;
  PlaneOrder orders[2];
};

TEST(PlaneCoordinator, TakesAHigherEpochThanItHearsAndKeepsItFirst) {
  Bench bench;
  bench.reports[1].accepted = {4, 2};
  ASSERT_TRUE(bench.Until(PlanePhase::kClaiming));
  EXPECT_EQ(bench.record.epoch, (PlaneEpoch{5, kSelf}));
  EXPECT_TRUE(bench.out.orders.empty());
  ASSERT_TRUE(bench.Until(PlanePhase::kIdle));
  EXPECT_EQ(bench.orders[0].epoch, (PlaneEpoch{5, kSelf}));
}

TEST(PlaneCoordinator, LeavesAPlaneAloneThatAnotherOneCommands) {
  Bench bench;
  for (SectorReport& report : bench.reports) {
    report.accepted = {4, 2};
    report.unordered = Milliseconds(200);
  }
  EXPECT_FALSE(bench.Until(PlanePhase::kClaiming, 30));
  for (SectorReport& report : bench.reports) report.unordered = Seconds(6);
  EXPECT_TRUE(bench.Until(PlanePhase::kIdle));
}

TEST(PlaneCoordinator, SaysNothingMoreOnceItHearsOfAHigherEpoch) {
  Bench bench;
  ASSERT_TRUE(bench.Until(PlanePhase::kIdle));
  bench.obeys = false;
  bench.reports[0].accepted = {9, 2};
  bench.reports[0].unordered = {};
  for (int n = 0; n < 50; ++n) {
    bench.Step();
    EXPECT_TRUE(bench.out.orders.empty()) << n;
  }
  EXPECT_EQ(bench.view().phase, PlanePhase::kListening);
  bench.commands.push_back({1, bench.Apply()});
  bench.Step();
  ASSERT_EQ(bench.out.replies.size(), 1u);
  EXPECT_TRUE(bench.out.replies[0].error.has_value());
}

TEST(PlaneCoordinator, KeepsAConfigurationBeforeAnySectorHearsOfIt) {
  Bench bench;
  ASSERT_TRUE(bench.Until(PlanePhase::kIdle));
  bench.commands.push_back({1, bench.Apply()});
  bench.Step();
  ASSERT_TRUE(bench.record.under_way.has_value());
  EXPECT_EQ(bench.view().phase, PlanePhase::kRecording);
  EXPECT_EQ(bench.orders[0].kind, OrderKind::kStand);
  bench.Step(0.3);
  bench.Step(0.3);
  EXPECT_EQ(bench.orders[0].kind, OrderKind::kConfigure);
  ASSERT_NE(bench.orders[0].task, nullptr);
  EXPECT_EQ(std::get<ApplyCommand>(bench.orders[0].task->what).targets.size(), 10u);
}

TEST(PlaneCoordinator, GoesOnWithTheConfigurationOfItsEarlierLife) {
  PlaneRecord kept{.epoch = {3, kSelf}, .next_configuration = 6, .under_way = {}};
  kept.under_way = PlaneConfiguration{.id = 5, .source = "test"};
  kept.under_way->targets.resize(20);
  Bench bench(kept);
  for (SectorReport& report : bench.reports) {
    report.accepted = {3, kSelf};
    report.configuration = {kSelf, 5};
    report.stage = SectorStage::kReady;
    report.job = 8;
    report.round = 2;
  }
  ASSERT_TRUE(bench.Until(PlanePhase::kGathering));
  EXPECT_EQ(bench.view().epoch, (PlaneEpoch{4, kSelf}));
  bench.Step(0.3);
  bench.Step(0.3);
  // A round of the earlier life is given back, never started.
  for (const PlaneOrder& order : bench.orders) {
    EXPECT_EQ(order.kind, OrderKind::kWithdraw);
    EXPECT_EQ(order.job, 8u);
  }
}

// Units that have arrived are reported as arrived by the next life of their sector, too.
TEST(PlaneCoordinator, LetsANewLifeOfASectorHearOfTheLastConfiguration) {
  Bench bench(Ended(ConfigurationState::kDone));
  for (SectorReport& report : bench.reports) report.counts.arrived = 10;
  bench.reports[0].last_over = {kSelf, 5};
  ASSERT_TRUE(bench.Until(PlanePhase::kIdle));
  bench.Step(0.3);
  bench.Step(0.3);
  EXPECT_EQ(bench.orders[0].kind, OrderKind::kStand);
  EXPECT_EQ(bench.view().counts.arrived, 10u) << "the other sector has reported nothing yet";
  ASSERT_EQ(bench.orders[1].kind, OrderKind::kConfigure);
  EXPECT_EQ(bench.orders[1].configuration, (PlaneConfigurationId{kSelf, 5}));
  // The sector asks; nothing moves, and only what does not stand at its target is refused.
  SectorReport& report = bench.reports[1];
  AskInLast(&report);
  bench.Step(0.3);
  ASSERT_EQ(bench.orders[1].kind, OrderKind::kRound);
  ASSERT_NE(bench.orders[1].round_body, nullptr);
  const SectorRound& round = *bench.orders[1].round_body;
  EXPECT_TRUE(round.finished);
  EXPECT_EQ(round.end, ConfigurationState::kDone);
  EXPECT_TRUE(round.moves.empty());
  ASSERT_EQ(round.refused.size(), 1u);
  EXPECT_EQ(round.refused[0].unit, PositionerIndex{7});
  EXPECT_EQ(bench.view().phase, PlanePhase::kIdle);
  report.configuration = {};
  report.last_over = {kSelf, 5};
  report.stage = SectorStage::kIdle;
  report.counts = {.targeted = 10, .arrived = 9, .refused = 1};
  bench.Step(0.3);
  EXPECT_EQ(bench.view().counts.arrived, 19u);
  EXPECT_EQ(bench.view().counts.refused, 1u);
}

// Nobody has refused the targets of a configuration that was stopped.
TEST(PlaneCoordinator, LetsANewLifeOfASectorHearOfAStop) {
  Bench bench(Ended(ConfigurationState::kStopped));
  ASSERT_TRUE(bench.Until(PlanePhase::kIdle));
  bench.Step(0.3);
  AskInLast(&bench.reports[1]);
  bench.Step(0.3);
  ASSERT_EQ(bench.orders[1].kind, OrderKind::kRound);
  ASSERT_NE(bench.orders[1].round_body, nullptr);
  const SectorRound& round = *bench.orders[1].round_body;
  EXPECT_TRUE(round.finished);
  EXPECT_EQ(round.end, ConfigurationState::kStopped);
  EXPECT_EQ(round.refused.size(), 0u);
  EXPECT_EQ(round.failure, "the configuration was stopped");
}

// A sector that was cut off while it held a round may hear of nothing but the end.
TEST(PlaneCoordinator, TakesBackARoundThatIsHeldAfterTheEnd) {
  Bench bench(Ended(ConfigurationState::kDone));
  SectorReport& report = bench.reports[1];
  report.configuration = {kSelf, 5};
  report.stage = SectorStage::kReady;
  report.job = 2;
  report.round = 4;
  ASSERT_TRUE(bench.Until(PlanePhase::kIdle));
  bench.Step(0.3);
  bench.Step(0.3);
  EXPECT_EQ(bench.orders[1].kind, OrderKind::kWithdraw);
  EXPECT_EQ(bench.orders[1].configuration, (PlaneConfigurationId{kSelf, 5}));
  EXPECT_EQ(bench.orders[1].job, 2u);
}

// No sector gets an exposure after the end, so none is sent into a measured configuration again.
TEST(PlaneCoordinator, LeavesANewLifeOfASectorOutOfAMeasuredConfiguration) {
  PlaneRecord kept = Ended(ConfigurationState::kDone);
  kept.last->measure = ApplyCommand::Measure{};
  Bench bench(kept);
  bench.reports[0].configuration = {kSelf, 5};
  bench.reports[0].stage = SectorStage::kLooking;
  ASSERT_TRUE(bench.Until(PlanePhase::kIdle));
  bench.Step(0.3);
  bench.Step(0.3);
  EXPECT_EQ(bench.orders[0].kind, OrderKind::kStop);
  EXPECT_EQ(bench.orders[1].kind, OrderKind::kStand);
}

TEST(PlaneCoordinator, AnswersOtherTargetsWhenAnotherOneTakesOver) {
  Bench bench;
  ASSERT_TRUE(bench.Until(PlanePhase::kIdle));
  bench.commands.push_back({1, bench.Apply()});
  ASSERT_TRUE(bench.Until(PlanePhase::kGathering));
  bench.commands.push_back({2, PlaneRetargetCommand{{3}, {2, 2}}});
  bench.Step();
  EXPECT_TRUE(bench.out.replies.empty());
  bench.obeys = false;
  bench.reports[0].accepted = {9, 2};
  bench.Step();
  ASSERT_EQ(bench.out.replies.size(), 2u);
  for (const ReplyEffect& reply : bench.out.replies) {
    EXPECT_TRUE(reply.last);
    ASSERT_TRUE(reply.error);
    EXPECT_EQ(reply.error->text, "another coordinator took over");
  }
}

TEST(PlaneCoordinator, StopsAConfigurationThatItDoesNotKnow) {
  Bench bench;
  bench.reports[1].configuration = {9, 77};
  bench.reports[1].stage = SectorStage::kAsking;
  ASSERT_TRUE(bench.Until(PlanePhase::kIdle));
  bench.Step(0.3);
  bench.Step(0.3);
  EXPECT_EQ(bench.orders[0].kind, OrderKind::kStand);
  EXPECT_EQ(bench.orders[1].kind, OrderKind::kStop);
}

TEST(PlaneCoordinator, RefusesASectorWithAnotherLayout) {
  Bench bench;
  bench.reports[1].layout += 1;
  ASSERT_TRUE(bench.Until(PlanePhase::kIdle));
  bench.Step();
  EXPECT_TRUE(bench.coordinator().sectors().IsUsable(0));
  EXPECT_FALSE(bench.coordinator().sectors().IsUsable(1));
}

}  // namespace
}  // namespace focalfleet
