// These tests need no CAN in the kernel; those in tests/can do.
#include "daemon/ports/socketcan_port.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/can/error.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <cstring>
#include <thread>
#include <utility>

#include "protocol/wire/codec.h"
#include "protocol/wire/stage_group.h"

namespace focalfleet {
namespace {

using ::testing::HasSubstr;

can_frame ErrorFrame(std::uint32_t classes, std::uint8_t controller = 0) {
  can_frame frame{};
  frame.can_id = CAN_ERR_FLAG | classes;
  frame.len = CAN_ERR_DLC;
  frame.data[1] = controller;
  return frame;
}

TEST(SocketCanPort, IsDownAndNamesTheInterfaceThatIsMissing) {
  const auto port = SocketCanPort::Create({.bus = BusId{1}, .interface = "nocan7"});
  ASSERT_TRUE(port) << port.error().text;
  EXPECT_EQ((*port)->state(), LinkState::kDown);
  EXPECT_FALSE((*port)->found());
  EXPECT_THAT((*port)->trouble(), HasSubstr("nocan7"));
}

// A socket pair takes the place of the interface as soon as it is `there`.
struct Interface {
  Interface() { EXPECT_EQ(::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK, 0, ends), 0); }
  Interface(const Interface&) = delete;
  Interface& operator=(const Interface&) = delete;
  ~Interface() {
    ::close(ends[0]);
    ::close(ends[1]);
  }
  Result<OpenedInterface> Open(const std::string& name) const {
    if (!there) return Fail(ErrorCode::kUnavailable, "no CAN interface '" + name + "'");
    return OpenedInterface{up ? ::dup(ends[0]) : -1, link};
  }
  int ends[2] = {-1, -1};
  CanLink link;
  bool there = false;
  bool up = true;
};

TEST(SocketCanPort, FindsAnInterfaceThatComesLaterAndCountsOnlyTheNextTimes) {
  Interface interface;
  std::vector<bool> waits;  // for a busy kernel: at the start alone, which it must not spoil
  const auto port =
      SocketCanPort::Create({.bus = BusId{1},
                             .interface = "can7",
                             .open = [&](const std::string& name, const Listening& listening) {
                               waits.push_back(listening.may_wait);
                               return interface.Open(name);
                             }});
  ASSERT_TRUE(port) << port.error().text;
  EXPECT_EQ((*port)->trouble(), "no CAN interface 'can7'");
  std::vector<ReceivedFrame> in;
  const auto receive_at = [&](std::int64_t ms) {
    (*port)->Receive(HostInstant{} + Milliseconds(ms), &in);
    return (*port)->state();
  };
  EXPECT_EQ(receive_at(1000), LinkState::kDown);
  EXPECT_EQ((*port)->wake_at(), HostInstant{} + Milliseconds(1200));
  interface.there = true;
  interface.up = false;
  EXPECT_EQ(receive_at(1100), LinkState::kDown) << "not before its time";
  EXPECT_FALSE((*port)->found());
  EXPECT_EQ(receive_at(1200), LinkState::kDown);
  EXPECT_TRUE((*port)->found());
  EXPECT_EQ((*port)->trouble(), "the interface is down");
  interface.up = true;
  EXPECT_EQ(receive_at(1400), LinkState::kUp);
  EXPECT_EQ((*port)->trouble(), "");
  EXPECT_EQ((*port)->counters().reconnects, 0u) << "the first time it came up";
  EXPECT_EQ(waits, (std::vector<bool>{true, false, false, false}));
  // The other end is closed, so sending is refused.
  ::shutdown(interface.ends[0], SHUT_RDWR);
  const CanFrame frame{.id = 77, .length = 0, .data = {}};
  EXPECT_EQ((*port)->Send({&frame, 1}), 0u);
  EXPECT_EQ((*port)->state(), LinkState::kDown);
  EXPECT_EQ(receive_at(1600), LinkState::kDown) << "told before it may be up again";
  EXPECT_EQ((*port)->wake_at(), HostInstant{} + Milliseconds(1800));
  EXPECT_EQ(receive_at(1800), LinkState::kUp);
  EXPECT_EQ((*port)->counters().reconnects, 1u);
}

TEST(SocketCanPort, RefusesANameThatNoInterfaceCanHave) {
  const auto port = SocketCanPort::Create(
      {.bus = BusId{1},
       .interface = "can7",
       .open = [](const std::string&, const Listening&) -> Result<OpenedInterface> {
         return Fail(ErrorCode::kInvalid, "no CAN interface can be called so");
       }});
  ASSERT_FALSE(port);
  EXPECT_EQ(port.error().code, ErrorCode::kInvalid);
}

std::vector<CanFrame> Frames(std::uint32_t count, std::uint32_t first_id) {
  std::vector<CanFrame> frames;
  for (std::uint32_t i = 0; i < count; ++i)
    frames.push_back({.id = first_id + i, .length = 8, .data = {}});
  return frames;
}

// The frames below the port are those that the kernel still charges, as the other end has not taken
// them.
TEST(SocketCanPort, HandsDownNoMoreThanTheKernelHasLet) {
  Interface interface;
  interface.there = true;
  const auto port = SocketCanPort::Create(
      {.bus = BusId{1},
       .interface = "can7",
       .open = [&](const std::string& name, const Listening&) { return interface.Open(name); }});
  ASSERT_TRUE(port) << port.error().text;
  constexpr std::uint32_t kOrdinaryId = 5u << 26;
  const auto frames = Frames(40, kOrdinaryId);
  const auto take = [&] {
    can_frame frame{};
    return ::recv(interface.ends[1], &frame, sizeof frame, MSG_DONTWAIT) == sizeof frame;
  };
  std::size_t sent = 0;
  std::size_t taken = 0;
  for (int turn = 0; turn < 200 && taken < frames.size(); ++turn) {
    sent += (*port)->Send(std::span(frames).subspan(sent));
    EXPECT_LE(sent - taken, TransmitWindow::kOrdinary);
    // Ordinary frames find no room now; a stop does, but only one.
    if (turn == 3) {
      const auto stops = Frames(2, 0);
      EXPECT_EQ((*port)->Send(stops), 1u);
      EXPECT_TRUE(take());
    }
    if (take()) ++taken;
  }
  EXPECT_EQ(sent, frames.size());
}

TEST(SocketCanPort, RefusesAnotherBitRate) {
  Interface interface;
  interface.there = true;
  interface.link.bit_rate_bps = 500'000;
  const auto open = [&](const std::string& name, const Listening&) { return interface.Open(name); };
  const auto port = SocketCanPort::Create(
      {.bus = BusId{1}, .interface = "can7", .bit_rate_bps = 1'000'000, .open = open});
  ASSERT_FALSE(port);
  EXPECT_EQ(port.error().code, ErrorCode::kRefused);
  EXPECT_EQ(port.error().text, "CAN interface 'can7' has 500000 bit/s, not 1000000");
  interface.link.bit_rate_bps = 1'000'000;
  EXPECT_TRUE(SocketCanPort::Create(
      {.bus = BusId{1}, .interface = "can7", .bit_rate_bps = 1'000'000, .open = open}));
}

TEST(SocketCanPort, DoesNotUseOneThatComesBackWithAnotherBitRate) {
  Interface interface;
  const auto port = SocketCanPort::Create(
      {.bus = BusId{1},
       .interface = "can7",
       .bit_rate_bps = 1'000'000,
       .open = [&](const std::string& name, const Listening&) { return interface.Open(name); }});
  ASSERT_TRUE(port) << port.error().text;
  interface.there = true;
  interface.link.bit_rate_bps = 250'000;
  std::vector<ReceivedFrame> in;
  (*port)->Receive(HostInstant{} + Milliseconds(1000), &in);
  EXPECT_EQ((*port)->state(), LinkState::kDown);
  EXPECT_THAT((*port)->trouble(), HasSubstr("250000 bit/s, not 1000000"));
  interface.link.bit_rate_bps = 1'000'000;
  (*port)->Receive(HostInstant{} + Milliseconds(1200), &in);
  EXPECT_EQ((*port)->state(), LinkState::kUp);
}

class FdPort : public ::testing::Test {
 protected:
  void SetUp() override {
    interface_.there = true;
    interface_.link.mtu = CANFD_MTU;
  }
  Result<std::unique_ptr<SocketCanPort>> Create(const Listening& expected,
                                                std::uint32_t data_bit_rate_bps) {
    return SocketCanPort::Create(
        {.bus = BusId{1},
         .interface = "can7",
         .hears = expected.hears,
         .data_bit_rate_bps = data_bit_rate_bps,
         .open = [this, expected](const std::string& name, const Listening& listening) {
           EXPECT_EQ(listening.hears, expected.hears);
           EXPECT_EQ(listening.groups, expected.groups);
           return interface_.Open(name);
         }});
  }
  void Open(Hears hears = Hears::kUnits) {
    auto port = Create({hears, true}, hears == Hears::kUnits ? 2'000'000 : 0);
    ASSERT_TRUE(port) << port.error().text;
    port_ = std::move(*port);
  }
  /// Taken holds what the other end received: the frames, those of groups included.
  struct Taken {
    std::vector<CanFrame> frames;
    std::vector<std::size_t> sizes;  // frames of each packet; 0: a classic frame
  };
  void TakeOne(Taken* taken) const {
    canfd_frame raw{};
    const ssize_t size = ::recv(interface_.ends[1], &raw, sizeof raw, MSG_DONTWAIT);
    if (size == sizeof(canfd_frame)) {
      EXPECT_EQ(raw.flags & CANFD_BRS, CANFD_BRS);
      const auto group = FromSocketFrame(raw);
      ASSERT_TRUE(group);
      const auto entries = UnpackGroup(*group);
      ASSERT_TRUE(entries) << Name(entries.error());
      taken->sizes.push_back(entries->count);
      taken->frames.insert(taken->frames.end(), entries->frame.begin(),
                           entries->frame.begin() + static_cast<std::ptrdiff_t>(entries->count));
    } else if (size == sizeof(can_frame)) {
      can_frame classic{};
      std::memcpy(&classic, &raw, sizeof classic);
      taken->sizes.push_back(0);
      taken->frames.push_back(FromSocketFrame(classic).value());
    }
  }
  Taken SendAll(std::span<const CanFrame> frames) {
    Taken taken;
    std::size_t sent = 0;
    for (int turn = 0; turn < 1000 && taken.frames.size() < frames.size(); ++turn) {
      sent += port_->Send(frames.subspan(sent));
      EXPECT_LE(sent - taken.frames.size(), TransmitWindow::kOrdinary * kGroupEntriesMax);
      TakeOne(&taken);
    }
    EXPECT_EQ(sent, frames.size());
    return taken;
  }
  void Write(const FdFrame& group) const {
    const canfd_frame raw = ToSocketFrame(group);
    ASSERT_EQ(::send(interface_.ends[1], &raw, sizeof raw, 0), static_cast<ssize_t>(sizeof raw));
  }

