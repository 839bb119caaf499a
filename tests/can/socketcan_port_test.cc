// These tests run SocketCanPort on real interfaces: with-can starts them with vcan0 and vcan1 up.
// Without these there is nothing to test.
#include "daemon/ports/socketcan_port.h"

#include <gtest/gtest.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstring>
#include <memory>
#include <vector>

#include "protocol/wire/codec.h"
#include "tests/protocol/random_messages.h"

namespace focalfleet {
namespace {

constexpr int kPatienceMs = 10'000;  // a hang ends here; nothing is timed

std::unique_ptr<SocketCanPort> Open(const char* interface, Hears hears = Hears::kUnits) {
  auto port = SocketCanPort::Create({.bus = {3}, .interface = interface, .hears = hears});
  EXPECT_TRUE(port) << port.error().text;
  return port ? std::move(*port) : nullptr;
}

// Identifiers of functions that exist; bit 19 gives the sender's side.
constexpr std::uint32_t kFromHost = 10u << 20;
constexpr std::uint32_t kFromUnit = kFromHost | 1u << 19;

std::size_t SendAll(SocketCanPort& port, std::span<const CanFrame> frames) {
  std::size_t sent = 0;
  std::vector<ReceivedFrame> in;
  while (sent < frames.size()) {
    sent += port.Send(frames.subspan(sent));
    if (sent == frames.size()) break;
    // Confirmations make room; where the driver gives none there is always room.
    pollfd wait{port.fd(), POLLIN, 0};
    if (poll(&wait, 1, kPatienceMs) <= 0) break;
    port.Receive(HostInstant{1}, &in);
  }
  EXPECT_TRUE(in.empty());
  return sent;
}

std::vector<CanFrame> Receive(SocketCanPort& port, std::size_t count) {
  std::vector<ReceivedFrame> in;
  while (in.size() < count) {
    pollfd wait{port.fd(), POLLIN, 0};
    if (poll(&wait, 1, kPatienceMs) <= 0) break;
    port.Receive(HostInstant{1}, &in);
  }
  std::vector<CanFrame> frames;
  for (const ReceivedFrame& received : in) {
    EXPECT_EQ(received.bus, BusId{3});
    frames.push_back(received.frame);
  }
  return frames;
}

void RaiseInterface(const char* interface, bool up) {
  const int fd = socket(AF_INET, SOCK_DGRAM, 0);
  ifreq request{};
  std::strcpy(request.ifr_name, interface);
  ASSERT_EQ(ioctl(fd, SIOCGIFFLAGS, &request), 0);
  request.ifr_flags =
      static_cast<short>(up ? request.ifr_flags | IFF_UP : request.ifr_flags & ~IFF_UP);
  ASSERT_EQ(ioctl(fd, SIOCSIFFLAGS, &request), 0);
  close(fd);
}

// Another program's socket on the bus, which may write frames that this project never would.
class Stranger {
 public:
  explicit Stranger(const char* interface) : fd_(socket(PF_CAN, SOCK_RAW, CAN_RAW)) {
    sockaddr_can address{};
    address.can_family = AF_CAN;
    address.can_ifindex = static_cast<int>(if_nametoindex(interface));
    const auto* raw = static_cast<const sockaddr*>(static_cast<const void*>(&address));
    EXPECT_EQ(bind(fd_, raw, sizeof address), 0);
  }
  Stranger(const Stranger&) = delete;
  Stranger& operator=(const Stranger&) = delete;
  ~Stranger() { close(fd_); }
  void Write(std::uint32_t id, std::uint8_t length) const {
    can_frame frame{};
    frame.can_id = id;
    frame.can_dlc = length;
    EXPECT_EQ(write(fd_, &frame, sizeof frame), static_cast<ssize_t>(sizeof frame));
  }

