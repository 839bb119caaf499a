// Occupies all UDP ports by which a program may join a DDS domain (deploy/cyclonedds.xml), until it
// is destroyed.
#pragma once

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdint>
#include <vector>

namespace focalfleet::test {

class TakenPorts {
 public:
  explicit TakenPorts(std::uint32_t domain) {
    for (std::uint32_t k = 0; k < 2 * kParticipants; ++k) {
      const int fd = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
      sockaddr_in address{};
      address.sin_family = AF_INET;
      address.sin_addr.s_addr = htonl(INADDR_ANY);
      address.sin_port = htons(static_cast<std::uint16_t>(7410 + 250 * domain + k));
      const void* raw = &address;
      // A port that cannot be bound is taken already.
      static_cast<void>(::bind(fd, static_cast<const sockaddr*>(raw), sizeof address));
      sockets_.push_back(fd);
    }
  }
  ~TakenPorts() {
    for (const int fd : sockets_) ::close(fd);
  }
  TakenPorts(const TakenPorts&) = delete;
  TakenPorts& operator=(const TakenPorts&) = delete;

 private:
  static constexpr std::uint32_t kParticipants = 120;
  std::vector<int> sockets_;
};

}  // namespace focalfleet::test
