// Frames in batches through a socket that carries `struct can_frame`, one a packet: CAN_RAW and
// SOCK_SEQPACKET look the same here. CAN_RAW may carry groups of staging frames beside them, as
// `struct canfd_frame`; whoever hears a group gets the frames that it is made of. A batch of 64
// costs one system call; on a bus at its limit (7.6k frames/s) that is 120 calls a second instead
// of 7600.
#pragma once

#include <linux/can.h>

#include <optional>
#include <span>
#include <vector>

#include "daemon/clock/clock.h"
#include "daemon/ports/pollable_port.h"
#include "protocol/link/frame_port.h"
#include "protocol/wire/stage_group.h"

namespace focalfleet {

can_frame ToSocketFrame(const CanFrame& frame);

/// None where it is anything but an extended data frame: remote, error, 11-bit, or a length past 8.
std::optional<CanFrame> FromSocketFrame(const can_frame& frame);

struct BatchSent {
  std::size_t taken = 0;
  int error = 0;  // errno of the first frame that was refused
};
BatchSent SendFrames(int fd, std::span<const CanFrame> frames);

canfd_frame ToSocketFrame(const FdFrame& frame);
/// None where it is no extended data frame, or has a length that CAN FD does not have.
std::optional<FdFrame> FromSocketFrame(const canfd_frame& frame);
/// 0, or the errno with which it was refused.
int SendGroup(int fd, const FdFrame& group);

struct BatchReceived {
  bool closed = false;  // the other end is gone (of a connected socket)
  int error = 0;        // errno that ended it, but EAGAIN
};

/// By how much the wall clock is ahead of CLOCK_MONOTONIC: within these, because a reader may be
/// held up between reading the one and the other. It changes only where the wall clock steps: what
/// slews one of them slews both.
struct WallAhead {
  std::int64_t low_ns = 0;
  std::int64_t high_ns = 0;
};
WallAhead ReadWallAhead();

/// When the kernel took frames in, on the host's clock. The kernel stamps with the wall clock,
/// which may step. So a stamp counts only where it lies between the readings of the socket before
/// and behind the frame, and where both clocks ran alike from the one to the other. Otherwise the
/// frame has the time at which it had been read: late, and never too early.
class FrameStamps {
 public:
  /// To be made before frames can come.
  explicit FrameStamps(WallAhead (*read)() = ReadWallAhead)
      : read_(read), last_(read()), since_empty_{last_, last_.low_ns} {}

  /// Frames have been read. `before`: a time from before that. `empty`: none were left.
  void HaveRead(HostInstant before, HostInstant after, bool empty);
  /// Pre: HaveRead, since this frame was read.
  [[nodiscard]] HostInstant At(std::int64_t wall_ns, const HostClock& clock) const;

 private:
  /// What several readings of both clocks have in common, and the least of them.
  struct Readings {
    WallAhead common;
    std::int64_t least_ns = 0;
    [[nodiscard]] Readings And(const WallAhead& ahead) const;
    [[nodiscard]] bool alike() const { return common.low_ns <= common.high_ns; }
  };

  WallAhead (*read_)();
  WallAhead last_;
  Readings since_empty_;            // from one before the socket was found empty on
  HostInstant emptied_{INT64_MIN};  // whatever is read next came in later
  // Of the frames read last.
  Readings around_;
  HostInstant since_{INT64_MIN};
  HostInstant now_;
};

/// What a CAN_RAW socket tells beside the frames of others.
struct Aside {
  std::vector<can_frame> errors;
  std::size_t confirmed = 0;          // our own frames that came back
  std::optional<FrameStamps> stamps;  // given: frames are stamped by the kernel. To be kept
  bool only_units = false;            // of others' frames, drop those of hosts
  bool groups = false;                // CAN FD frames may come
};

/// Whose frames are read, and what they are stamped by: the clock is read after a batch has been,
/// so that a stamp is never before the frame's end, wherever the process is held up.
struct FrameSource {
  BusId bus;
  HostClock clock = HostClock();
};

/// Reads until nothing is left, at most kFramesPerReceive. What is no data frame is counted as
/// rejected, but for error frames where `aside` takes them.
BatchReceived ReceiveFrames(int fd, const FrameSource& source, std::vector<ReceivedFrame>* out,
                            PortCounters* counters, Aside* aside = nullptr);

/// One bus must not keep the others waiting; what is left makes the descriptor readable again.
inline constexpr std::size_t kFramesPerReceive = 1024;

}  // namespace focalfleet
