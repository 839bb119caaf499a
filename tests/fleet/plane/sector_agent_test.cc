#include "fleet/plane/sector_agent.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <variant>

namespace focalfleet {
namespace {

constexpr PlaneEpoch kFirst{1, 7};
constexpr PlaneEpoch kSecond{2, 9};

/// Sector 1 beside sector 0, with a coordinator that obeys.
class Seat {
 public:
  Seat() : agent_({.sector = 1, .layout = 5}, 1, kFirst) {}

  /// The agent takes a step; the sector's coordinator obeys before the next one.
  const AgentEffects& Step(double after_s = 0.01) {
    now = now + Seconds(after_s);
    out = {};
    agent_.Step({.now = now,
                 .orders = orders,
                 .news = news,
                 .kept = kept,
                 .view = view,
                 .configuration = &configuration,
                 .job = job ? &*job : nullptr,
                 .ends = ends},
                &out);
    orders.clear();
    news.clear();
    job.reset();
    ends.clear();
    return out;
  }
  template <class What>
  [[nodiscard]] const What* Sent() const {
    for (const Command& command : out.commands)
      if (const What* what = std::get_if<What>(&command.what)) return what;
    return nullptr;
  }
  PlaneOrder Order(OrderKind kind, const PlaneEpoch& epoch = kFirst) {
    PlaneOrder order;
    order.epoch = epoch;
    order.sector = 1;
    order.incarnation = 1;
    order.number = ++number;
    order.kind = kind;
    order.configuration = {7, 3};
    order.job = view.job;
    order.sent = now;
    order.ahead = DurationNs{0};
    return order;
  }
  /// The sector holds round 4 with sector 0, and has the order to start in 2 s.
  void Confirming() {
    auto apply = Order(OrderKind::kConfigure);
    apply.task = std::make_shared<const SectorTask>();
    orders.push_back(apply);
    Step();
    view = {SectorStage::kAsking, 11};
    job = PlanJob{.job = 11};
    Step();
    auto round = Order(OrderKind::kRound);
    round.round = 4;
    round.together = {0};
    auto body = std::make_shared<SectorRound>();
    body->job = 11;
    body->moves.resize(1);
    body->follows.push_back({UnitId{42}, 0, {{0}, 5, 9, 4}});
    round.round_body = body;
    orders.push_back(round);
    Step();
    view.stage = SectorStage::kReady;
    Step();
    auto start = Order(OrderKind::kStart);
    start.round = 4;
    start.start_at = start_at = now + Seconds(2);
    orders.push_back(start);
    Step();
  }
  BorderNews News(BorderStage stage, bool hears) {
    BorderNews from{.sector = 0,
                    .incarnation = 1,
                    .number = ++news_number,
                    .epoch = kFirst,
                    .round = 4,
                    .stage = stage,
                    .start_at = start_at};
    if (hears) from.heard = {1};
    return from;
  }
  /// Steps until shortly after the last moment to decide, with news of sector 0 each 50 ms.
  void UntilStart(bool hears) {
    while (now < start_at - Milliseconds(250)) {
      news.push_back(News(BorderStage::kHolding, hears));
      Step(0.05);
      if (Sent<SectorStartCommand>() != nullptr || Sent<SectorWithdrawCommand>() != nullptr) return;
    }
  }

  HostInstant now{Seconds(100).ns};
  HostInstant start_at;
  std::vector<PlaneOrder> orders;
  std::vector<BorderNews> news;
  PlaneEpoch kept = kFirst;
  SectorView view;
  ConfigurationView configuration;
  std::optional<PlanJob> job;
  std::vector<BorderEnd> ends;
  AgentEffects out;
  std::uint64_t number = 0;
  std::uint64_t news_number = 0;
  [[nodiscard]] const SectorAgent& agent() const { return agent_; }

