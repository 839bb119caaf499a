// Where the simulated buses meet the processes outside: UNIX sockets or SocketCAN interfaces. Both
// take frames for the world and carry away what its buses carried; neither ever waits for anybody.
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
  /// When Exchange wants to be called though nothing came.
  [[nodiscard]] virtual HostInstant wake_at() const = 0;
  /// Puts what has arrived into the world, and sends what still waits to be sent. What came from
  /// all doors enters the world at one time, read after it had been taken in: never before its
  /// sender let it go, and however long that took, all buses later by the same.
  virtual void Exchange(const HostClock& clock, sim::World* world) = 0;
  /// Frames that the simulated buses carried, in order.
  virtual void Carry(std::span<const sim::WireFrame> frames) = 0;
};

}  // namespace focalfleet::simulator
