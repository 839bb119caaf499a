// The process at the other end of a UNIX socket, as the kernel knows it. The kernel noted it when
// the process connected, so a change of user since then changes nothing.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace focalfleet {

struct Peer {
  std::uint32_t pid = 0;
  std::uint32_t uid = 0;
  std::uint32_t gid = 0;
  std::vector<std::uint32_t> groups = {};  // supplementary ones
  std::string program = {};  // its name by /proc; empty: hidden. For people, not for decisions
};

/// None: the socket is no UNIX socket, or is not connected.
std::optional<Peer> PeerOf(int socket);

}  // namespace focalfleet
