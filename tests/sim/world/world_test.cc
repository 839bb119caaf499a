#include "sim/world/world.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "protocol/base/rng.h"
#include "protocol/wire/frame_bits.h"
#include "sim/world/metrology.h"
#include "tests/sim/world/rig.h"
#include "tests/support/seed.h"

namespace focalfleet::sim {
namespace {

using test::FleetOf;
using test::kGear;
using test::MakeMove;
using test::Rig;

constexpr double kDegPerVector = 360 / (96 * kGear);

TEST(World, CarriesAUnitThroughAMoveAndSaysSo) {
  Rig rig(FleetOf(1, 3));
  const UnitTruth before = rig.world().Truth(UnitId{2});
  ASSERT_EQ(rig.StageAndArm(0, 2, MakeMove(7, 2000, -1000)), Answer::kOk);
  rig.Send(0, 255, Start{{7}, 100});
  rig.Run(Milliseconds(11));
  EXPECT_EQ(rig.world().Truth(UnitId{2}).state, UnitState::kMoving);
  EXPECT_TRUE(rig.world().flash(UnitId{2}).moving);
  rig.heard().clear();
  rig.RunWatched(Milliseconds(2000));
  ASSERT_EQ(rig.heard().size(), 1u);
  const auto done = DecodeUnit(rig.heard()[0].frame);
  ASSERT_TRUE(done && std::holds_alternative<Done>(done->message));
  const Done& said = std::get<Done>(done->message);
  EXPECT_EQ(said.outcome, Outcome::kArrived);
  EXPECT_EQ(said.move, MoveId{7});
  EXPECT_EQ(said.position[0], before.applied[0] + 2000);
  EXPECT_EQ(said.position[1], before.applied[1] - 1000);
  const UnitTruth after = rig.world().Truth(UnitId{2});
  EXPECT_EQ(after.state, UnitState::kRest);
  EXPECT_EQ(after.moves_begun, 1u);
  EXPECT_EQ(after.begun_twice, 0u);
  EXPECT_FALSE(rig.world().flash(UnitId{2}).moving);
  // The lag of 15 electrical degrees is 4 of 96 vectors; the load varies by a fifth.
  EXPECT_NEAR(after.vectors[0], said.position[0] - 4, 1.0);
  EXPECT_NEAR(after.vectors[1], said.position[1] + 4, 1.0);
  EXPECT_NEAR(after.angle_deg[0], after.vectors[0] * kDegPerVector, 1e-9);
}

std::size_t Count(const std::vector<ReceivedFrame>& heard, Function function, std::uint8_t node) {
  return static_cast<std::size_t>(
      std::count_if(heard.begin(), heard.end(), [&](const ReceivedFrame& frame) {
        return (frame.frame.id >> 20 & 63) == static_cast<std::uint32_t>(function) &&
               (frame.frame.id >> 11 & 255) == node;
      }));
}

TEST(World, EveryUnitAnswersABroadcastOnceInOrderOfNodes) {
  Rig rig(FleetOf(2, 100));
  rig.Send(1, 255, StatusRequest{});
  rig.Run(Milliseconds(40));
  ASSERT_EQ(rig.heard().size(), 100u);
  for (std::size_t i = 0; i < 100; ++i) {
    EXPECT_EQ(rig.heard()[i].bus, BusId{1});
    EXPECT_EQ(rig.heard()[i].frame.id >> 11 & 255, i + 1);
    if (i == 0) continue;
    EXPECT_GT(rig.heard()[i].at, rig.heard()[i - 1].at);
  }
  const BusCounters counters = rig.world().counters({1});
  EXPECT_EQ(counters.host_frames, 1u);
  EXPECT_EQ(counters.unit_frames, 100u);
  // A frame has 64 + 0 to 64 + 8 * 8 bits and stuffing: 100 frames of 8 bytes take 13.1 to 16 ms.
  EXPECT_GT(counters.wire.busy, Milliseconds(13));
  EXPECT_LT(counters.wire.busy, Milliseconds(17));
  EXPECT_EQ(rig.world().counters({0}).wire.bits, 0u);
}

TEST(World, AnAnswerComesAfterTheFrameItsDelayAndItsOwnTimeOnTheWire) {
  Rig rig(FleetOf(1, 1));
  const CanFrame request = Encode(IdentifyRequest{}, {{1}, 9});
  rig.world().Inject({0}, request, {5'000'000});
  rig.Run(Milliseconds(10));
  ASSERT_EQ(rig.heard().size(), 1u);
  const std::int64_t expected =
      5'000'000 + 1000 * FrameBits(request) + 30'000 + 1000 * FrameBits(rig.heard()[0].frame);
  EXPECT_EQ(rig.heard()[0].at.ns, expected);
  ASSERT_EQ(rig.wire().size(), 2u);
  EXPECT_FALSE(rig.wire()[0].from_unit);
  EXPECT_TRUE(rig.wire()[1].from_unit);
}

TEST(World, RestingUnitsAreNoEventsButTheHostsSilence) {
  Rig rig(FleetOf(10, 100));
  EXPECT_GE(rig.world().NextEvent().ns, 4'990'000'000);
  rig.Run(Milliseconds(6000));
  EXPECT_EQ(rig.world().NextEvent(), kNever);
  EXPECT_EQ(rig.world().Truth(std::size_t{17}).state, UnitState::kHostLost);
  EXPECT_TRUE(rig.heard().empty());
}

TEST(World, PlantedMisbehaviourIsHeardAsNamed) {
  Rig rig(FleetOf(1, 6));
  rig.world().disturb().faults(UnitId{1})->silent = true;
  rig.world().disturb().faults(UnitId{2})->deaf = true;
  rig.world().disturb().faults(UnitId{3})->copies = 2;
  rig.world().disturb().faults(UnitId{4})->late = Milliseconds(80);
  rig.world().disturb().faults(UnitId{5})->foreign_serial = SerialNumber{99};
  rig.world().disturb().faults(UnitId{6})->wrong_digest = true;
  rig.Send(0, 255, IdentifyRequest{});
  rig.Run(Milliseconds(50));
  for (const std::uint8_t node : std::initializer_list<std::uint8_t>{1, 2, 4})
    EXPECT_EQ(Count(rig.heard(), Function::kIdentify, node), 0u);
  EXPECT_EQ(Count(rig.heard(), Function::kIdentify, 3), 2u);
  EXPECT_EQ(Count(rig.heard(), Function::kIdentify, 6), 1u);
  rig.Run(Milliseconds(50));
  EXPECT_EQ(Count(rig.heard(), Function::kIdentify, 4), 1u);
  EXPECT_EQ(rig.AskFor<IdentifyReply>(0, 5, IdentifyRequest{})->serial, SerialNumber{99});
  EXPECT_EQ(rig.AskFor<IdentifyReply>(0, 6, IdentifyRequest{})->serial, SerialNumber{1'000'006});
  const StagedMove move = MakeMove(1, 100, 100);
  rig.Stage(0, 6, move);
  const auto confirm = rig.AskFor<ConfirmReply>(0, 6, Confirm{{1}});
  EXPECT_EQ(confirm->answer, Answer::kOk);
  EXPECT_NE(confirm->digest, Digest(move));
  // A silent unit still carries out its requests.
  rig.Stage(0, 1, move);
  rig.Send(0, 1, Arm{{1}, Digest(move)});
  rig.Run(Milliseconds(5));
  rig.Send(0, 255, Start{{1}, 0});
  rig.Run(Milliseconds(200));
  EXPECT_EQ(rig.world().Truth(UnitId{1}).moves_begun, 1u);
  EXPECT_EQ(rig.world().Truth(UnitId{1}).applied[0], 100);
}

TEST(World, ADeadBusTakesOnlyItsUnitsWithIt) {
  Rig rig(FleetOf(2, 2));
  rig.world().disturb().KillBus({0});
  EXPECT_TRUE(rig.world().dead({0}));
  EXPECT_FALSE(rig.Ask(0, 1, IdentifyRequest{}));
  EXPECT_TRUE(rig.Ask(1, 1, IdentifyRequest{}));
  EXPECT_FALSE(rig.world().Inject({7}, {}, {0})) << "no such bus";
  rig.world().disturb().ReviveBus({0});
  EXPECT_TRUE(rig.Ask(0, 1, IdentifyRequest{}));
}

// A unit that goes on with an older copy of its FLASH has begun its move all the same.
TEST(World, TruthTellsTheMoveThatBeganThoughFlashIsLost) {
  Rig rig(FleetOf(1, 2));
  ASSERT_EQ(rig.StageAndArm(0, 1, MakeMove(7, 3000, -2000)), Answer::kOk);
  rig.Send(0, 255, Start{{7}, 0});
  rig.RunWatched(Milliseconds(300));
  rig.world().disturb().SpoilFlash(UnitId{1}, FlashDamage::kOldCounts);
  EXPECT_EQ(rig.world().flash(UnitId{1}).last_begun, MoveId{0});
  EXPECT_EQ(rig.world().Truth(UnitId{1}).last_move, MoveId{7});
}

TEST(World, AllMemorySurvivesAndNothingElseDoes) {
  WorldConfig config = FleetOf(2, 5);
  config.spread = Spread::kReal;
  Rig rig(config);
  ASSERT_EQ(rig.StageAndArm(0, 3, MakeMove(4, 3000, -2000)), Answer::kOk);
  ASSERT_EQ(rig.StageAndArm(1, 2, MakeMove(4, 3000, -2000)), Answer::kOk);
  rig.Send(0, 255, Start{{4}, 0});
  rig.RunWatched(Milliseconds(3000));
  rig.Send(1, 255, Start{{4}, 0});
  rig.Run(Milliseconds(300));
  config.memory = rig.world().Memory();
  config.start = rig.world().now();
  World found(config);
  for (std::size_t row = 0; row < found.units().size(); ++row) {
    SCOPED_TRACE(row);
    const UnitTruth was = rig.world().Truth(row);
    const UnitTruth is = found.Truth(row);
    EXPECT_EQ(is.moves_begun, was.moves_begun);
    EXPECT_EQ(is.last_move, was.last_move);
    const bool cut = was.state == UnitState::kMoving;
    EXPECT_EQ(cut, was.id == UnitId{7});
    EXPECT_EQ(is.interrupted, cut);
    // Half an electrical turn of 0.4 degrees is the most, where a stored vector is applied to a
    // rotor that stands elsewhere.
    for (std::size_t i = 0; i < kAxisCount; ++i)
      EXPECT_NEAR(is.angle_deg[i], was.angle_deg[i], cut ? 0.25 : 1e-9);
  }
}

// The digest covers all frames of every bus, in order.
std::uint64_t DigestOf(const std::vector<WireFrame>& wire) {
  std::uint64_t hash = 0xcbf29ce484222325u;
  const auto add = [&](std::uint64_t value) { hash = (hash ^ value) * 0x100000001b3u; };
  for (const WireFrame& frame : wire) {
    add(frame.bus.value);
    add(static_cast<std::uint64_t>(frame.at.ns));
    add(frame.frame.id);
    for (const std::uint8_t byte : frame.frame.data) add(byte);
  }
  return hash;
}

struct Trail {
  std::uint64_t wire = 0;
  double angle_sum = 0;
};
Trail RunBusyFleet(std::uint64_t seed) {
  WorldConfig config = FleetOf(3, 10);
  config.seed = seed;
  config.spread = Spread::kReal;
  Rig rig(std::move(config));
  for (const BusId bus : rig.world().buses())
    *rig.world().disturb().faults(bus) = {.drop = 0.02, .duplicate = 0.02, .late = 0.05};
  rig.world().disturb().faults(UnitId{4})->in_motion = {Milliseconds(40), FaultCode::kDriver,
                                                        Axis::kPhi};
  for (std::uint32_t bus = 0; bus < 3; ++bus)
    for (std::uint8_t node = 1; node <= 10; ++node)
      (void)rig.StageAndArm(bus, node, MakeMove(1, 100 * node, -50 * node));
  for (std::uint32_t bus = 0; bus < 3; ++bus) rig.Send(bus, 255, Start{{1}, 500});
  rig.Run(Milliseconds(150));
  rig.world().disturb().PowerCut({15});
  rig.RunWatched(Milliseconds(2000));
  rig.world().disturb().PowerOn({15});
  for (std::uint32_t bus = 0; bus < 3; ++bus) rig.Send(bus, 255, StatusRequest{});
  rig.Run(Milliseconds(50));
  Trail outcome{DigestOf(rig.wire()), 0};
  for (std::size_t row = 0; row < 30; ++row)
    outcome.angle_sum += rig.world().Truth(row).angle_deg[0] + rig.world().Truth(row).angle_deg[1];
  return outcome;
}

TEST(World, SameSeedSameBits) {
  for (const std::uint64_t seed : {1u, 2u, 3u}) {
    SCOPED_TRACE("FOCALFLEET_SEED=" + std::to_string(seed));
    const Trail first = RunBusyFleet(seed);
    const Trail second = RunBusyFleet(seed);
    EXPECT_EQ(first.wire, second.wire);
    EXPECT_EQ(first.angle_sum, second.angle_sum);
  }
  EXPECT_NE(RunBusyFleet(1).wire, RunBusyFleet(2).wire);
}

TEST(World, ClocksRunAsFastAsDrawn) {
  WorldConfig config = FleetOf(1, 50);
  config.clock_error_max = 0.005;
  Rig rig(std::move(config));
  rig.RunWatched(Milliseconds(100'000));
  double low = 2e6;
  double high = 0;
  for (std::uint8_t node = 1; node <= 50; ++node) {
    const auto ticks = rig.AskFor<ClockReply>(0, node, ClockRequest{})->ticks;
    const double expected = static_cast<double>(rig.world().now().ns) / 100'000;
    const double rate = ticks / expected;
    EXPECT_NEAR(rate, 1, 0.00505);
    low = std::min(low, rate);
    high = std::max(high, rate);
  }
  EXPECT_LT(low, 0.997);
  EXPECT_GT(high, 1.003);
}

TEST(World, AClockRunsAsItIsDescribedAndATruthTellsIt) {
  WorldConfig config = FleetOf(1, 3);
  config.units[1].clock_error = -0.01;
  ASSERT_TRUE(World::Validate(config));
  Rig rig(std::move(config));
  rig.RunWatched(Milliseconds(100'000));
  const auto ticks = rig.AskFor<ClockReply>(0, 2, ClockRequest{})->ticks;
  EXPECT_NEAR(ticks / (static_cast<double>(rig.world().now().ns) / 100'000), 0.99, 1e-4);
  EXPECT_NEAR(rig.world().Truth(1).clock_error, -0.01, 1e-12);
  EXPECT_LE(std::abs(rig.world().Truth(0).clock_error), 50e-6);
  WorldConfig stands = FleetOf(1, 3);
  stands.units[0].clock_error = -1;
  EXPECT_FALSE(World::Validate(stands));
}

TEST(Metrology, SeesFibresWithItsOwnError) {
  Rig rig(FleetOf(10, 100));
  Rng rng(5);
  const auto exact = Expose(rig.world(), {}, &rng);
  const auto seen = Expose(rig.world(), {.centroid_sigma_mm = 0.002}, &rng);
  ASSERT_EQ(seen.size(), 1000u);
  double squares = 0;
  for (std::size_t row = 0; row < 1000; ++row) {
    EXPECT_EQ(exact[row].x_mm, rig.world().Truth(row).x_mm);
    EXPECT_EQ(exact[row].unit, rig.world().units()[row].id);
    squares += std::pow(seen[row].x_mm - exact[row].x_mm, 2) +
               std::pow(seen[row].y_mm - exact[row].y_mm, 2);
  }
  EXPECT_NEAR(std::sqrt(squares / 2000), 0.002, 5 * 0.002 / std::sqrt(4000.0));
}

TEST(World, RefusesUnitsThatCannotBe) {
  const auto complaint = [](auto&& spoil) {
    WorldConfig config = FleetOf(2, 2);
    spoil(&config.units[1]);
    const auto valid = World::Validate(config);
    return valid ? std::string() : valid.error().text;
  };
  using test::DescribeUnit;
  EXPECT_EQ(complaint([](UnitDescription*) {}), "");
  EXPECT_EQ(complaint([](UnitDescription* u) { u->id = {1}; }), "unit 1: stands here twice");
  EXPECT_EQ(complaint([](UnitDescription* u) { u->node = {1}; }),
            "unit 2: bus 0 node 1 is taken already");
  EXPECT_EQ(complaint([](UnitDescription* u) { u->node = {255}; }),
            "unit 2: node 255 is the broadcast address");
  EXPECT_EQ(complaint([](UnitDescription* u) { u->axis[1].max_deg = -10; }),
            "unit 2: phi_min_deg is not below its max");
  EXPECT_EQ(complaint([](UnitDescription* u) { u->axis[0].gear = 0; }),
            "unit 2: theta_gear is not positive");
  EXPECT_EQ(complaint([](UnitDescription* u) { u->base_x_mm = std::nan(""); }),
            "unit 2: theta has a number that is not finite");
  EXPECT_EQ(complaint([](UnitDescription* u) { u->axis[0].gear = 1e9; }),
            "unit 2: theta has more vectors than the wire can carry");
}

// Frames are lost, doubled and late, and power fails anywhere. A start may be missed, never
// doubled.
TEST(World, NoUnitBeginsAMoveTwiceOnBadBuses) {
  const std::uint64_t seed = focalfleet::test::TestSeed(11);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  WorldConfig config = FleetOf(2, 8);
  config.seed = seed;
  Rig rig(std::move(config));
  for (const BusId bus : rig.world().buses())
    *rig.world().disturb().faults(bus) = {
        .drop = 0.1, .duplicate = 0.2, .late = 0.2, .late_by = Milliseconds(30)};
  std::uint64_t begun = 0;
  for (std::uint16_t move = 1; move <= 60; ++move) {
    for (std::uint32_t bus = 0; bus < 2; ++bus)
      for (std::uint8_t node = 1; node <= 8; ++node) {
        const auto way = static_cast<std::int32_t>(rng.Below(600)) - 300;
        (void)rig.StageAndArm(bus, node, MakeMove(move, way, way));
        if (rng.Below(20) == 0) (void)rig.StageAndArm(bus, node, MakeMove(move, way, way));
      }
    for (int again = 0; again < 3; ++again) {
      for (std::uint32_t bus = 0; bus < 2; ++bus) rig.Send(bus, 255, Start{{move}, 100});
      rig.Run(Milliseconds(static_cast<std::int64_t>(rng.Below(40))));
      const UnitId victim{static_cast<std::uint32_t>(1 + rng.Below(16))};
      if (rng.Below(3) == 0) {
        rig.world().disturb().PowerCut(victim);
        rig.Run(Milliseconds(1));
        rig.world().disturb().PowerOn(victim);
      }
    }
    rig.RunWatched(Milliseconds(300));
    for (std::uint32_t bus = 0; bus < 2; ++bus)
      for (std::uint8_t node = 1; node <= 8; ++node)
        for (const Axis axis : kAxes)
          rig.Send(bus, node, ParameterWrite{axis, Parameter::kPosition, 0});
    rig.Run(Milliseconds(60));
  }
  for (std::size_t row = 0; row < 16; ++row) {
    EXPECT_EQ(rig.world().Truth(row).begun_twice, 0u);
    begun += rig.world().Truth(row).moves_begun;
  }
  EXPECT_GT(begun, 100u) << "the test moved nothing";
}

}  // namespace
}  // namespace focalfleet::sim
