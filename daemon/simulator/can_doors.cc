#include "daemon/simulator/can_doors.h"

#include <sys/epoll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>

namespace focalfleet::simulator {
namespace {
/// No event reports room in a full queue, so it is tried again. A bus at its limit carries 8 frames
/// in this time.
constexpr DurationNs kRetry = Milliseconds(1);
constexpr std::size_t kWaitingMax = 16'384;
}  // namespace

Result<std::unique_ptr<CanDoors>> CanDoors::Create(const Options& options) {
  if (options.interfaces.size() != options.buses.size())
    return Fail(ErrorCode::kInvalid, std::to_string(options.interfaces.size()) +
                                         " interfaces are given for " +
                                         std::to_string(options.buses.size()) + " buses");
  const int epoll = ::epoll_create1(EPOLL_CLOEXEC);
  if (epoll < 0)
    return Fail(ErrorCode::kUnavailable, std::string("no epoll: ") + std::strerror(errno));
  std::unique_ptr<CanDoors> doors(new CanDoors(epoll));
  for (std::size_t i = 0; i < options.buses.size(); ++i) {
    SocketCanPort::Options port_options;
    port_options.bus = options.buses[i];
    port_options.interface = options.interfaces[i];
    port_options.hears = Hears::kHosts;
    port_options.clock = options.clock;
    FOCALFLEET_TRY_ASSIGN(auto port, SocketCanPort::Create(port_options));
    if (port->state() == LinkState::kDown)
      return Fail(ErrorCode::kUnavailable,
                  port->found()
                      ? "CAN interface '" + options.interfaces[i] + "': " + port->trouble()
                      : port->trouble());
    epoll_event event{};
    event.events = EPOLLIN;
    event.data.u64 = i;
    if (::epoll_ctl(epoll, EPOLL_CTL_ADD, port->fd(), &event) != 0)
      return Fail(ErrorCode::kUnavailable, options.interfaces[i] + ": " + std::strerror(errno));
    doors->door_of_bus_[options.buses[i]] = i;
    doors->doors_.push_back({options.buses[i], std::move(port), {}, 0});
  }
  return doors;
}

CanDoors::~CanDoors() { ::close(epoll_); }

void CanDoors::Write(Door* door) {
  while (!door->waiting.empty()) {
    std::array<CanFrame, 64> batch{};
    const std::size_t count = std::min(batch.size(), door->waiting.size());
    std::copy_n(door->waiting.begin(), count, batch.begin());
    const std::size_t taken = door->port->Send({batch.data(), count});
    door->waiting.erase(door->waiting.begin(),
                        door->waiting.begin() + static_cast<std::ptrdiff_t>(taken));
    if (taken < count) return;
  }
}

void CanDoors::Exchange(const HostClock& clock, sim::World* world) {
  const HostInstant now = clock.Now();
  std::array<epoll_event, 64> events{};
  const int count = ::epoll_wait(epoll_, events.data(), static_cast<int>(events.size()), 0);
  std::vector<ReceivedFrame> received;
  for (int i = 0; i < count; ++i)
    doors_[events[static_cast<std::size_t>(i)].data.u64].port->Receive(now, &received);
  wake_at_ = kNever;
  for (Door& door : doors_) {
    if (door.port->wake_at() <= now) door.port->Receive(now, &received);
    if (!door.waiting.empty()) Write(&door);
    wake_at_ = std::min(wake_at_, door.port->wake_at());
    if (!door.waiting.empty()) wake_at_ = std::min(wake_at_, now + kRetry);
  }
  const HostInstant at = clock.Now();
  for (const ReceivedFrame& frame : received) world->Inject(frame.bus, frame.frame, at);
}

void CanDoors::Carry(std::span<const sim::WireFrame> frames) {
  for (const sim::WireFrame& frame : frames) {
    if (!frame.from_unit) continue;  // the interface carried it already
    Door& door = doors_[door_of_bus_.at(frame.bus)];
    if (door.waiting.size() < kWaitingMax) {
      door.waiting.push_back(frame.frame);
    } else if (door.lost++ == 0) {
      std::fprintf(stderr, "focalfleet-sim: %s takes no frames; answers are lost\n",
                   door.port->name().c_str());
    }
  }
  for (Door& door : doors_) {
    if (door.waiting.empty()) continue;
    Write(&door);
    if (!door.waiting.empty()) wake_at_ = HostInstant{0};
  }
}

}  // namespace focalfleet::simulator
