#include "daemon/ports/socketcan_port.h"

#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "daemon/ports/socket_frames.h"

namespace focalfleet {
namespace {

/// Room for the answers of a whole bus while the daemon is busy elsewhere.
constexpr int kReceiveBufferBytes = 1 << 20;

Status Configure(int fd) {
  const int on = 1;
  const int off = 0;
  const can_err_mask_t errors =
      CAN_ERR_CRTL | CAN_ERR_BUSOFF | CAN_ERR_RESTARTED | CAN_ERR_TX_TIMEOUT;
  // Answers of units and questions of other hosts alike; 11-bit frames do not even wake us.
  const can_filter extended{CAN_EFF_FLAG, CAN_EFF_FLAG | CAN_RTR_FLAG};
  if (::setsockopt(fd, SOL_CAN_RAW, CAN_RAW_RECV_OWN_MSGS, &off, sizeof off) != 0 ||
      ::setsockopt(fd, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &errors, sizeof errors) != 0 ||
      ::setsockopt(fd, SOL_CAN_RAW, CAN_RAW_FILTER, &extended, sizeof extended) != 0)
    return Fail(ErrorCode::kUnavailable,
                std::string("cannot set up CAN_RAW: ") + std::strerror(errno));
  // Both are help, not need: refused by a hardened kernel, the port works as well.
  ::setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &kReceiveBufferBytes, sizeof kReceiveBufferBytes);
  ::setsockopt(fd, SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on);
  return {};
}

struct InterfaceState {
  int index = 0;
  bool up = false;
};
Result<InterfaceState> Look(int fd, const std::string& name) {
  ifreq request{};
  if (name.size() >= sizeof request.ifr_name)
    return Fail(ErrorCode::kInvalid, "no CAN interface can be called '" + name + "'");
  std::memcpy(request.ifr_name, name.data(), name.size());
  if (::ioctl(fd, SIOCGIFINDEX, &request) != 0)
    return Fail(ErrorCode::kUnavailable,
                "no CAN interface '" + name + "': " + std::strerror(errno));
  InterfaceState state{.index = request.ifr_ifindex, .up = false};
  if (::ioctl(fd, SIOCGIFFLAGS, &request) != 0)
    return Fail(ErrorCode::kUnavailable, "CAN interface '" + name + "': " + std::strerror(errno));
  state.up = (request.ifr_flags & IFF_UP) != 0;
  return state;
}

}  // namespace

Result<int> OpenInterface(const std::string& name) {
  const int fd = ::socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW);
  if (fd < 0)
    return Fail(ErrorCode::kUnavailable,
                "this kernel offers no SocketCAN (for '" + name + "'): " + std::strerror(errno));
  const auto give_up = [fd](Error error) -> Result<int> {
    ::close(fd);
    return tl::unexpected<Error>(std::move(error));
  };
  const auto interface = Look(fd, name);
  if (!interface) return give_up(interface.error());
  if (const auto configured = Configure(fd); !configured) return give_up(configured.error());
  if (!interface->up) {
    ::close(fd);
    return -1;
  }
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = interface->index;
  const auto* raw = static_cast<const sockaddr*>(static_cast<const void*>(&address));
  if (::bind(fd, raw, sizeof address) != 0)
    return give_up({ErrorCode::kUnavailable,
                    "cannot use CAN interface '" + name + "': " + std::strerror(errno)});
  return fd;
}

std::optional<LinkState> LinkStateOf(const can_frame& error) {
  if ((error.can_id & CAN_ERR_BUSOFF) != 0) return LinkState::kOff;
  if ((error.can_id & CAN_ERR_RESTARTED) != 0) return LinkState::kUp;
  if ((error.can_id & CAN_ERR_CRTL) == 0) return std::nullopt;
  const std::uint8_t controller = error.data[1];
  if ((controller & (CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE)) != 0)
    return LinkState::kPassive;
  const std::uint8_t better =
      CAN_ERR_CRTL_ACTIVE | CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING;
  if ((controller & better) != 0) return LinkState::kUp;
  return std::nullopt;
}

Result<std::unique_ptr<SocketCanPort>> SocketCanPort::Create(Options options) {
  FOCALFLEET_TRY_ASSIGN(WatchedSocket socket, WatchedSocket::Create());
  std::unique_ptr<SocketCanPort> port(new SocketCanPort(std::move(options), std::move(socket)));
  const auto opened = port->Open();
  if (!opened && opened.error().code == ErrorCode::kInvalid)
    return tl::unexpected<Error>(opened.error());
  return port;
}

Status SocketCanPort::Open() {
  const auto fd = options_.open(options_.interface);
  found_ = fd.has_value();
  if (!fd || *fd < 0) {
    trouble_ = fd ? "the interface is down" : fd.error().text;
    return fd ? Status() : tl::unexpected<Error>(fd.error());
  }
  socket_.Open(*fd);
  state_ = LinkState::kUp;
  wake_at_ = kNever;
  trouble_.clear();
  counters_.reconnects += std::exchange(was_up_, true) ? 1u : 0u;
  return {};
}

void SocketCanPort::Lose(const std::string& why) {
  socket_.Close();
  state_ = LinkState::kDown;
  wake_at_ = HostInstant{0};
  trouble_ = why;
  ++counters_.link_errors;
}

std::size_t SocketCanPort::Send(std::span<const CanFrame> frames) {
  if (!socket_.open() || frames.empty()) return 0;
  const BatchSent sent = SendFrames(socket_.socket(), frames);
  // ENOBUFS: the interface's own queue is full, which no poll tells; the caller tries again soon.
  const bool full = sent.error == EAGAIN || sent.error == ENOBUFS;
  if (sent.error != 0 && !full) Lose(std::string("cannot send: ") + std::strerror(sent.error));
  socket_.WatchSending(sent.error == EAGAIN);
  return sent.taken;
}

void SocketCanPort::Receive(HostInstant now, std::vector<ReceivedFrame>* out) {
  if (!socket_.open()) {
    if (now < wake_at_) return;
    static_cast<void>(Open());  // what failed is the trouble
    if (!socket_.open()) {
      wake_at_ = now + options_.retry_period;
      return;
    }
  }
  errors_.clear();
  const BatchReceived received =
      ReceiveFrames(socket_.socket(), {options_.bus, now, {}}, out, &counters_, &errors_);
  for (const can_frame& error : errors_) NoteError(error);
  if (received.error == 0) return;
  Lose(std::string("cannot receive: ") + std::strerror(received.error));
  wake_at_ = now + options_.retry_period;
}

void SocketCanPort::NoteError(const can_frame& error) {
  ++counters_.link_errors;
  const auto state = LinkStateOf(error);
  if (!state || *state == state_) return;
  state_ = *state;
  trouble_ = state_ == LinkState::kUp        ? std::string()
             : state_ == LinkState::kPassive ? std::string("the controller is error-passive")
                                             : std::string("the controller is bus-off");
}

}  // namespace focalfleet
