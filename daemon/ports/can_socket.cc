#include "daemon/ports/can_socket.h"

#include <linux/can.h>
#include <linux/can/raw.h>
#include <linux/sock_diag.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>

#include "daemon/ports/can_errors.h"
#include "daemon/ports/socket_opener.h"
#include "protocol/wire/stage_group.h"

namespace focalfleet {
namespace {

/// Buffer for the answers of a whole bus while the daemon is busy elsewhere: the kernel charges 768
/// bytes a frame.
constexpr int kReceiveBufferBytes = 1 << 20;

// Source: protocol/wire/identifier.h. Bit 19 gives the direction; bits 25..20 are the function. The
// first sixteen functions need one filter; each later one needs a filter of its own.
constexpr canid_t kFromUnit = 1u << 19;
constexpr canid_t kFunctionMask = 0x3Fu << 20;
constexpr canid_t kAboveSixteen = 0x30u << 20;
constexpr canid_t kSensors = static_cast<canid_t>(Function::kSensors) << 20;
static_assert(kFunctionCount == 18, "a function without a filter is never heard");

bool Set(int fd, int level, int option, const void* value, socklen_t size) {
  return ::setsockopt(fd, level, option, value, size) == 0;
}

/// Sets up the socket. A driver that echoes returns the host's own frames as confirmations, so the
/// filter must admit them.
Status Configure(int fd, const Listening& listening, bool confirms) {
  const int on = 1;
  const int own = confirms ? 1 : 0;
  const can_err_mask_t errors = ErrorsOfInterest();
  const int fd_frames = listening.groups ? 1 : 0;
  const bool hears_hosts = listening.hears == Hears::kHosts;
  const canid_t theirs = CAN_EFF_FLAG | (confirms || hears_hosts ? 0 : kFromUnit);
  const canid_t exact = CAN_EFF_FLAG | CAN_RTR_FLAG | (confirms ? 0 : kFromUnit);
  const std::array<can_filter, 3> filters{
      can_filter{theirs, exact | kAboveSixteen},
      can_filter{theirs | kSensors, exact | kFunctionMask},
      can_filter{CAN_EFF_FLAG | kGroupId, CAN_EFF_FLAG | CAN_RTR_FLAG | CAN_EFF_MASK}};
  // Hosts send groups. A unit's port receives them from other nodes; the sender's port receives
  // them as confirmations.
  const bool groups_come = listening.groups && (hears_hosts || confirms);
  const auto filter_bytes = static_cast<socklen_t>(sizeof(can_filter) * (groups_come ? 3 : 2));
  if (!Set(fd, SOL_CAN_RAW, CAN_RAW_RECV_OWN_MSGS, &own, sizeof own) ||
      !Set(fd, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &errors, sizeof errors) ||
      !Set(fd, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &fd_frames, sizeof fd_frames) ||
      !Set(fd, SOL_CAN_RAW, CAN_RAW_FILTER, filters.data(), filter_bytes))
    return Fail(ErrorCode::kUnavailable,
                std::string("cannot set up CAN_RAW: ") + std::strerror(errno));
  // These options help but are not needed: where a hardened kernel refuses them, the port still
  // works.
  if (!Set(fd, SOL_SOCKET, SO_RCVBUFFORCE, &kReceiveBufferBytes, sizeof kReceiveBufferBytes))
    Set(fd, SOL_SOCKET, SO_RCVBUF, &kReceiveBufferBytes, sizeof kReceiveBufferBytes);
  Set(fd, SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on);
  Set(fd, SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on);
  return {};
}

}  // namespace

Result<OpenedInterface> OpenInterface(const std::string& name, const Listening& listening) {
  FOCALFLEET_TRY(QuestionAboutLink(name));
  const int fd = MakeSocket(SocketKind::kCan);
  if (fd < 0)
    return Fail(ErrorCode::kUnavailable,
                "this kernel offers no SocketCAN (for '" + name + "'): " + std::strerror(errno));
  const auto give_up = [fd](Error error) -> Result<OpenedInterface> {
    ::close(fd);
    return tl::unexpected<Error>(std::move(error));
  };
  const auto link = listening.may_wait ? LookAtLink(name) : LookAtLinkInTime(name);
  if (!link) return give_up(link.error());
  if (!link->up) {
    ::close(fd);
    return OpenedInterface{-1, *link};
  }
  if (const auto done = Configure(fd, listening, link->echoes); !done) return give_up(done.error());
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = link->index;
  const auto* raw = static_cast<const sockaddr*>(static_cast<const void*>(&address));
  if (::bind(fd, raw, sizeof address) != 0)
    return give_up({ErrorCode::kUnavailable,
                    "cannot use CAN interface '" + name + "': " + std::strerror(errno)});
  return OpenedInterface{fd, *link};
}

std::size_t BytesBelow(int socket) {
  std::array<std::uint32_t, SK_MEMINFO_VARS> info{};
  socklen_t size = sizeof info;
  if (::getsockopt(socket, SOL_SOCKET, SO_MEMINFO, info.data(), &size) != 0) return 0;
  return info[SK_MEMINFO_WMEM_ALLOC];
}

void SetUrgent(int socket, bool urgent) {
  const int priority = urgent ? 6 : 0;  // 6: the highest that needs no privilege
  Set(socket, SOL_SOCKET, SO_PRIORITY, &priority, sizeof priority);
}

}  // namespace focalfleet
