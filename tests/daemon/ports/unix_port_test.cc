#include "daemon/ports/unix_port.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <functional>
#include <vector>

#include "daemon/control/unix_address.h"
#include "daemon/ports/socket_frames.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using test::ScratchFolder;
using ::testing::HasSubstr;

/// The listener is the simulator's end of one bus.
class Listener {
 public:
  explicit Listener(const std::string& path) {
    const auto address = UnixAddress::Of(path).value();
    ::unlink(path.c_str());
    fd_ = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK, 0);
    EXPECT_EQ(::bind(fd_, address.get(), address.length()), 0);
    EXPECT_EQ(::listen(fd_, 4), 0);
  }
  ~Listener() {
    Hang();
    ::close(fd_);
  }
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;

  void Accept() {
    peer_ = ::accept4(fd_, nullptr, nullptr, SOCK_NONBLOCK);
    EXPECT_GE(peer_, 0);
  }
  void Hang() {
    if (peer_ >= 0) ::close(peer_);
    peer_ = -1;
  }
  void Send(const CanFrame& frame) const {
    const can_frame raw = ToSocketFrame(frame);
    EXPECT_EQ(::send(peer_, &raw, sizeof raw, 0), static_cast<ssize_t>(sizeof raw));
  }
  [[nodiscard]] std::vector<CanFrame> Receive() const {
    std::vector<ReceivedFrame> received;
    PortCounters counters;
    ReceiveFrames(peer_, {.bus = {}}, &received, &counters);
    std::vector<CanFrame> frames;
    for (const ReceivedFrame& r : received) frames.push_back(r.frame);
    return frames;
  }

 private:
  int fd_ = -1;
  int peer_ = -1;
};

constexpr CanFrame kFrame{.id = 77, .length = 1, .data = {5}};

std::unique_ptr<UnixPort> Open(const std::string& path) {
  auto port = UnixPort::Create({.bus = BusId{3}, .path = path, .retry_period = Milliseconds(200)});
  EXPECT_TRUE(port) << port.error().text;
  return std::move(*port);
}
std::vector<ReceivedFrame> ReceiveAt(UnixPort* port, std::int64_t ms) {
  std::vector<ReceivedFrame> out;
  port->Receive(HostInstant{} + Milliseconds(ms), &out);
  return out;
}
bool Readable(int fd) {
  pollfd poller{fd, POLLIN, 0};
  return ::poll(&poller, 1, 0) == 1;
}

TEST(UnixPort, CarriesFramesBothWays) {
  const ScratchFolder scratch;
  Listener listener(scratch / "bus3.sock");
  const auto port = Open(scratch / "bus3.sock");
  listener.Accept();
  EXPECT_EQ(port->state(), LinkState::kUp);
  EXPECT_EQ(port->counters().reconnects, 0u);
  EXPECT_EQ(port->Send(std::vector<CanFrame>{kFrame, kFrame}), 2u);
  EXPECT_EQ(listener.Receive().size(), 2u);
  EXPECT_FALSE(Readable(port->fd()));
  listener.Send(kFrame);
  EXPECT_TRUE(Readable(port->fd()));
  const auto received = ReceiveAt(port.get(), 1);
  ASSERT_EQ(received.size(), 1u);
  EXPECT_EQ(received[0].frame, kFrame);
  EXPECT_EQ(received[0].bus, BusId{3});
}

// The process is held up for a tenth of a second after every reading of the time. A frame comes in
// the middle of the delay.
std::int64_t g_held_up_ns = 0;
std::function<void(HostInstant)> g_meanwhile;
std::int64_t ReadHeldUp() {
  g_held_up_ns += Milliseconds(100).ns;
  if (g_meanwhile) g_meanwhile(HostInstant{g_held_up_ns} + Milliseconds(50));
  return g_held_up_ns;
}

TEST(UnixPort, AFrameThatWasReadLateIsNotStampedEarlier) {
  const ScratchFolder scratch;
  Listener listener(scratch / "bus3.sock");
  const HostClock clock(1, ReadHeldUp);
  const auto port =
      UnixPort::Create({.bus = BusId{3}, .path = scratch / "bus3.sock", .clock = clock}).value();
  listener.Accept();
  std::vector<HostInstant> sent;
  g_meanwhile = [&](HostInstant at) {
    listener.Send(kFrame);
    sent.push_back(at);
  };
  std::vector<ReceivedFrame> received;
  for (int turn = 0; turn < 3; ++turn) port->Receive(clock.Now(), &received);
  g_meanwhile = nullptr;
  ASSERT_GE(received.size(), 3u);
  for (std::size_t i = 0; i < received.size(); ++i) EXPECT_GE(received[i].at, sent[i]) << i;
}

