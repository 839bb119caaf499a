// These tests run SocketCanPort on a controller that does not give frames back. The driver is the
// kernel's own slcan driver, with this test as the controller at the other end of the serial line.
// The controller takes every frame at once and sends their bits one after the other, as a
// controller with a deep memory does. Frames that it has not finished are below the socket. The
// clock of the wire is the test's, so a guest that is late changes nothing.
#include <gtest/gtest.h>
#include <net/if.h>
#include <poll.h>
#include <pty.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <thread>
#include <vector>

#include "daemon/ports/socketcan_port.h"
#include "protocol/base/rng.h"
#include "protocol/wire/codec.h"
#include "protocol/wire/frame_bits.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

constexpr int kDisciplineSlcan = 17;
constexpr std::uint32_t kBitRateBps = 1'000'000;
constexpr int kPatienceMs = 10'000;  // a hang ends here; nothing is timed

class Controller {
 public:
  Controller() {
    termios raw{};
    cfmakeraw(&raw);
    raw.c_cflag |= CS8 | CREAD | CLOCAL;
    cfsetspeed(&raw, B3000000);
    if (openpty(&master_, &slave_, nullptr, &raw, nullptr) != 0) return;
    if (ioctl(slave_, TIOCSETD, &kDisciplineSlcan) != 0) return;
    ifreq request{};
    if (ioctl(slave_, SIOCGIFNAME, &request) != 0) return;
    name_ = request.ifr_name;
  }
  Controller(const Controller&) = delete;
  Controller& operator=(const Controller&) = delete;
  ~Controller() {
    close(slave_);
    close(master_);
  }

  /// The interface. Empty: this kernel has no slcan, or the test lacks the privilege.
  [[nodiscard]] const std::string& name() const { return name_; }

  /// Runs `command`, which waits for the driver, which waits for the line to be read. Returns its
  /// exit code.
  int Run(const std::string& command) {
    std::atomic<int> code{-1};
    const std::jthread thread([&] { code = std::system(command.c_str()); });
    while (code < 0) Read(10);
    return code;
  }

  /// Records frames that were handed down just now. Their bits follow those of the frames before
  /// them.
  void Took(std::span<const CanFrame> frames, HostInstant now) {
    for (const CanFrame& frame : frames) {
      const HostInstant idle = ends_.empty() ? now : std::max(now, ends_.back());
      ends_.push_back(idle + BitTime(FrameBits(frame), kBitRateBps));
    }
  }
  [[nodiscard]] std::size_t Unfinished(HostInstant now) const {
    return static_cast<std::size_t>(
        std::ranges::count_if(ends_, [now](HostInstant end) { return end > now; }));
  }

  /// The identifiers in the order of the serial line, once this many frames have come through it.
  const std::vector<std::uint32_t>& Await(std::size_t frames) {
    while (ids_.size() < frames && Read(kPatienceMs)) {
    }
    return ids_;
  }

 private:
  bool Read(int wait_ms) {
    pollfd wait{master_, POLLIN, 0};
    if (poll(&wait, 1, wait_ms) <= 0) return false;
    std::array<char, 256> text{};
    const ssize_t got = read(master_, text.data(), text.size());
    for (ssize_t i = 0; i < got; ++i) Hear(text.at(static_cast<std::size_t>(i)));
    return got > 0;
  }

  void Hear(char c) {
    if (c != '\r') {
      line_ += c;
      return;
    }
    // The text "Tiiiiiiiild.." is an extended frame. All other lines are about the controller
    // itself.
    if (line_.size() >= 10 && line_[0] == 'T')
      ids_.push_back(static_cast<std::uint32_t>(std::stoul(line_.substr(1, 8), nullptr, 16)));
    line_.clear();
  }

  int master_ = -1;
  int slave_ = -1;
  std::string name_;
  std::string line_;
  std::vector<std::uint32_t> ids_;
  std::vector<HostInstant> ends_;
};

TEST(SlcanBus, AtMostThreeOfOursAreBelowAndAStopWaitsForTwo) {
  Controller controller;
  if (controller.name().empty()) GTEST_SKIP() << "no slcan here";
  const std::string link = "ip link set " + controller.name();
  ASSERT_EQ(controller.Run(link + " type can bitrate 1000000 && " + link + " up"), 0);
  HostInstant now{1};
  const auto opened = SocketCanPort::Create(
      {.bus = {3}, .interface = controller.name(), .wire_clock = [&now] { return now; }});
  ASSERT_TRUE(opened) << opened.error().text;
  SocketCanPort& port = **opened;
  ASSERT_EQ(port.link().bit_rate_bps, kBitRateBps);
  ASSERT_FALSE(port.link().echoes) << "its frames are to be counted by the bit clock";

  const CanFrame stop = Encode(HostMessage(Stop{}), {kBroadcastNode, 0});
  const CanFrame other = Encode(HostMessage(StageSegment{Axis::kTheta, 1, {5, 6, 7}}), {{4}, 0});
  const std::array<CanFrame, 8> batch{other, other, other, other, other, other, other, other};
  const std::uint64_t seed = test::TestSeed(11);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  constexpr std::size_t kFrames = 3000;
  std::size_t sent = 0;
  std::size_t below_max = 0;
  std::array<int, 4> stops_by_wait{};
  std::vector<std::size_t> stops;  // places on the wire
  // Returns how many of the host's frames were ahead, where the frame was taken.
  const auto hand_down = [&](std::span<const CanFrame> frames) {
    const std::size_t ahead = controller.Unfinished(now);
    const std::size_t taken = port.Send(frames);
    controller.Took(frames.first(taken), now);
    below_max = std::max(below_max, controller.Unfinished(now));
    sent += taken;
    controller.Await(sent);  // the kernel itself keeps none back
    return std::pair(taken, ahead);
  };
  while (sent < kFrames) {
    // The test repeats as the daemon does, and sometimes late.
    if (hand_down(batch).first == 0) now = now + port.retry_full();
    if (rng.Below(10) > 0) continue;
    now = now + Microseconds(static_cast<std::int64_t>(rng.Below(400)));
    const std::size_t place = sent;
    const auto [taken, ahead] = hand_down({&stop, 1});
    ASSERT_EQ(taken, 1u) << "there is always a place for a stop";
    stops.push_back(place);
    ++stops_by_wait.at(ahead);
  }
  EXPECT_EQ(controller.Await(sent).size(), sent);
  for (const std::size_t place : stops) EXPECT_EQ(controller.Await(sent)[place], stop.id);
  EXPECT_EQ(below_max, TransmitWindow::kAll);
  EXPECT_EQ(stops_by_wait[3], 0);
  std::printf(
      "%zu frames, at most %zu below the socket; stops that waited for 0, 1, 2 frames: %d, %d, "
      "%d\n",
      sent, below_max, stops_by_wait[0], stops_by_wait[1], stops_by_wait[2]);
}

}  // namespace
}  // namespace focalfleet
