#include "daemon/access/peer.h"

#include <fcntl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>

namespace focalfleet {
namespace {

constexpr std::size_t kGroupsAtFirst = 32;

std::vector<std::uint32_t> GroupsOf(int socket) {
  std::vector<gid_t> groups(kGroupsAtFirst);
  auto bytes = static_cast<socklen_t>(groups.size() * sizeof(gid_t));
  int got = ::getsockopt(socket, SOL_SOCKET, SO_PEERGROUPS, groups.data(), &bytes);
  if (got != 0 && errno == ERANGE) {  // `bytes` is what they take
    groups.resize(bytes / sizeof(gid_t));
    got = ::getsockopt(socket, SOL_SOCKET, SO_PEERGROUPS, groups.data(), &bytes);
  }
  groups.resize(got == 0 ? bytes / sizeof(gid_t) : 0);
  return {groups.begin(), groups.end()};
}

std::string ProgramOf(pid_t pid) {
  const std::string path = "/proc/" + std::to_string(pid) + "/comm";
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) return {};
  std::array<char, 32> name{};  // the kernel keeps 16 bytes
  const ssize_t got = ::read(file, name.data(), name.size());
  ::close(file);
  std::string text(name.data(), got > 0 ? static_cast<std::size_t>(got) : 0);
  while (text.ends_with('\n')) text.pop_back();
  return text;
}

}  // namespace

std::optional<Peer> PeerOf(int socket) {
  ucred known{};
  socklen_t length = sizeof known;
  if (::getsockopt(socket, SOL_SOCKET, SO_PEERCRED, &known, &length) != 0 || known.pid <= 0)
    return std::nullopt;
  return Peer{.pid = static_cast<std::uint32_t>(known.pid),
              .uid = known.uid,
              .gid = known.gid,
              .groups = GroupsOf(socket),
              .program = ProgramOf(known.pid)};
}

}  // namespace focalfleet
