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

#include "daemon/clock.h"
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

/// When the kernel took a frame in, on the host's clock. The kernel stamps with the wall clock.
struct FrameStamps {
  HostInstant now;
  std::int64_t wall_ahead_ns = 0;  // of CLOCK_MONOTONIC
  HostClock clock;

  /// Never later than now; older than kOldest is a step of the wall clock: now.
  [[nodiscard]] HostInstant At(std::int64_t wall_ns) const;
  static constexpr DurationNs kOldest = Milliseconds(2000);  // of real time
};

/// What a CAN_RAW socket tells beside the frames of others.
struct Aside {
  std::vector<can_frame> errors;
  std::size_t confirmed = 0;          // our own frames that came back
  std::optional<FrameStamps> stamps;  // given: frames are stamped by the kernel
  bool only_units = false;            // of others' frames, drop those of hosts
  bool groups = false;                // CAN FD frames may come
};

/// Reads until nothing is left, at most kFramesPerReceive. What is no data frame is counted as
/// rejected, but for error frames where `aside` takes them.
BatchReceived ReceiveFrames(int fd, const ReceivedFrame& stamp, std::vector<ReceivedFrame>* out,
                            PortCounters* counters, Aside* aside = nullptr);

/// One bus must not keep the others waiting; what is left makes the descriptor readable again.
inline constexpr std::size_t kFramesPerReceive = 1024;

}  // namespace focalfleet