 private:
  int fd_;
};

TEST(SocketCanPort, CarriesEveryMessageBitByBitInOrder) {
  const auto host = Open("vcan0", Hears::kUnits);
  const auto units = Open("vcan0", Hears::kHosts);
  ASSERT_TRUE(host && units);
  Rng rng(1);
  std::vector<CanFrame> down;
  std::vector<CanFrame> up;
  for (std::uint8_t i = 0; i < 200; ++i) {
    down.push_back(Encode(test::RandomHost(rng), {{i}, i}));
    up.push_back(Encode(test::RandomUnit(rng), {{i}, i}));
  }
  ASSERT_EQ(SendAll(*host, down), down.size());
  ASSERT_EQ(SendAll(*units, up), up.size());
  EXPECT_EQ(Receive(*units, down.size()), down);
  EXPECT_EQ(Receive(*host, up.size()), up);
}

TEST(SocketCanPort, HearsNeitherItselfNorOthersOfItsSide) {
  const auto a = Open("vcan0", Hears::kUnits);
  const auto b = Open("vcan0", Hears::kUnits);
  const auto units = Open("vcan0", Hears::kHosts);
  ASSERT_TRUE(a && b && units);
  const CanFrame from_host{kFromHost | 1, 1, {1}};
  const CanFrame from_unit{kFromUnit | 2, 1, {2}};
  ASSERT_EQ(a->Send({&from_host, 1}), 1u);
  ASSERT_EQ(b->Send({&from_host, 1}), 1u);
  ASSERT_EQ(units->Send({&from_unit, 1}), 1u);
  EXPECT_EQ(Receive(*a, 1), std::vector{from_unit});
  EXPECT_EQ(Receive(*units, 2), (std::vector{from_host, from_host}));
}

// The kernel's stamp is on the host's clock: between two readings of it.
TEST(SocketCanPort, FramesAreStampedWhenTheyComeIn) {
  const HostClock clock;
  const auto host = Open("vcan0", Hears::kUnits);
  const auto units = Open("vcan0", Hears::kHosts);
  ASSERT_TRUE(host && units);
  const CanFrame frame{kFromUnit, 0, {}};
  const HostInstant before = clock.Now();
  ASSERT_EQ(units->Send({&frame, 1}), 1u);
  const HostInstant after = clock.Now();
  std::vector<ReceivedFrame> in;
  pollfd wait{host->fd(), POLLIN, 0};
  ASSERT_EQ(poll(&wait, 1, kPatienceMs), 1);
  while (clock.Now() < after + Milliseconds(20)) continue;  // read late
  host->Receive(clock.Now(), &in);
  ASSERT_EQ(in.size(), 1u);
  EXPECT_GE(in[0].at, before);
  // Where the reader of both clocks was held up between them, the stamp is later by that delay.
  EXPECT_LE(in[0].at, after + Milliseconds(5));
}

TEST(SocketCanPort, InterfacesAreSeparateBuses) {
  const auto zero = Open("vcan0");
  const auto one = Open("vcan1");
  const auto listener = Open("vcan1", Hears::kHosts);
  ASSERT_TRUE(zero && one && listener);
  const CanFrame wrong{kFromHost | 1, 0, {}};
  const CanFrame right{kFromHost | 2, 0, {}};
  ASSERT_EQ(zero->Send({&wrong, 1}), 1u);
  ASSERT_EQ(one->Send({&right, 1}), 1u);
  EXPECT_EQ(Receive(*listener, 1), std::vector{right});
}

TEST(SocketCanPort, ForeignFramesNeverReachTheCore) {
  const auto port = Open("vcan0");
  ASSERT_TRUE(port);
  const Stranger stranger("vcan0");
  stranger.Write(0x123, 2);                                    // 11-bit
  stranger.Write(kFromUnit | CAN_EFF_FLAG | CAN_RTR_FLAG, 2);  // remote
  stranger.Write(kFromHost | CAN_EFF_FLAG, 2);                 // from a host
  stranger.Write(kFromUnit | 1u << 25 | CAN_EFF_FLAG, 2);      // no such function
  stranger.Write(kFromUnit | 7 | CAN_EFF_FLAG, 2);             // a frame of this project
  const auto heard = Receive(*port, 1);
  ASSERT_EQ(heard.size(), 1u);
  EXPECT_EQ(heard[0].id, kFromUnit | 7);
}

TEST(SocketCanPort, ADownInterfaceIsALinkStateAndComesBack) {
  const auto port = Open("vcan1");
  const auto peer = Open("vcan1");
  ASSERT_TRUE(port && peer);
  EXPECT_EQ(port->state(), LinkState::kUp);
  RaiseInterface("vcan1", false);
  std::vector<ReceivedFrame> in;
  const CanFrame frame{kFromHost, 0, {}};
  EXPECT_EQ(port->Send({&frame, 1}), 0u) << "refused, the caller keeps it";
  port->Receive(HostInstant{1}, &in);
  EXPECT_EQ(port->state(), LinkState::kDown);
  EXPECT_FALSE(port->trouble().empty());
  RaiseInterface("vcan1", true);
  HostInstant now{1};
  for (int i = 0; i < 100 && port->state() != LinkState::kUp; ++i) {
    now = now + Milliseconds(250);  // the port's retries follow the instants that it is given
    port->Receive(now, &in);
    peer->Receive(now, &in);
  }
  EXPECT_EQ(port->state(), LinkState::kUp);
  EXPECT_EQ(port->Send({&frame, 1}), 1u);
}

TEST(SocketCanPort, AMissingInterfaceIsDownAndNamed) {
  const auto port = SocketCanPort::Create({.bus = {0}, .interface = "vcan77"});
  ASSERT_TRUE(port) << port.error().text;
  EXPECT_EQ((*port)->state(), LinkState::kDown);
  EXPECT_FALSE((*port)->found());
  EXPECT_NE((*port)->trouble().find("no CAN interface 'vcan77'"), std::string::npos);
}

TEST(SocketCanPort, ANameThatNoInterfaceCanHaveIsRefused) {
  const auto port = SocketCanPort::Create({.bus = {0}, .interface = "vcan-of-a-long-name"});
  ASSERT_FALSE(port);
  EXPECT_EQ(port.error().code, ErrorCode::kInvalid);
}

}  // namespace
}  // namespace focalfleet
