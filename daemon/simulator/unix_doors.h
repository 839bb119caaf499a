// UnixDoors has one SOCK_SEQPACKET socket a bus, <directory>/bus<ID>.sock; a packet is one `struct
// can_frame`. Any number of clients may connect. A client's frame goes onto the simulated bus. When
// it has won arbitration it goes to the units and to all other clients.
//
// While a bus has many frames waiting its clients are not read, so they follow the pace of the bus.
// A client that does not read its frames is dropped, which is reported on stderr.
//
// The socket of a dead bus is gone, so its clients see the link down as they would see an interface
// that left, until the bus is revived.
#pragma once

#include <deque>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "daemon/simulator/bus_doors.h"
#include "protocol/base/result.h"

namespace focalfleet::simulator {

class UnixDoors : public BusDoors {
 public:
  struct Options {
    std::string directory;
    std::vector<BusId> buses;
  };
  /// Listens on every bus. The directory is made where it is missing. A socket file on which no
  /// process answers is left from a crash and replaced.
  /// Errors: kRefused where a process answers there; kUnavailable; both name the path.
  static Result<std::unique_ptr<UnixDoors>> Create(const Options& options);
  ~UnixDoors() override;

  [[nodiscard]] int fd() const override { return epoll_; }
  [[nodiscard]] HostInstant wake_at() const override { return wake_at_; }
  void Exchange(const HostClock& clock, sim::World* world) override;
  void Carry(std::span<const sim::WireFrame> frames) override;

 private:
  struct Listener {
    BusId bus;
    std::string path;
    int fd = -1;            // below 0: the bus is dead
    bool reported = false;  // that it cannot be opened again
  };
  struct Client {
    std::uint32_t id = 0;
    std::size_t bus = 0;  // index in listeners_
    int fd = -1;
    bool reading = true;
    std::deque<CanFrame> waiting;
  };

  explicit UnixDoors(int epoll) : epoll_(epoll) {}
  Status Listen(std::size_t listener);
  void FollowBuses(const HostClock& clock, const sim::World& world);
  void Accept(std::size_t listener);
  void Read(Client* client);
  void Write(Client* client);
  void Watch(const Client& client, int operation) const;
  void Drop(std::uint32_t id, const std::string& why);
  void SetPace(sim::World* world);

  int epoll_;
  HostInstant wake_at_ = kNever;
  std::vector<Listener> listeners_;
  std::map<BusId, std::vector<std::uint32_t>> clients_of_bus_;
  std::map<std::uint32_t, Client> clients_;
  std::uint32_t next_client_ = 1;
  bool reported_no_descriptors_ = false;
  std::vector<ReceivedFrame> received_;  // in this exchange
  std::vector<std::uint32_t> senders_;   // of these
};

}  // namespace focalfleet::simulator
