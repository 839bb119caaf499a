// The door between the coordinator and a bus. SocketCAN, a UNIX socket and the in-process simulated
// bus implement it, and the core cannot distinguish them. A port never blocks: it refuses the
// frames that it cannot take now, and the caller keeps them.
#pragma once

#include <span>
#include <vector>

#include "protocol/base/ids.h"
#include "protocol/base/instants.h"
#include "protocol/wire/can_frame.h"

namespace focalfleet {

struct ReceivedFrame {
  BusId bus;
  HostInstant at;  // not before the end of the frame, and possibly later
  CanFrame frame;
};

enum class LinkState : std::uint8_t { kUp, kPassive, kOff, kDown };
constexpr const char* Name(LinkState state) {
  constexpr const char* kNames[] = {"up", "passive", "off", "down"};
  return kNames[static_cast<std::size_t>(state)];
}

class FramePort {
 public:
  FramePort() = default;
  FramePort(const FramePort&) = delete;
  FramePort& operator=(const FramePort&) = delete;
  virtual ~FramePort() = default;

  /// Returns how many of `frames` were taken, from the front. Fewer than all: the link is full or
  /// down.
  virtual std::size_t Send(std::span<const CanFrame> frames) = 0;

  /// Appends the frames that have arrived, without waiting. Frames that arrive during the call are
  /// later than `now`.
  virtual void Receive(HostInstant now, std::vector<ReceivedFrame>* out) = 0;

  [[nodiscard]] virtual LinkState state() const = 0;
};

}  // namespace focalfleet
