#include "daemon/simulator/unix_doors.h"

#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <utility>

#include "daemon/control/unix_address.h"
#include "daemon/ports/socket_frames.h"

namespace focalfleet::simulator {
namespace {

/// Limit of waiting frames on a bus. Beyond it the clients of the bus are not read until half of
/// them are through.
constexpr std::size_t kPauseFrames = 2048;
/// Some seconds of a saturated bus; a client so far behind does not read at all.
constexpr std::size_t kClientFramesMax = 65'536;
constexpr std::uint64_t kListenerTag = std::uint64_t{1} << 32;

bool HasListener(const UnixAddress& address) {
  const int fd = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (fd < 0) return false;
  const bool answered = ::connect(fd, address.get(), address.length()) == 0 || errno == EAGAIN;
  ::close(fd);
  return answered;
}

tl::unexpected<Error> Unavailable(const std::string& path, const char* what) {
  return Fail(ErrorCode::kUnavailable, path + ": " + what + ": " + std::strerror(errno));
}

}  // namespace

Result<std::unique_ptr<UnixDoors>> UnixDoors::Create(const Options& options) {
  std::error_code failed;
  std::filesystem::create_directories(options.directory, failed);
  if (failed)
    return Fail(ErrorCode::kUnavailable,
                options.directory + ": cannot make the directory: " + failed.message());
  const int epoll = ::epoll_create1(EPOLL_CLOEXEC);
  if (epoll < 0) return Unavailable(options.directory, "no epoll");
  std::unique_ptr<UnixDoors> doors(new UnixDoors(epoll));
  for (const BusId bus : options.buses) {
    doors->listeners_.push_back(
        {.bus = bus, .path = options.directory + "/bus" + std::to_string(bus.value) + ".sock"});
    FOCALFLEET_TRY(doors->Listen(doors->listeners_.size() - 1));
  }
  return doors;
}

UnixDoors::~UnixDoors() {
  for (const auto& [id, client] : clients_) ::close(client.fd);
  for (const Listener& listener : listeners_) {
    if (listener.fd < 0) continue;  // the path may be another's
    ::close(listener.fd);
    ::unlink(listener.path.c_str());
  }
  ::close(epoll_);
}

Status UnixDoors::Listen(std::size_t listener) {
  const std::string& path = listeners_[listener].path;
  FOCALFLEET_TRY_ASSIGN(const UnixAddress address, UnixAddress::Of(path));
  if (HasListener(address))
    return Fail(ErrorCode::kRefused, path + " is in use: another simulation answers there");
  ::unlink(path.c_str());
  const int fd = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (fd < 0) return Unavailable(path, "no socket");
  epoll_event event{};
  event.events = EPOLLIN;
  event.data.u64 = kListenerTag | listener;
  const char* const failed = ::bind(fd, address.get(), address.length()) != 0 ||
                                     ::chmod(path.c_str(), 0660) != 0 || ::listen(fd, 16) != 0
                                 ? "cannot listen"
                             : ::epoll_ctl(epoll_, EPOLL_CTL_ADD, fd, &event) != 0 ? "cannot watch"
                                                                                   : nullptr;
  if (failed != nullptr) {
    const auto error = Unavailable(path, failed);
    ::close(fd);
    return error;
  }
  listeners_[listener].fd = fd;
  return {};
}

void UnixDoors::FollowBuses(const HostClock& clock, const sim::World& world) {
  // A revived bus is noticed so soon; until then nothing else might wake the doors.
  constexpr DurationNs kLookEvery = Milliseconds(100);
  wake_at_ = kNever;
  for (std::size_t n = 0; n < listeners_.size(); ++n) {
    Listener& listener = listeners_[n];
    if (!world.dead(listener.bus)) {
      if (listener.fd >= 0) continue;
      const Status open = Listen(n);
      if (!open && !std::exchange(listener.reported, true))
        std::fprintf(stderr, "focalfleet-sim: %s\n", open.error().text.c_str());
      if (open) listener.reported = false;
    } else if (listener.fd >= 0) {
      const std::vector<std::uint32_t> clients = clients_of_bus_[listener.bus];
      for (const std::uint32_t id : clients) Drop(id, "");
      ::close(listener.fd);
      ::unlink(listener.path.c_str());
      listener.fd = -1;
    }
    if (listener.fd < 0) wake_at_ = clock.Now() + clock.Real(kLookEvery);
  }
}

void UnixDoors::Accept(std::size_t listener) {
  for (;;) {
    const int fd =
        ::accept4(listeners_[listener].fd, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (fd < 0) {
      if ((errno == EMFILE || errno == ENFILE) && !reported_no_descriptors_) {
        reported_no_descriptors_ = true;
        std::fprintf(stderr, "focalfleet-sim: no descriptors left for another client of %s\n",
                     listeners_[listener].path.c_str());
      }
      return;
    }
    const std::uint32_t id = next_client_++;
    Client& client = clients_[id];
    client.id = id;
    client.bus = listener;
    client.fd = fd;
    clients_of_bus_[listeners_[listener].bus].push_back(id);
    Watch(client, EPOLL_CTL_ADD);
  }
}

void UnixDoors::Watch(const Client& client, int operation) const {
  epoll_event event{};
  event.events = (client.reading ? EPOLLIN : 0u) | (client.waiting.empty() ? 0u : EPOLLOUT);
  event.data.u64 = client.id;
  ::epoll_ctl(epoll_, operation, client.fd, &event);
}

void UnixDoors::Drop(std::uint32_t id, const std::string& why) {
  const auto found = clients_.find(id);
  if (found == clients_.end()) return;
  const Listener& listener = listeners_[found->second.bus];
  if (!why.empty())
    std::fprintf(stderr, "focalfleet-sim: dropped a client of %s: %s\n", listener.path.c_str(),
                 why.c_str());
  ::close(found->second.fd);
  std::erase(clients_of_bus_[listener.bus], id);
  clients_.erase(found);
}

void UnixDoors::Read(Client* client) {
  const BusId bus = listeners_[client->bus].bus;
  PortCounters counters;
  const BatchReceived batch = ReceiveFrames(client->fd, {bus}, &received_, &counters);
  senders_.resize(received_.size(), client->id);
  if (counters.rejected > 0)
    std::fprintf(stderr, "focalfleet-sim: bus %u: %llu packets are no extended CAN data frames\n",
                 bus.value, static_cast<unsigned long long>(counters.rejected));
  if (batch.closed) return Drop(client->id, "");
  if (batch.error != 0 && batch.error != ECONNRESET)
    return Drop(client->id, std::strerror(batch.error));
  if (batch.error == ECONNRESET) Drop(client->id, "");
}

void UnixDoors::Write(Client* client) {
  while (!client->waiting.empty()) {
    std::array<CanFrame, 64> batch{};
    const std::size_t count = std::min(batch.size(), client->waiting.size());
    std::copy_n(client->waiting.begin(), count, batch.begin());
    const BatchSent sent = SendFrames(client->fd, {batch.data(), count});
    client->waiting.erase(client->waiting.begin(),
                          client->waiting.begin() + static_cast<std::ptrdiff_t>(sent.taken));
    if (sent.error == EAGAIN || sent.error == ENOBUFS) return;
    // The client is gone; the next read finds that and clears it away.
    if (sent.error != 0) return client->waiting.clear();
  }
}

void UnixDoors::Exchange(const HostClock& clock, sim::World* world) {
  received_.clear();
  senders_.clear();
  std::array<epoll_event, 64> events{};
  const int count = ::epoll_wait(epoll_, events.data(), static_cast<int>(events.size()), 0);
  for (int i = 0; i < count; ++i) {
    const epoll_event& event = events[static_cast<std::size_t>(i)];
    if ((event.data.u64 & kListenerTag) != 0) {
      Accept(event.data.u64 & ~kListenerTag);
      continue;
    }
    const auto id = static_cast<std::uint32_t>(event.data.u64);
    const auto found = clients_.find(id);
    if (found == clients_.end()) continue;
    if ((event.events & EPOLLOUT) != 0) {
      Write(&found->second);
      if (found->second.waiting.empty()) Watch(found->second, EPOLL_CTL_MOD);
    }
    if ((event.events & (EPOLLIN | EPOLLHUP | EPOLLERR)) != 0) Read(&found->second);
  }
  const HostInstant at = clock.Now();
  for (std::size_t i = 0; i < received_.size(); ++i)
    world->Inject(received_[i].bus, received_[i].frame, at, senders_[i]);
  FollowBuses(clock, *world);
  SetPace(world);
}

void UnixDoors::SetPace(sim::World* world) {
  for (auto& [id, client] : clients_) {
    const std::size_t waiting = world->waiting(listeners_[client.bus].bus);
    const bool reading = client.reading ? waiting <= kPauseFrames : waiting < kPauseFrames / 2;
    if (reading == client.reading) continue;
    client.reading = reading;
    Watch(client, EPOLL_CTL_MOD);
  }
}

void UnixDoors::Carry(std::span<const sim::WireFrame> frames) {
  for (const sim::WireFrame& frame : frames) {
    const auto found = clients_of_bus_.find(frame.bus);
    if (found == clients_of_bus_.end()) continue;
    for (const std::uint32_t id : found->second)
      if (frame.from_unit || frame.client != id) clients_[id].waiting.push_back(frame.frame);
  }
  std::vector<std::uint32_t> late;
  for (auto& [id, client] : clients_) {
    if (client.waiting.empty()) continue;
    Write(&client);
    if (client.waiting.size() > kClientFramesMax) late.push_back(id);
    if (!client.waiting.empty()) Watch(client, EPOLL_CTL_MOD);
  }
  for (const std::uint32_t id : late)
    Drop(id, "it does not read, and " + std::to_string(kClientFramesMax) + " frames wait for it");
}

}  // namespace focalfleet::simulator
