// The door between the coordinator and a bus. SocketCAN, a UNIX socket and the in-process simulated
// bus are three implementations; the core cannot tell which. A port never blocks: what it cannot
// take now it refuses, and the caller keeps it.
#pragma once

#include <span>
#include <vector>

#include "protocol/base/ids.h"
#include "protocol/base/instants.h"
#include "protocol/wire/can_frame.h"

namespace focalfleet {

struct ReceivedFrame {
  BusId bus;
  HostInstant at;  // the frame had ended by then, however long its reader was held up
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

  /// How many of `frames` were taken, from the front. Fewer than all: the link is full or down.
  virtual std::size_t Send(std::span<const CanFrame> frames) = 0;

  /// Appends what has arrived; never waits. Frames that arrived while it ran are later than `now`.
  virtual void Receive(HostInstant now, std::vector<ReceivedFrame>* out) = 0;

  [[nodiscard]] virtual LinkState state() const = 0;
};

}  // namespace focalfleet
