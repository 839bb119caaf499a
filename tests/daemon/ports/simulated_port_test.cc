#include "daemon/ports/simulated_port.h"

#include <gtest/gtest.h>

#include "protocol/wire/codec.h"

namespace focalfleet {
namespace {

Layout TwoUnitsOnTwoBuses() {
  std::vector<Unit> units(2);
  for (std::uint32_t n = 0; n < 2; ++n) {
    units[n].id = UnitId{n + 1};
    units[n].base_fp = {25.6 * n, 0};
    units[n].axis = {AxisGeometry{7.4, 0, 890, -190, 190}, AxisGeometry{7.4, 0, 890, 0, 190}};
    units[n].bus = BusId{n};
    units[n].node = NodeId{1};
  }
  return Layout::Create(std::move(units), {}).value();
}

TEST(SimulatedPort, UnitAnswersOnItsOwnBus) {
  const Layout layout = TwoUnitsOnTwoBuses();
  sim::WorldConfig config;
  config.units = DescribeUnits(layout);
  const auto fleet = SimulatedFleet::Create(std::move(config)).value();
  SimulatedPort zero(fleet, BusId{0});
  SimulatedPort one(fleet, BusId{1});
  const std::vector<CanFrame> ask{Encode(HostMessage(IdentifyRequest{}), {kBroadcastNode, 9})};
  EXPECT_EQ(zero.Send(ask), 1u);
  EXPECT_NE(zero.wake_at(), kNever) << "the frame is on its way";
  std::vector<ReceivedFrame> received;
  zero.Receive(HostInstant{} + Milliseconds(100), &received);
  one.Receive(HostInstant{} + Milliseconds(100), &received);
  ASSERT_EQ(received.size(), 1u);
  EXPECT_EQ(received[0].bus, BusId{0});
  EXPECT_TRUE(DecodeUnit(received[0].frame));
}

TEST(SimulatedPort, WhatWasHeardWhileAnotherBusWasAskedIsDueAtOnce) {
  const Layout layout = TwoUnitsOnTwoBuses();
  sim::WorldConfig config;
  config.units = DescribeUnits(layout);
  const auto fleet = SimulatedFleet::Create(std::move(config)).value();
  SimulatedPort zero(fleet, BusId{0});
  SimulatedPort one(fleet, BusId{1});
  const std::vector<CanFrame> ask{Encode(HostMessage(IdentifyRequest{}), {kBroadcastNode, 9})};
  EXPECT_EQ(one.Send(ask), 1u);
  const HostInstant later = HostInstant{} + Milliseconds(100);
  std::vector<ReceivedFrame> received;
  zero.Receive(later, &received);
  EXPECT_TRUE(received.empty());
  EXPECT_LE(one.wake_at(), later);
  one.Receive(later, &received);
  EXPECT_EQ(received.size(), 1u);
}

std::int64_t g_now_ns = 0;

// A world in which all units rest has no event; its clock stays at the last event.
TEST(SimulatedPort, AFrameIsNotThereBeforeItWasSent) {
  const Layout layout = TwoUnitsOnTwoBuses();
  sim::WorldConfig config;
  config.units = DescribeUnits(layout);
  const HostClock clock(1, [] { return g_now_ns; });
  const auto fleet = SimulatedFleet::Create(std::move(config), clock).value();
  SimulatedPort port(fleet, BusId{0});
  g_now_ns = Milliseconds(2000).ns;
  EXPECT_EQ(port.Send(std::vector{Encode(HostMessage(ClockRequest{}), {NodeId{1}, 9})}), 1u);
  std::vector<ReceivedFrame> received;
  port.Receive(HostInstant{} + Milliseconds(2100), &received);
  ASSERT_EQ(received.size(), 1u);
  EXPECT_GE(received[0].at, HostInstant{} + Milliseconds(2000));
  const auto answer = DecodeUnit(received[0].frame);
  ASSERT_TRUE(answer);
  EXPECT_GE(std::get<ClockReply>(answer->message).ticks, 19'990u);
}

TEST(SimulatedPort, RefusesUnitsThatTheSimulationCannotHave) {
  const Layout layout = TwoUnitsOnTwoBuses();
  sim::WorldConfig config;
  config.units = DescribeUnits(layout);
  config.units[1].id = config.units[0].id;
  EXPECT_FALSE(SimulatedFleet::Create(std::move(config)));
}

TEST(SimulatedPort, ADeadBusIsDownAndTakesNothing) {
  const Layout layout = TwoUnitsOnTwoBuses();
  sim::WorldConfig config;
  config.units = DescribeUnits(layout);
  const auto fleet = SimulatedFleet::Create(std::move(config)).value();
  SimulatedPort port(fleet, BusId{0});
  EXPECT_EQ(port.state(), LinkState::kUp);
  fleet->world().disturb().KillBus(BusId{0});
  EXPECT_EQ(port.state(), LinkState::kDown);
  EXPECT_EQ(port.Send(std::vector<CanFrame>{CanFrame{}}), 0u);
}

// The words are those of a SocketCAN port, because the coordinator shows them to people.
TEST(SimulatedPort, TellsHowItsControllerStandsByTheInterfaceOfARealOne) {
  const Layout layout = TwoUnitsOnTwoBuses();
  sim::WorldConfig config;
  config.units = DescribeUnits(layout);
  const auto fleet = SimulatedFleet::Create(std::move(config)).value();
  SimulatedPort port(fleet, BusId{0});
  SimulatedPort well(fleet, BusId{1});
  std::vector<ReceivedFrame> received;
  HostInstant now{};
  const auto run = [&](DurationNs duration) {
    now = now + duration;
    port.Receive(now, &received);
    well.Receive(now, &received);
  };
  run(Milliseconds(1));
  EXPECT_EQ(port.trouble(), "");
  // The only other node leaves, so no node acknowledges.
  fleet->world().disturb().PowerCut(UnitId{1});
  const std::vector<CanFrame> ask{Encode(HostMessage(IdentifyRequest{}), {kBroadcastNode, 9})};
  EXPECT_EQ(port.Send(ask), 1u);
  run(Microseconds(1100));
  EXPECT_EQ(port.state(), LinkState::kUp);
  EXPECT_EQ(port.trouble(), "the controller warns of errors (no acknowledgement)");
  run(Milliseconds(100));
  EXPECT_EQ(port.state(), LinkState::kPassive);
  EXPECT_EQ(port.trouble(), "the controller is error-passive (no acknowledgement)");
  EXPECT_GT(port.counters().link_errors, 100u);
  fleet->world().disturb().ThrowHostOff(BusId{0});
  run(Milliseconds(1));
  EXPECT_EQ(port.state(), LinkState::kOff);
  EXPECT_EQ(port.trouble(), "the controller is bus-off (no acknowledgement)");
  EXPECT_EQ(port.Send(ask), 0u);
  fleet->world().disturb().PowerOn(UnitId{1});
  run(Milliseconds(1100));
  EXPECT_EQ(port.state(), LinkState::kUp);
  EXPECT_EQ(port.trouble(), "");
  EXPECT_EQ(port.Send(ask), 1u);
  received.clear();
  run(Milliseconds(10));
  EXPECT_EQ(received.size(), 1u);
  EXPECT_EQ(well.state(), LinkState::kUp);
  EXPECT_EQ(well.counters().link_errors, 0u);
}

}  // namespace
}  // namespace focalfleet
