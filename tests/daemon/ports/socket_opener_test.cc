#include "daemon/ports/socket_opener.h"

#include <gtest/gtest.h>
#include <linux/netlink.h>
#include <net/if.h>
#include <sched.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <string>

#include "daemon/control/unix_address.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

/// An opener in a process of its own, in another network namespace where this is permitted.
class Opener {
 public:
  explicit Opener(const std::string& path) {
    const auto address = UnixAddress::Of(path).value();
    const int listener = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
    EXPECT_EQ(::bind(listener, address.get(), address.length()), 0);
    EXPECT_EQ(::listen(listener, 8), 0);
    int apart[2];
    EXPECT_EQ(::pipe(apart), 0);
    pid_ = ::fork();
    if (pid_ == 0) {
      const bool is_apart = ::unshare(CLONE_NEWNET) == 0;
      [[maybe_unused]] const ssize_t sent = ::write(apart[1], is_apart ? "1" : "0", 1);
      const std::atomic<bool> ending{false};
      static_cast<void>(ServeOpener(listener, ending));
      ::_exit(0);
    }
    ::close(listener);
    char answer = '0';
    EXPECT_EQ(::read(apart[0], &answer, 1), 1);
    apart_ = answer == '1';
    for (const int end : apart) ::close(end);
  }
  ~Opener() {
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
  }
  Opener(const Opener&) = delete;
  Opener& operator=(const Opener&) = delete;
  [[nodiscard]] bool apart() const { return apart_; }

 private:
  pid_t pid_ = -1;
  bool apart_ = false;
};

class SocketOpenerTest : public ::testing::Test {
 protected:
  ~SocketOpenerTest() override { TakeSocketsFrom(""); }
  test::ScratchFolder folder_;
};

/// Whether loopback is up in the namespace of the socket.
bool LoopbackIsUp(int socket) {
  ifreq request{};
  std::strcpy(request.ifr_name, "lo");
  EXPECT_EQ(::ioctl(socket, SIOCGIFFLAGS, &request), 0);
  return (request.ifr_flags & IFF_UP) != 0;
}

TEST_F(SocketOpenerTest, ASocketBelongsToTheNamespaceOfItsOpener) {
  const Opener opener(folder_ / "o");
  if (!opener.apart()) GTEST_SKIP() << "only root may make a namespace";
  const int own = MakeSocket(SocketKind::kNetlink);
  ASSERT_GE(own, 0);
  TakeSocketsFrom(folder_ / "o");
  const int other = MakeSocket(SocketKind::kNetlink);
  ASSERT_GE(other, 0) << std::strerror(errno);
  sockaddr_nl address{};
  socklen_t length = sizeof address;
  ASSERT_EQ(::getsockname(other, reinterpret_cast<sockaddr*>(&address), &length), 0);
  EXPECT_EQ(address.nl_family, AF_NETLINK);
  EXPECT_FALSE(LoopbackIsUp(other)) << "a new namespace has its loopback down";
  if (!LoopbackIsUp(own)) std::puts("loopback is down outside, too");
  ::close(own);
  ::close(other);
}

TEST_F(SocketOpenerTest, TheReasonOfARefusalComesBack) {
  const Opener opener(folder_ / "o");
  TakeSocketsFrom(folder_ / "o");
  errno = 0;
  EXPECT_EQ(MakeSocket(SocketKind{'x'}), -1);
  EXPECT_EQ(errno, EINVAL);
}

TEST_F(SocketOpenerTest, WithoutAnOpenerThereIsNoSocket) {
  TakeSocketsFrom(folder_ / "none");
  EXPECT_EQ(MakeSocket(SocketKind::kNetlink), -1);
  EXPECT_EQ(errno, ENOENT) << "and never one of the own namespace";
}

}  // namespace
}  // namespace focalfleet