TEST(UnixPort, IsDownUntilTheSimulatorIsThere) {
  const ScratchFolder scratch;
  const auto port = Open(scratch / "bus3.sock");
  EXPECT_EQ(port->state(), LinkState::kDown);
  EXPECT_THAT(port->trouble(), HasSubstr("cannot connect"));
  EXPECT_EQ(port->Send(std::vector<CanFrame>{kFrame}), 0u);
  ReceiveAt(port.get(), 1000);
  EXPECT_EQ(port->wake_at(), HostInstant{} + Milliseconds(1200));
  Listener listener(scratch / "bus3.sock");
  ReceiveAt(port.get(), 1100);
  EXPECT_EQ(port->state(), LinkState::kDown) << "not before its time";
  ReceiveAt(port.get(), 1200);
  EXPECT_EQ(port->state(), LinkState::kUp);
  EXPECT_EQ(port->wake_at(), kNever);
}

TEST(UnixPort, SurvivesThePeersDeathAndConnectsAgain) {
  const ScratchFolder scratch;
  Listener listener(scratch / "bus3.sock");
  const auto port = Open(scratch / "bus3.sock");
  const int fd = port->fd();
  listener.Accept();
  listener.Send(kFrame);
  listener.Hang();
  EXPECT_TRUE(Readable(port->fd()));
  EXPECT_EQ(ReceiveAt(port.get(), 10).size(), 1u) << "its last words are heard";
  EXPECT_EQ(port->state(), LinkState::kDown);
  EXPECT_THAT(port->trouble(), HasSubstr("closed"));
  EXPECT_EQ(port->Send(std::vector<CanFrame>{kFrame}), 0u);
  ReceiveAt(port.get(), 210);
  listener.Accept();
  EXPECT_EQ(port->state(), LinkState::kUp);
  EXPECT_EQ(port->fd(), fd) << "the event loop goes on watching the same descriptor";
  listener.Send(kFrame);
  EXPECT_TRUE(Readable(port->fd()));
  EXPECT_EQ(ReceiveAt(port.get(), 220).size(), 1u);
  EXPECT_EQ(port->counters().reconnects, 1u);
}

TEST(UnixPort, NoticesAtSendingThatThePeerDied) {
  const ScratchFolder scratch;
  Listener listener(scratch / "bus3.sock");
  const auto port = Open(scratch / "bus3.sock");
  listener.Accept();
  listener.Hang();
  EXPECT_EQ(port->Send(std::vector<CanFrame>{kFrame}), 0u);
  EXPECT_EQ(port->state(), LinkState::kDown);
}

TEST(UnixPort, TakesAPartWhenThePeerDoesNotReadAndTheRestLater) {
  const ScratchFolder scratch;
  Listener listener(scratch / "bus3.sock");
  const auto port = Open(scratch / "bus3.sock");
  listener.Accept();
  const std::vector<CanFrame> many(20'000, kFrame);
  std::size_t sent = port->Send(many);
  EXPECT_LT(sent, many.size());
  EXPECT_EQ(port->state(), LinkState::kUp) << "full is not broken";
  EXPECT_FALSE(Readable(port->fd()));
  std::size_t received = 0;
  for (int i = 0; i < 10'000 && received < many.size(); ++i) {
    received += listener.Receive().size();
    // Room to send wakes the loop as a frame would.
    if (sent < many.size() && Readable(port->fd()))
      sent += port->Send(std::span(many).subspan(sent));
  }
  EXPECT_EQ(received, many.size());
}

TEST(UnixPort, RefusesAPathThatIsTooLong) {
  const auto port = UnixPort::Create({.bus = BusId{1}, .path = std::string(200, 'p')});
  ASSERT_FALSE(port);
  EXPECT_EQ(port.error().code, ErrorCode::kInvalid);
}

}  // namespace
}  // namespace focalfleet
