#include "daemon/access/peer.h"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>

namespace focalfleet {
namespace {

TEST(Peer, IsTheProcessAtTheOtherEnd) {
  std::array<int, 2> ends{};
  ASSERT_EQ(::socketpair(AF_UNIX, SOCK_STREAM, 0, ends.data()), 0);
  const auto peer = PeerOf(ends[0]);
  ASSERT_TRUE(peer);
  EXPECT_EQ(peer->pid, static_cast<std::uint32_t>(::getpid()));
  EXPECT_EQ(peer->uid, ::geteuid());
  EXPECT_EQ(peer->gid, ::getegid());
  std::vector<gid_t> groups(static_cast<std::size_t>(std::max(::getgroups(0, nullptr), 0)));
  ::getgroups(static_cast<int>(groups.size()), groups.data());
  EXPECT_EQ(peer->groups, std::vector<std::uint32_t>(groups.begin(), groups.end()));
  EXPECT_FALSE(peer->program.empty());
  for (const int end : ends) ::close(end);
}

TEST(Peer, IsUnknownOfOtherDescriptors) {
  std::array<int, 2> pipe{};
  ASSERT_EQ(::pipe(pipe.data()), 0);
  EXPECT_FALSE(PeerOf(pipe[0]));
  for (const int end : pipe) ::close(end);
  const int socket = ::socket(AF_UNIX, SOCK_STREAM, 0);
  EXPECT_FALSE(PeerOf(socket)) << "not connected";
  ::close(socket);
}

}  // namespace
}  // namespace focalfleet
