// Frames in batches through a socket that carries `struct can_frame`, one a packet: CAN_RAW and
// SOCK_SEQPACKET look the same here. A batch of 64 costs one system call; on a bus at its limit
// (7.6k frames/s) that is 120 calls a second instead of 7600.
#pragma once

#include <linux/can.h>

#include <optional>
#include <span>
#include <vector>

#include "daemon/ports/pollable_port.h"
#include "protocol/link/frame_port.h"

namespace focalfleet {

can_frame ToSocketFrame(const CanFrame& frame);

/// None where it is anything but an extended data frame: remote, error, 11-bit, or a length past 8.
std::optional<CanFrame> FromSocketFrame(const can_frame& frame);

struct BatchSent {
  std::size_t taken = 0;
  int error = 0;  // errno of the first frame that was refused
};
BatchSent SendFrames(int fd, std::span<const CanFrame> frames);

struct BatchReceived {
  bool closed = false;  // the other end is gone (of a connected socket)
  int error = 0;        // errno that ended it, but EAGAIN
};
/// Reads until nothing is left, at most kFramesPerReceive. Error frames (CAN_ERR_FLAG) go to
/// `errors` where that is given; the rest that is no data frame is counted as rejected.
BatchReceived ReceiveFrames(int fd, const ReceivedFrame& stamp, std::vector<ReceivedFrame>* out,
                            PortCounters* counters, std::vector<can_frame>* errors = nullptr);

/// One bus must not keep the others waiting; what is left makes the descriptor readable again.
inline constexpr std::size_t kFramesPerReceive = 1024;

}  // namespace focalfleet
