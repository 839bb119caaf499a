// These tests hold the host up at random instants. They compare what it reports on units' clocks
// and starts with the truth. A pause makes the known intervals wider, and never wrong.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <ranges>

#include "fleet/plan/planner.h"
#include "protocol/wire/codec.h"
#include "tests/scenario/in_process_fleet.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

using test::InProcessFleet;
using test::TestSeed;
using ::testing::HasSubstr;
using ::testing::Not;

const double kClockLimit = PlanOptions{}.clock_error;

/// The alarms on clocks or starts.
std::vector<std::string> AlarmsOfTime(InProcessFleet& fleet) {
  std::vector<std::string> texts;
  for (const AlarmRow& alarm : fleet.store().alarms)
    if (alarm.text.find("'s clock is ") != std::string::npos ||
        alarm.text.find(" after unit ") != std::string::npos)
      texts.push_back(alarm.text);
  return texts;
}

void ExpectClocksWithinTheirBounds(InProcessFleet* fleet) {
  for (std::uint32_t n = 0; n < fleet->layout().size(); ++n) {
    const ClockView& clock = fleet->coordinator().unit({n}).clock;
    if (clock.readings == 0) continue;
    EXPECT_LE(std::abs(clock.rate_error - fleet->world().Truth(n).clock_error),
              clock.rate_bound + 1e-9)
        << "unit " << n << " at " << fleet->now().ns;
  }
}

/// Starts as they truly were, looked at often enough to see each. A unit that moves later than the
/// others does so under a number of its own.
class TrueStarts {
 public:
  void Look(InProcessFleet* fleet) {
    for (std::uint32_t n = 0; n < fleet->layout().size(); ++n) {
      const sim::UnitTruth truth = fleet->world().Truth(n);
      if (truth.moves_begun > 0) starts_[truth.last_move.value][n] = truth.began;
    }
  }
  /// From the first start of the move that most units began to the last. Units: s.
  [[nodiscard]] double CommonSkew_s() const {
    const auto common =
        std::ranges::max_element(starts_, {}, [](const auto& move) { return move.second.size(); });
    const auto [first, last] = std::ranges::minmax(common->second | std::views::values);
    return (last - first).seconds();
  }

 private:
  std::map<std::uint32_t, std::map<std::uint32_t, HostInstant>> starts_;  // by move and unit
};

TEST(BusyHost, WhatItSaysOfClocksAndStartsIsTrueWhereverItIsHeldUp) {
  int compared = 0;
  for (std::uint64_t k = 0; k < 12; ++k) {
    const std::uint64_t seed = TestSeed(81) + k;
    SCOPED_TRACE(seed);
    Rng rng = Rng::Stream(seed, "pauses");
    InProcessFleet fleet({.count = 37,
                          .units_per_bus = 10,
                          .seed = seed,
                          .clock_error_max = 0.0049,
                          .stamped_when_heard = k % 2 == 0});
    fleet.held_up = [&] {
      return rng.Uniform() < 0.01 ? Seconds(std::exp(rng.Uniform(-4.6, 0.7))) : DurationNs{0};
    };
    TrueStarts starts;
    const auto go_on = [&](const std::function<bool()>& done) {
      for (int i = 0; i < 2000 && !done(); ++i) {
        fleet.RunUntil(done, Seconds(rng.Uniform(0.01, 2)));
        starts.Look(&fleet);
        ExpectClocksWithinTheirBounds(&fleet);
        fleet.Freeze(Seconds(std::exp(rng.Uniform(-4.6, 0.7))), InProcessFleet::Heard::kWaits);
      }
    };
    const HostInstant begun = fleet.now() + Seconds(20);
    go_on([&] { return fleet.now() > begun; });
    fleet.ApplyRandom(seed);
    go_on([&] { return fleet.coordinator().busy(); });
    go_on([&] { return !fleet.coordinator().busy(); });
    fleet.Run(Seconds(1));
    const StartView& said = fleet.coordinator().configuration().starts;
    // The host reports the widest of several rounds; the truth at hand is that of the last round.
    if (fleet.coordinator().configuration().round == said.round && said.reported == said.begun) {
      const double true_s = starts.CommonSkew_s();
      EXPECT_LE(said.least_s, true_s + 1e-9);
      EXPECT_GE(said.most_s, true_s - 1e-9);
      EXPECT_LE(said.least_s, said.skew_s);
      EXPECT_LE(said.skew_s, said.most_s);
      ++compared;
    }
    EXPECT_THAT(AlarmsOfTime(fleet), ::testing::IsEmpty());
  }
  EXPECT_GE(compared, 6);
}

