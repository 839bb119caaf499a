// BusDoors connects the simulated buses to processes outside: by UNIX sockets or by SocketCAN
// interfaces. Both pass frames into the world and carry away the frames of its buses. Neither ever
// waits.
#pragma once

#include <span>
#include <vector>

#include "daemon/clock/clock.h"
#include "protocol/base/instants.h"
#include "sim/world/world.h"

namespace focalfleet::simulator {

class BusDoors {
 public:
  BusDoors() = default;
  BusDoors(const BusDoors&) = delete;
  BusDoors& operator=(const BusDoors&) = delete;
  virtual ~BusDoors() = default;

  /// Readable when Exchange has something to do.
  [[nodiscard]] virtual int fd() const = 0;
  /// The instant at which Exchange must be called though nothing arrived.
  [[nodiscard]] virtual HostInstant wake_at() const = 0;
  /// Injects the frames that have arrived into the world, and sends those that still wait. Frames
  /// from all doors enter the world at one instant, which is read after they were received. No
  /// frame therefore enters before its sender released it, and a delay shifts all buses alike.
  virtual void Exchange(const HostClock& clock, sim::World* world) = 0;
  /// Takes frames that the simulated buses carried, in order.
  virtual void Carry(std::span<const sim::WireFrame> frames) = 0;
};

}  // namespace focalfleet::simulator