  Interface interface_;
  std::unique_ptr<SocketCanPort> port_;
};

CanFrame ConfirmTo(std::uint8_t node) {
  return Encode(HostMessage(Confirm{MoveId{1}}), {NodeId{node}, 1});
}
CanFrame SegmentTo(std::uint8_t node) {
  return Encode(HostMessage(StageSegment{Axis::kPhi, 0, {0, 100, 37}}), {NodeId{node}, 0});
}
CanFrame ArmTo(std::uint8_t node) {
  return Encode(HostMessage(Arm{MoveId{1}, 7}), {NodeId{node}, 2});
}

TEST_F(FdPort, PutsWhatIsStagedIntoGroupsInOrderAndNothingElse) {
  Open();
  std::vector<CanFrame> frames;
  for (std::uint8_t node = 0; node < 7; ++node) frames.push_back(SegmentTo(node));
  frames.push_back(ArmTo(9));
  frames.push_back(ConfirmTo(10));
  frames.push_back(ArmTo(11));
  for (std::uint8_t node = 20; node < 33; ++node) frames.push_back(ConfirmTo(node));
  const Taken taken = SendAll(frames);
  EXPECT_EQ(taken.frames, frames);
  // Five segments fill a group. A segment that is left alone goes as a classic frame, as does a
  // frame that no group carries.
  EXPECT_EQ(taken.sizes, (std::vector<std::size_t>{5, 2, 0, 0, 0, 12, 0}));
}

TEST_F(FdPort, WithoutCanFdEverythingGoesAlone) {
  interface_.link.mtu = CAN_MTU;
  auto port = Create({Hears::kUnits, false}, 0);
  ASSERT_TRUE(port) << port.error().text;
  port_ = std::move(*port);
  const std::vector<CanFrame> frames(6, ConfirmTo(1));
  EXPECT_EQ(SendAll(frames).sizes, std::vector<std::size_t>(6, 0));
}

TEST_F(FdPort, AGroupTakesOnePlaceBelowAndAStopStillFindsItsOwn) {
  Open();
  // A single classic frame shows how much the kernel charges for a frame.
  Taken taken;
  const CanFrame arm = ArmTo(1);
  ASSERT_EQ(port_->Send({&arm, 1}), 1u);
  TakeOne(&taken);
  const std::vector<CanFrame> frames(60, SegmentTo(3));
  std::size_t sent = 0;
  for (int turn = 0; turn < 20 && sent < 20; ++turn) {
    sent += port_->Send(std::span(frames).subspan(sent));
    if (sent < 20) TakeOne(&taken);
  }
  // The window is full: at most two groups are below.
  while (port_->Send(std::span(frames).subspan(sent, 5)) > 0) sent += 5;
  EXPECT_LE(sent - (taken.frames.size() - 1), 10u);
  const CanFrame stop = Encode(HostMessage(Stop{}), {NodeId{3}, 1});
  EXPECT_EQ(port_->Send({&stop, 1}), 1u);
  EXPECT_EQ(port_->Send({&stop, 1}), 0u);
}

TEST_F(FdPort, RefusesAnInterfaceWithoutCanFd) {
  interface_.link.mtu = CAN_MTU;
  interface_.link.kind = "vcan";
  auto port = Create({Hears::kUnits, true}, 2'000'000);
  ASSERT_FALSE(port);
  EXPECT_EQ(port.error().code, ErrorCode::kRefused);
  EXPECT_EQ(port.error().text,
            "CAN interface 'can7' carries no CAN FD: its MTU is 16, not 72 (`ip link set can7 mtu "
            "72`)");
  interface_.link.kind = "can";
  port = Create({Hears::kUnits, true}, 2'000'000);
  ASSERT_FALSE(port);
  EXPECT_EQ(port.error().text,
            "CAN interface 'can7' carries no CAN FD: its MTU is 16, not 72 (`ip link set can7 type "
            "can ... dbitrate 2000000 fd on`)");
}

TEST_F(FdPort, RefusesAnotherDataBitRate) {
  interface_.link.data_bit_rate_bps = 5'000'000;
  const auto port = Create({Hears::kUnits, true}, 2'000'000);
  ASSERT_FALSE(port);
  EXPECT_EQ(port.error().code, ErrorCode::kRefused);
  EXPECT_EQ(port.error().text,
            "CAN interface 'can7' has 5000000 bit/s for the data of CAN FD frames, not 2000000");
  interface_.link.data_bit_rate_bps = 2'000'000;
  EXPECT_TRUE(Create({Hears::kUnits, true}, 2'000'000));
}

TEST_F(FdPort, UnitsHearAGroupAsItsFramesAndAHostHearsNone) {
  const std::vector<CanFrame> frames{SegmentTo(1), ConfirmTo(1), ConfirmTo(2)};
  FdFrame group;
  ASSERT_EQ(PackGroup(frames, &group), 3u);
  FdFrame broken = group;
  broken.data[2] = 0xff;
  std::vector<ReceivedFrame> in;
  Open(Hears::kHosts);
  Write(group);
  Write(broken);
  port_->Receive(HostInstant{1}, &in);
  std::vector<CanFrame> heard;
  for (const ReceivedFrame& one : in) heard.push_back(one.frame);
  EXPECT_EQ(heard, frames);
  EXPECT_EQ(port_->counters().rejected, 1u);

  in.clear();
  Open(Hears::kUnits);
  Write(group);
  port_->Receive(HostInstant{1}, &in);
  EXPECT_TRUE(in.empty()) << "another host's";
  EXPECT_EQ(port_->counters().rejected, 0u);
}

TEST_F(FdPort, AHostThatIsNotSetUpForGroupsRejectsThem) {
  auto port = Create({Hears::kUnits, false}, 0);
  ASSERT_TRUE(port) << port.error().text;
  FdFrame group;
  const std::vector<CanFrame> frames(2, ConfirmTo(2));
  ASSERT_EQ(PackGroup(frames, &group), 2u);
  Write(group);
  std::vector<ReceivedFrame> in;
  (*port)->Receive(HostInstant{1}, &in);
  EXPECT_TRUE(in.empty());
  EXPECT_EQ((*port)->counters().rejected, 1u);
}

// The error frames are as the controller's driver would write them.
class TroubledPort : public ::testing::Test {
 protected:
  void SetUp() override { Open(); }
  void Open() {
    interface_.there = true;
    auto port =
        SocketCanPort::Create({.bus = BusId{1},
                               .interface = "can7",
                               .open = [this](const std::string& name,
                                              const Listening&) { return interface_.Open(name); },
                               .revive = [this]() -> Status {
                                 ++attempts_;
                                 if (works_) return {};
                                 return Fail(ErrorCode::kRefused, "no privilege to restart it");
                               }});
    ASSERT_TRUE(port) << port.error().text;
    port_ = std::move(*port);
  }
  void Write(const can_frame& frame) const {
    ASSERT_EQ(::send(interface_.ends[1], &frame, sizeof frame, 0),
              static_cast<ssize_t>(sizeof frame));
  }
  void ReceiveAt(std::int64_t ms) { port_->Receive(HostInstant{} + Milliseconds(ms), &in_); }
  /// An attempt is due at `ms`; returns the time at which the port had its outcome. The attempt has
  /// a thread of its own, so the number of the port's calls until then varies.
  std::int64_t AwaitAttempt(int number, std::int64_t ms) {
    ReceiveAt(ms);
    while (attempts_ < number) std::this_thread::yield();
    while (port_->wake_at() <= HostInstant{} + Milliseconds(ms + 10)) ReceiveAt(ms += 10);
    return ms;
  }