TEST(BusyHost, APauseBetweenAQuestionAndItsSendingWidensTheReading) {
  const std::uint64_t seed = TestSeed(82);
  InProcessFleet fleet({.count = 7, .units_per_bus = 7, .seed = seed});
  fleet.Run(Seconds(5));
  const auto bound_s = [&] { return fleet.coordinator().unit({2}).clock.bound_s; };
  EXPECT_LT(bound_s(), 0.01);
  fleet.held_up = [] { return Milliseconds(30); };
  ASSERT_TRUE(fleet.RunUntil([&] { return bound_s() > 0.01; }, Seconds(20)));
  ExpectClocksWithinTheirBounds(&fleet);
  fleet.Run(Seconds(60));
  ExpectClocksWithinTheirBounds(&fleet);
  EXPECT_THAT(AlarmsOfTime(fleet), ::testing::IsEmpty());
}

// The other units' clocks are off by as much as the limit allows.
TEST(BusyHost, ClocksThatAreOffByOnePercentAreNamedAndNoOtherOnes) {
  const std::uint64_t seed = TestSeed(83);
  InProcessFleet fleet({.count = 19,
                        .units_per_bus = 10,
                        .seed = seed,
                        .clock_error_max = 0.0049,
                        .clock_errors = {{3, 0.01}, {11, -0.01}, {17, 0.01}}});
  const auto named = [&] { return AlarmsOfTime(fleet).size() == 3; };
  ASSERT_TRUE(fleet.RunUntil(named, Seconds(15)));
  for (const std::uint32_t n : {3u, 11u, 17u})
    EXPECT_LE(fleet.coordinator().unit({n}).clock.readings, 3u) << n;
  fleet.Run(Seconds(120));
  const auto texts = AlarmsOfTime(fleet);
  EXPECT_EQ(texts.size(), 3u) << "once each";
  for (const std::string& text : texts) {
    EXPECT_THAT(text, HasSubstr("more than the 0.50 % that plans allow for"));
    const auto id =
        static_cast<std::uint32_t>(std::stoul(text.substr(std::string("unit ").size())));
    EXPECT_GT(std::abs(fleet.world().Truth(UnitId{id}).clock_error), kClockLimit);
  }
  ExpectClocksWithinTheirBounds(&fleet);
}

TEST(BusyHost, AClockThatIsOffByMoreThanAnyUsualOneIsNamedToo) {
  const std::uint64_t seed = TestSeed(84);
  InProcessFleet fleet(
      {.count = 7, .units_per_bus = 7, .seed = seed, .clock_errors = {{2, 0.03}, {5, -0.04}}});
  fleet.Run(Seconds(60));
  EXPECT_EQ(AlarmsOfTime(fleet).size(), 2u);
  ExpectClocksWithinTheirBounds(&fleet);
}

TEST(BusyHost, UnitsThatLosePowerAgainAndAgainHaveNoSlowClocks) {
  const std::uint64_t seed = TestSeed(85);
  Rng rng = Rng::Stream(seed, "power");
  InProcessFleet fleet({.count = 19, .units_per_bus = 10, .seed = seed});
  for (int i = 0; i < 200; ++i) {
    const UnitId unit = fleet.id(static_cast<std::uint32_t>(rng.Below(19)));
    fleet.world().disturb().PowerCut(unit);
    fleet.Run(Seconds(rng.Uniform(0, 0.2)));
    fleet.world().disturb().PowerOn(unit);
    fleet.Run(Seconds(rng.Uniform(0, 1.5)));
  }
  EXPECT_THAT(AlarmsOfTime(fleet), ::testing::IsEmpty());
}

