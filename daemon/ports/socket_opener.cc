#include "daemon/ports/socket_opener.h"

#include <linux/can.h>
#include <linux/can/raw.h>
#include <linux/netlink.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>

#include "daemon/control/unix_address.h"

namespace focalfleet {
namespace {

/// An opener that hangs must not hold up the core for longer than one that is not there.
constexpr timeval kPatience{.tv_sec = 1, .tv_usec = 0};

std::string& OpenerPath() {
  static std::string path;
  return path;
}

int OpenHere(SocketKind kind) {
  return kind == SocketKind::kCan
             ? ::socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW)
             : ::socket(AF_NETLINK, SOCK_RAW | SOCK_CLOEXEC, NETLINK_ROUTE);
}

/// Room for one descriptor beside a message.
union Control {
  cmsghdr header;
  std::array<char, CMSG_SPACE(sizeof(int))> bytes;
};

void SendSocket(int to, int socket, std::uint8_t error) {
  iovec part{.iov_base = &error, .iov_len = sizeof error};
  Control control{};
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  if (socket >= 0) {
    message.msg_control = control.bytes.data();
    message.msg_controllen = control.bytes.size();
    cmsghdr* const header = CMSG_FIRSTHDR(&message);
    header->cmsg_level = SOL_SOCKET;
    header->cmsg_type = SCM_RIGHTS;
    header->cmsg_len = CMSG_LEN(sizeof socket);
    std::memcpy(CMSG_DATA(header), &socket, sizeof socket);
  }
  [[maybe_unused]] const ssize_t sent = ::sendmsg(to, &message, MSG_NOSIGNAL | MSG_DONTWAIT);
}

/// The socket of an answer; -1 with errno.
int ReceiveSocket(int from) {
  std::uint8_t error = 0;
  iovec part{.iov_base = &error, .iov_len = sizeof error};
  Control control{};
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  message.msg_control = control.bytes.data();
  message.msg_controllen = control.bytes.size();
  const ssize_t got = ::recvmsg(from, &message, MSG_CMSG_CLOEXEC);
  const cmsghdr* const header = got > 0 ? CMSG_FIRSTHDR(&message) : nullptr;
  if (header != nullptr && header->cmsg_level == SOL_SOCKET && header->cmsg_type == SCM_RIGHTS &&
      header->cmsg_len == CMSG_LEN(sizeof(int))) {
    int socket = -1;
    std::memcpy(&socket, CMSG_DATA(header), sizeof socket);
    return socket;
  }
  if (got > 0) errno = error != 0 ? error : EPROTO;
  if (got == 0) errno = ECONNRESET;
  return -1;
}

int AskOpener(const std::string& path, SocketKind kind) {
  const auto address = UnixAddress::Of(path);
  if (!address) {
    errno = ENAMETOOLONG;
    return -1;
  }
  const int opener = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
  if (opener < 0) return -1;
  ::setsockopt(opener, SOL_SOCKET, SO_RCVTIMEO, &kPatience, sizeof kPatience);
  ::setsockopt(opener, SOL_SOCKET, SO_SNDTIMEO, &kPatience, sizeof kPatience);
  int socket = -1;
  if (::connect(opener, address->get(), address->length()) == 0 &&
      ::send(opener, &kind, sizeof kind, MSG_NOSIGNAL) == sizeof kind)
    socket = ReceiveSocket(opener);
  const int error = errno;
  ::close(opener);
  errno = error;
  return socket;
}

void AnswerOne(int client) {
  ::setsockopt(client, SOL_SOCKET, SO_RCVTIMEO, &kPatience, sizeof kPatience);
  std::uint8_t kind = 0;
  if (::recv(client, &kind, sizeof kind, 0) != sizeof kind) return;
  const bool known = kind == static_cast<std::uint8_t>(SocketKind::kCan) ||
                     kind == static_cast<std::uint8_t>(SocketKind::kNetlink);
  const int socket = known ? OpenHere(static_cast<SocketKind>(kind)) : -1;
  SendSocket(client, socket, static_cast<std::uint8_t>(socket >= 0 ? 0 : known ? errno : EINVAL));
  if (socket >= 0) ::close(socket);
}

}  // namespace

void TakeSocketsFrom(const std::string& path) { OpenerPath() = path; }

int MakeSocket(SocketKind kind) {
  return OpenerPath().empty() ? OpenHere(kind) : AskOpener(OpenerPath(), kind);
}

Status ServeOpener(int listener, const std::atomic<bool>& ending) {
  while (!ending) {
    pollfd watched{.fd = listener, .events = POLLIN, .revents = 0};
    const int ready = ::poll(&watched, 1, 100);
    if (ready == 0 || (ready < 0 && errno == EINTR)) continue;
    const int client = ready > 0 ? ::accept4(listener, nullptr, nullptr, SOCK_CLOEXEC) : -1;
    if (client < 0) {
      if (ready > 0 && (errno == EAGAIN || errno == EINTR || errno == ECONNABORTED)) continue;
      return Fail(ErrorCode::kUnavailable, std::string("cannot accept: ") + std::strerror(errno));
    }
    AnswerOne(client);
    ::close(client);
  }
  return {};
}

}  // namespace focalfleet
