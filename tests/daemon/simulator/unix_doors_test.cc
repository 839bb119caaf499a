#include "daemon/simulator/unix_doors.h"

#include <gtest/gtest.h>

#include <functional>

#include "daemon/ports/unix_port.h"
#include "protocol/wire/codec.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet::simulator {
namespace {

using test::ScratchFolder;

// The process is held up for a tenth of a second after every reading of the time. `g_meanwhile` is
// called in the middle of one of these delays.
std::int64_t g_now_ns = 0;
int g_readings_left = 0;
std::function<void(HostInstant)> g_meanwhile;
std::int64_t ReadHeldUp() {
  g_now_ns += Milliseconds(100).ns;
  if (g_readings_left > 0 && --g_readings_left == 0)
    g_meanwhile(HostInstant{g_now_ns} + Milliseconds(50));
  return g_now_ns;
}

sim::WorldConfig OneUnit() {
  sim::UnitDescription unit;
  unit.id = UnitId{1};
  unit.bus = BusId{3};
  unit.node = NodeId{1};
  for (sim::AxisDescription& axis : unit.axis)
    axis = {.arm_mm = 7.4,
            .zero_deg = 0,
            .gear = 890,
            .min_deg = -190,
            .max_deg = 190,
            .angle_deg = {}};
  sim::WorldConfig config;
  config.units = {unit};
  return config;
}

TEST(UnixDoors, AFrameEntersTheWorldNoSoonerThanItWasSent) {
  const ScratchFolder scratch;
  const HostClock clock(1, ReadHeldUp);
  sim::World world(OneUnit());
  const auto doors = UnixDoors::Create({scratch.path(), {BusId{3}}}).value();
  const auto client = UnixPort::Create({.bus = BusId{3}, .path = scratch / "bus3.sock"}).value();
  std::vector<ReceivedFrame> heard;
  const auto turn = [&] {
    world.AdvanceTo(clock.Now(), &heard);
    doors->Exchange(clock, &world);
    world.AdvanceTo(clock.Now(), &heard);
  };
  turn();  // takes the client in
  HostInstant sent;
  g_meanwhile = [&](HostInstant at) {
    sent = at;
    EXPECT_EQ(client->Send(std::vector{Encode(HostMessage(ClockRequest{}), {NodeId{1}, 9})}), 1u);
  };
  for (int behind = 1; behind <= 6; ++behind) {
    g_readings_left = behind;
    heard.clear();
    for (int i = 0; i < 10 && heard.empty(); ++i) turn();
    ASSERT_EQ(heard.size(), 1u) << behind;
    const auto answer = DecodeUnit(heard[0].frame);
    ASSERT_TRUE(answer);
    // A nominal clock is off by at most 50 ppm.
    const double sent_ticks = static_cast<double>(sent.ns) / static_cast<double>(kTick.ns);
    EXPECT_GE(std::get<ClockReply>(answer->message).ticks, sent_ticks * (1 - 50e-6) - 1) << behind;
    EXPECT_GE(heard[0].at, sent) << behind;
  }
}

TEST(UnixDoors, ADeadBusIsDownUntilItIsRevived) {
  const ScratchFolder scratch;
  const HostClock clock;
  sim::World world(OneUnit());
  const auto doors = UnixDoors::Create({scratch.path(), {BusId{3}}}).value();
  const auto port = UnixPort::Create({.bus = BusId{3}, .path = scratch / "bus3.sock"}).value();
  HostInstant now = clock.Now();
  const auto turn = [&] {
    std::vector<ReceivedFrame> heard;
    doors->Exchange(clock, &world);
    now = now + Seconds(1);  // the port tries to connect again
    port->Receive(now, &heard);
    return port->state();
  };
  EXPECT_EQ(turn(), LinkState::kUp);
  EXPECT_EQ(doors->wake_at(), kNever);
  world.disturb().KillBus(BusId{3});
  for (int again = 0; again < 3; ++again) EXPECT_EQ(turn(), LinkState::kDown);
  EXPECT_NE(port->trouble(), "");
  EXPECT_NE(doors->wake_at(), kNever) << "nothing else tells the doors that the bus is back";
  world.disturb().ReviveBus(BusId{3});
  EXPECT_EQ(turn(), LinkState::kUp);
  EXPECT_EQ(doors->wake_at(), kNever);
}

}  // namespace
}  // namespace focalfleet::simulator