  Interface interface_;
  std::unique_ptr<SocketCanPort> port_;
  std::vector<ReceivedFrame> in_;
  std::atomic<int> attempts_{0};
  std::atomic<bool> works_{false};
};

TEST_F(TroubledPort, NamesStateAndCause) {
  can_frame lonely = ErrorFrame(CAN_ERR_ACK);
  Write(lonely);
  Write(lonely);
  can_frame bit = ErrorFrame(CAN_ERR_PROT);
  bit.data[2] = CAN_ERR_PROT_BIT0;
  Write(bit);
  Write(ErrorFrame(CAN_ERR_CRTL, CAN_ERR_CRTL_TX_WARNING));
  ReceiveAt(1);
  EXPECT_EQ(port_->state(), LinkState::kUp);
  EXPECT_EQ(port_->trouble(), "the controller warns of errors (no acknowledgement, bit error)");
  Write(ErrorFrame(CAN_ERR_CRTL, CAN_ERR_CRTL_TX_PASSIVE));
  ReceiveAt(2);
  EXPECT_EQ(port_->state(), LinkState::kPassive);
  EXPECT_EQ(port_->trouble(), "the controller is error-passive (no acknowledgement, bit error)");
  Write(ErrorFrame(CAN_ERR_CRTL, CAN_ERR_CRTL_ACTIVE));
  ReceiveAt(3);
  EXPECT_EQ(port_->state(), LinkState::kUp);
  EXPECT_EQ(port_->trouble(), "");
  EXPECT_EQ(port_->counters().link_errors, 6u);
}

TEST_F(TroubledPort, WarnsNoMoreWhenTheControllerIsWellAgain) {
  for (int time = 0; time < 2; ++time) {  // the second warning is reported like the first
    Write(ErrorFrame(CAN_ERR_CRTL, CAN_ERR_CRTL_TX_WARNING));
    ReceiveAt(10 * time + 1);
    EXPECT_EQ(port_->trouble(), "the controller warns of errors");
    Write(ErrorFrame(CAN_ERR_CRTL, CAN_ERR_CRTL_ACTIVE));
    ReceiveAt(10 * time + 2);
    EXPECT_EQ(port_->state(), LinkState::kUp);
    EXPECT_EQ(port_->trouble(), "");
  }
}

TEST_F(TroubledPort, IsBroughtBackFromBusOffAgainAndAgain) {
  Write(ErrorFrame(CAN_ERR_BUSOFF));
  ReceiveAt(1000);
  EXPECT_EQ(port_->state(), LinkState::kOff);
  const CanFrame frame{.id = 77, .length = 0, .data = {}};
  EXPECT_EQ(port_->Send({&frame, 1}), 0u);
  ReceiveAt(1999);
  EXPECT_EQ(attempts_, 0) << "not before its time";
  std::int64_t at = AwaitAttempt(1, 2000);
  EXPECT_EQ(port_->trouble(), "the controller is bus-off; no privilege to restart it");
  works_ = true;
  ReceiveAt(at + 1999);
  EXPECT_EQ(attempts_, 1) << "twice the first wait";
  at = AwaitAttempt(2, at + 2000);
  Write(ErrorFrame(CAN_ERR_RESTARTED));
  ReceiveAt(at += 100);
  EXPECT_EQ(port_->state(), LinkState::kUp);
  EXPECT_EQ(port_->trouble(), "");
  // The controller is off again at once, so the next attempt waits longer than the last.
  Write(ErrorFrame(CAN_ERR_BUSOFF));
  ReceiveAt(at);
  ReceiveAt(at + 3999);
  EXPECT_EQ(attempts_, 2);
  AwaitAttempt(3, at + 4000);
}

TEST_F(TroubledPort, LeavesTheRestartToAKernelThatDoesIt) {
  interface_.link.restart_ms = 100;
  Open();
  Write(ErrorFrame(CAN_ERR_BUSOFF));
  ReceiveAt(1000);
  EXPECT_EQ(port_->state(), LinkState::kOff);
  ReceiveAt(100'000);
  EXPECT_EQ(attempts_, 0);
}

TEST(SocketCanPort, ReadsTheControllersStateFromErrorFrames) {
  EXPECT_EQ(LinkStateOf(ErrorFrame(CAN_ERR_BUSOFF)), LinkState::kOff);
  EXPECT_EQ(LinkStateOf(ErrorFrame(CAN_ERR_RESTARTED)), LinkState::kUp);
  EXPECT_EQ(LinkStateOf(ErrorFrame(CAN_ERR_CRTL, CAN_ERR_CRTL_TX_PASSIVE)), LinkState::kPassive);
  EXPECT_EQ(LinkStateOf(ErrorFrame(CAN_ERR_CRTL, CAN_ERR_CRTL_RX_PASSIVE)), LinkState::kPassive);
  EXPECT_EQ(LinkStateOf(ErrorFrame(CAN_ERR_CRTL, CAN_ERR_CRTL_ACTIVE)), LinkState::kUp);
  EXPECT_EQ(LinkStateOf(ErrorFrame(CAN_ERR_CRTL, CAN_ERR_CRTL_RX_OVERFLOW)), std::nullopt);
  EXPECT_EQ(LinkStateOf(ErrorFrame(CAN_ERR_TX_TIMEOUT)), std::nullopt);
}

}  // namespace
}  // namespace focalfleet
