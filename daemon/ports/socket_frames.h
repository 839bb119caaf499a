// These functions move frames in batches through a socket that carries `struct can_frame`, one a
// packet. CAN_RAW and SOCK_SEQPACKET look the same here. CAN_RAW may also carry groups of staging
// frames, as `struct canfd_frame`; a receiver of a group gets its single frames. A batch of 64
// costs one system call. On a bus at its limit (7.6k frames/s) that means 120 calls a second
// instead of 7600.
#pragma once

#include <linux/can.h>
#include <sys/socket.h>

#include <optional>
#include <span>
#include <vector>

#include "daemon/clock/clock.h"
#include "daemon/ports/pollable_port.h"
#include "protocol/link/frame_port.h"
#include "protocol/wire/stage_group.h"

namespace focalfleet {

can_frame ToSocketFrame(const CanFrame& frame);

/// The frame; empty for anything but an extended data frame: remote, error, 11-bit, or a length
/// past 8.
std::optional<CanFrame> FromSocketFrame(const can_frame& frame);

struct BatchSent {
  std::size_t taken = 0;
  int error = 0;  // errno of the first frame that was refused
};
BatchSent SendFrames(int fd, std::span<const CanFrame> frames);

canfd_frame ToSocketFrame(const FdFrame& frame);
/// The group; empty where it is no extended data frame, or has a length that CAN FD does not have.
std::optional<FdFrame> FromSocketFrame(const canfd_frame& frame);
/// Sends a group. 0: sent, else the errno with which it was refused.
int SendGroup(int fd, const FdFrame& group);

struct BatchReceived {
  bool closed = false;  // the other end is gone (of a connected socket)
  int error = 0;        // errno that ended the call, except EAGAIN
};

/// The lead of the wall clock over CLOCK_MONOTONIC, as bounds: a reader may be held up between
/// reading the two clocks. The lead changes only where the wall clock steps, since slewing acts on
/// both clocks.
struct WallAhead {
  std::int64_t low_ns = 0;
  std::int64_t high_ns = 0;
};
WallAhead ReadWallAhead();

/// FrameStamps gives the time at which the kernel received a frame, on the host's clock. The kernel
/// stamps with the wall clock, which may step. A stamp therefore counts only between the readings
/// of the socket before and after the frame, and only where both clocks ran alike between these.
/// Otherwise the frame gets the time at which it was read: late, and never too early.
class FrameStamps {
 public:
  /// Pre: no frame can have arrived yet.
  explicit FrameStamps(WallAhead (*read)() = ReadWallAhead)
      : read_(read), last_(read()), since_empty_{last_, last_.low_ns} {}

  /// Records that frames have been read. `before`: a time before the read. `empty`: none were left.
  void HaveRead(HostInstant before, HostInstant after, bool empty);
  /// The time of a frame. Pre: HaveRead was called since this frame was read.
  [[nodiscard]] HostInstant At(std::int64_t wall_ns, const HostClock& clock) const;

 private:
  /// The range that several readings of both clocks have in common, and their lowest bound.
  struct Readings {
    WallAhead common;
    std::int64_t least_ns = 0;
    [[nodiscard]] Readings And(const WallAhead& ahead) const;
    [[nodiscard]] bool alike() const { return common.low_ns <= common.high_ns; }
  };

  WallAhead (*read_)();
  WallAhead last_;
  Readings since_empty_;            // from one before the socket was found empty
  HostInstant emptied_{INT64_MIN};  // frames read next arrived after this
  // Readings around the frames read last.
  Readings around_;
  HostInstant since_{INT64_MIN};
  HostInstant now_;
};

/// As recvmmsg.
using SystemReceive = int (*)(int, mmsghdr*, unsigned, int, timespec*);

/// Aside is what a CAN_RAW socket delivers beside the frames of other nodes.
struct Aside {
  std::vector<can_frame> errors;
  std::size_t confirmed = 0;          // own frames that came back
  std::optional<FrameStamps> stamps;  // set: the kernel stamps frames. To be kept
  bool only_units = false;            // drop frames of other hosts
  bool groups = false;                // CAN FD frames may arrive
  bool no_local = false;  // drop and count frames that another program of this host sent
  /// The system call, for tests: the kernel alone marks frames of this host.
  SystemReceive receive = ::recvmmsg;
};

/// The source of frames and the clock for their stamps. The clock is read after a batch has been
/// read, so a stamp is never before the frame's end, wherever the process is held up.
struct FrameSource {
  BusId bus;
  HostClock clock = HostClock();
};

/// Reads until nothing is left, at most kFramesPerReceive. Packets that are no data frames are
/// counted as rejected, except error frames where `aside` takes them.
BatchReceived ReceiveFrames(int fd, const FrameSource& source, std::vector<ReceivedFrame>* out,
                            PortCounters* counters, Aside* aside = nullptr);

/// The limit keeps one bus from making the others wait; remaining frames make the descriptor
/// readable again.
inline constexpr std::size_t kFramesPerReceive = 1024;

}  // namespace focalfleet