TEST(BusyHost, OtherHardwareHasAnotherClock) {
  InProcessFleet fleet({.count = 7, .units_per_bus = 7, .seed = TestSeed(88)});
  fleet.Run(Seconds(45));
  EXPECT_GE(fleet.coordinator().unit({2}).clock.readings, 4u);
  sim::UnitFaults& faults = *fleet.world().disturb().faults(fleet.id(2));
  faults.silent = true;
  fleet.Run(Seconds(15));
  EXPECT_EQ(fleet.coordinator().unit({2}).phase, UnitPhase::kSilent);
  faults.silent = false;
  faults.foreign_serial = SerialNumber{4242};
  ASSERT_TRUE(fleet.RunUntil(
      [&] { return fleet.coordinator().unit({2}).phase == UnitPhase::kForeign; }, Seconds(15)));
  EXPECT_EQ(fleet.coordinator().unit({2}).clock.readings, 1u);
}

// A unit that missed the first signal would begin out of step with all others.
TEST(BusyHost, AStartIsNotSaidAgainAfterItsInstant) {
  InProcessFleet fleet({.count = 14, .units_per_bus = 7, .seed = TestSeed(89)});
  fleet.Run(Seconds(5));
  fleet.ApplyRandom(TestSeed(89));
  std::vector<OutFrame> sent;
  fleet.sent = &sent;
  const auto says_start = [](const OutFrame& frame) {
    return (frame.frame.id >> 20 & 0x3f) == static_cast<std::uint32_t>(Function::kStart);
  };
  ASSERT_TRUE(fleet.RunUntil([&] { return std::ranges::any_of(sent, says_start); }, Seconds(60)));
  fleet.Freeze(Seconds(2), InProcessFleet::Heard::kWaits);
  sent.clear();
  fleet.Run(Seconds(2));
  EXPECT_GT(sent.size(), 0u);
  EXPECT_EQ(std::ranges::count_if(sent, says_start), 0);
}

// Frames that arrived while the host was held up before reading the socket do not count for the
// second that ended before.
TEST(BusyHost, ABusIsNotBusierThanItCanBe) {
  InProcessFleet fleet({.count = 7, .units_per_bus = 7, .seed = TestSeed(87)});
  fleet.Run(Milliseconds(1500));
  const Unit& unit = fleet.layout().unit({0});
  const CanFrame frame = Encode(UnitMessage(ProgressReply{}), {unit.node, 77});
  constexpr std::int64_t kFrames = 12'000;  // 1.5 s of the bus and more
  for (std::int64_t i = 1; i <= kFrames; ++i)
    fleet.Hear({unit.bus, fleet.now() + DurationNs{Seconds(2).ns / kFrames * i}, frame});
  fleet.Run(Seconds(2));
  EXPECT_GT(fleet.coordinator().bus(unit.bus).load_max, 0.5);
  EXPECT_LE(fleet.coordinator().bus(unit.bus).load_max, 1);
}

// Asking a bus of 100 units takes several horizons, so the last units' questions wait for their
// turn.
TEST(BusyHost, AnAnswerToAQuestionThatHasNotLeftAnswersNone) {
  InProcessFleet fleet({.count = 100, .units_per_bus = 100, .seed = TestSeed(86)});
  const PositionerIndex last{99};
  fleet.RunUntil([] { return true; }, Seconds(1));
  const Unit& unit = fleet.layout().unit(last);
  fleet.Hear({unit.bus, fleet.now(),
              Encode(UnitMessage(IdentifyReply{.serial = SerialNumber{4242}}), {unit.node, 1})});
  fleet.RunUntil([] { return true; }, Seconds(1));
  EXPECT_EQ(fleet.coordinator().unit(last).serial, SerialNumber{});
  fleet.Run(Seconds(2));
  EXPECT_EQ(fleet.coordinator().unit(last).phase, UnitPhase::kReady);
}

}  // namespace
}  // namespace focalfleet
