// CanDoors uses one SocketCAN interface a bus. The interface arbitrates and takes its own time, so
// the world passes frames at once. Frames that the interface cannot take now (ENOBUFS) are kept and
// tried again. A CAN FD group is taken apart at the door: each unit gets its frames as if they had
// come alone.
#pragma once

#include <deque>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "daemon/ports/socketcan_port.h"
#include "daemon/simulator/bus_doors.h"

namespace focalfleet::simulator {

class CanDoors : public BusDoors {
 public:
  struct Options {
    std::vector<std::string> interfaces;  // Shape: as buses
    std::vector<BusId> buses;
    HostClock clock = HostClock();
  };
  /// The doors on all interfaces.
  /// Errors: kInvalid where the numbers differ; kUnavailable, names the interface.
  static Result<std::unique_ptr<CanDoors>> Create(const Options& options);
  ~CanDoors() override;

  [[nodiscard]] int fd() const override { return epoll_; }
  [[nodiscard]] HostInstant wake_at() const override { return wake_at_; }
  void Exchange(const HostClock& clock, sim::World* world) override;
  void Carry(std::span<const sim::WireFrame> frames) override;

 private:
  struct Door {
    BusId bus;
    std::unique_ptr<SocketCanPort> port;
    std::deque<CanFrame> waiting;
    std::uint64_t lost = 0;
  };
  explicit CanDoors(int epoll) : epoll_(epoll) {}
  static void Write(Door* door);

  int epoll_;
  HostInstant wake_at_ = kNever;
  std::vector<Door> doors_;
  std::map<BusId, std::size_t> door_of_bus_;
};

}  // namespace focalfleet::simulator