 private:
  SectorAgent agent_;
};

TEST(SectorAgent, RefusesTheWordsOfAnEpochThatIsOver) {
  Seat seat;
  seat.kept = kSecond;
  auto order = seat.Order(OrderKind::kConfigure, kFirst);
  order.task = std::make_shared<const SectorTask>();
  seat.orders.push_back(order);
  seat.Step();
  EXPECT_TRUE(seat.out.commands.empty());
  EXPECT_EQ(seat.agent().refused(), 1u);
}

TEST(SectorAgent, TakesANewEpochOnlyWhenItIsDurable) {
  Seat seat;
  auto order = seat.Order(OrderKind::kConfigure, kSecond);
  order.task = std::make_shared<const SectorTask>();
  seat.orders.push_back(order);
  seat.Step();
  EXPECT_TRUE(seat.out.commands.empty());
  ASSERT_TRUE(seat.out.keep.has_value());
  EXPECT_EQ(*seat.out.keep, kSecond);
  EXPECT_EQ(seat.agent().accepted(), kFirst);
  seat.kept = kSecond;
  seat.orders.push_back(order);
  seat.Step();
  EXPECT_NE(seat.Sent<SectorTask>(), nullptr);
}

TEST(SectorAgent, DoesAnOrderOnceHoweverOftenItComes) {
  Seat seat;
  auto order = seat.Order(OrderKind::kConfigure);
  order.task = std::make_shared<const SectorTask>();
  seat.orders.push_back(order);
  seat.Step();
  EXPECT_NE(seat.Sent<SectorTask>(), nullptr);
  seat.view.stage = SectorStage::kPreparing;
  for (int n = 0; n < 5; ++n) {
    seat.orders.push_back(order);
    seat.Step();
    EXPECT_TRUE(seat.out.commands.empty());
  }
}

TEST(SectorAgent, PassesOverWhatWasMeantForAnEarlierLife) {
  Seat seat;
  auto order = seat.Order(OrderKind::kConfigure);
  order.task = std::make_shared<const SectorTask>();
  order.incarnation = 2;
  seat.orders.push_back(order);
  seat.Step();
  EXPECT_TRUE(seat.out.commands.empty());
}

TEST(SectorAgent, StartsWhereItsNeighbourHoldsAndHearsIt) {
  Seat seat;
  seat.Confirming();
  seat.UntilStart(true);
  const auto* start = seat.Sent<SectorStartCommand>();
  ASSERT_NE(start, nullptr);
  EXPECT_EQ(start->at, seat.start_at);
  EXPECT_EQ(start->job, 11u);
}

TEST(SectorAgent, GivesTheRoundBackWhereItIsNotHeard) {
  Seat seat;
  seat.Confirming();
  seat.UntilStart(false);
  EXPECT_EQ(seat.Sent<SectorStartCommand>(), nullptr);
  EXPECT_NE(seat.Sent<SectorWithdrawCommand>(), nullptr);
  ASSERT_EQ(seat.out.notes.size(), 1u);
  EXPECT_EQ(seat.out.notes[0].name, AlarmName::kSectorStartMissed);
}

TEST(SectorAgent, GivesTheRoundBackWhereItHearsNobody) {
  Seat seat;
  seat.Confirming();
  while (seat.now < seat.start_at) {
    seat.Step(0.05);
    ASSERT_EQ(seat.Sent<SectorStartCommand>(), nullptr);
    if (seat.Sent<SectorWithdrawCommand>() != nullptr) return;
  }
  FAIL() << "it held the round beyond the start";
}

TEST(SectorAgent, ANewEpochTakesTheStartBack) {
  Seat seat;
  seat.Confirming();
  seat.kept = kSecond;
  seat.Step();
  EXPECT_NE(seat.Sent<SectorWithdrawCommand>(), nullptr);
}

/// The seat in motion.
void Move(Seat* seat) {
  seat->Confirming();
  seat->UntilStart(true);
  ASSERT_NE(seat->Sent<SectorStartCommand>(), nullptr);
  seat->view.stage = SectorStage::kMoving;
  for (int n = 0; n < 20; ++n) {
    seat->news.push_back(seat->News(BorderStage::kStarted, true));
    seat->Step(0.05);
    ASSERT_TRUE(seat->out.commands.empty()) << n;
  }
}

// Its units finish by themselves and count on the space that others were to leave.
TEST(SectorAgent, ReportsASectorThatFallsSilentAndStopsNobody) {
  Seat seat;
  Move(&seat);
  std::size_t notes = 0;
  for (int n = 0; n < 200; ++n) {
    seat.Step(0.01);
    for (const ShellNote& note : seat.out.notes)
      notes += note.name == AlarmName::kSectorSilent ? 1u : 0u;
    EXPECT_EQ(seat.Sent<BorderEndCommand>(), nullptr);
  }
  EXPECT_EQ(notes, 1u);
}

TEST(SectorAgent, StopsWhoFollowsASectorThatHasNotStarted) {
  Seat seat;
  seat.Confirming();
  seat.UntilStart(true);
  seat.view.stage = SectorStage::kMoving;
  seat.news.push_back(seat.News(BorderStage::kOut, true));
  seat.Step();
  const auto* end = seat.Sent<BorderEndCommand>();
  ASSERT_NE(end, nullptr);
  EXPECT_EQ(end->from.ns, INT64_MIN);
}

TEST(SectorAgent, PassesEndsOnInBothDirections) {
  Seat seat;
  Move(&seat);
  auto news = seat.News(BorderStage::kStarted, true);
  news.ends = {{UnitId{42}, seat.now - Seconds(1), seat.now}};
  seat.news = {news, news};
  seat.Step();
  const auto* end = seat.Sent<BorderEndCommand>();
  ASSERT_NE(end, nullptr);
  EXPECT_EQ(end->leaders, std::vector<UnitId>{UnitId{42}});
  EXPECT_EQ(std::ranges::count_if(seat.out.commands,
                                  [](const Command& command) {
                                    return std::holds_alternative<BorderEndCommand>(command.what);
                                  }),
            1);
  seat.ends = {{UnitId{8}, seat.now - Seconds(1), seat.now}};
  seat.Step();
  ASSERT_TRUE(seat.out.news.has_value());
  ASSERT_EQ(seat.out.news->ends.size(), 1u);
  EXPECT_EQ(seat.out.news->ends[0].leader, UnitId{8});
}

TEST(SectorAgent, DoesNotMissASectorWhoseMotionIsOver) {
  Seat seat;
  Move(&seat);
  seat.news.push_back(seat.News(BorderStage::kOver, true));
  seat.Step();
  for (int n = 0; n < 100; ++n) {
    seat.Step(0.05);
    EXPECT_EQ(seat.Sent<BorderEndCommand>(), nullptr);
  }
}

}  // namespace
}  // namespace focalfleet
