#include "daemon/ports/can_netlink.h"

#include <linux/can/netlink.h>
#include <linux/if_link.h>
#include <linux/netlink.h>
#include <linux/rtnetlink.h>
#include <net/if.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>

#include "daemon/ports/bounded_question.h"
#include "daemon/ports/socket_opener.h"

namespace focalfleet {
namespace {

constexpr std::uint32_t kEchoFlag = 1u << 18;  // IFF_ECHO, which net/if.h lacks
constexpr std::uint16_t kCanHardware = 280;    // ARPHRD_CAN, which net/if_arp.h lacks
constexpr std::size_t kAnswerMax = 32'768;
constexpr std::uint16_t kTypeMask = 0x3fff;  // NLA_TYPE_MASK, which is an int
/// An answer that was lost on its way (a full buffer) must not hold a thread for ever. An order to
/// a driver takes up to a second.
constexpr timeval kAnswerLost{.tv_sec = 5, .tv_usec = 0};

// ---- writing

class Writer {
 public:
  Writer(std::uint16_t type, std::uint16_t flags, const ifinfomsg& link) {
    nlmsghdr header{};
    header.nlmsg_type = type;
    header.nlmsg_flags = flags;
    header.nlmsg_seq = 1;
    Append(&header, sizeof header);
    Append(&link, sizeof link);
  }
  void Attribute(std::uint16_t type, const void* data, std::size_t size) {
    const std::size_t at = Open(type);
    Append(data, size);
    Close(at);
  }
  std::size_t Open(std::uint16_t type) {
    const std::size_t at = bytes_.size();
    const nlattr header{.nla_len = 0, .nla_type = type};
    Append(&header, sizeof header);
    return at;
  }
  void Close(std::size_t at) {
    const auto length = static_cast<std::uint16_t>(bytes_.size() - at);
    std::memcpy(&bytes_[at + offsetof(nlattr, nla_len)], &length, sizeof length);
    bytes_.resize((bytes_.size() + 3) & ~std::size_t{3});
  }
  NetlinkMessage Take() {
    const auto length = static_cast<std::uint32_t>(bytes_.size());
    std::memcpy(&bytes_[offsetof(nlmsghdr, nlmsg_len)], &length, sizeof length);
    return std::move(bytes_);
  }

 private:
  void Append(const void* data, std::size_t size) {
    const auto* from = static_cast<const std::byte*>(data);
    bytes_.insert(bytes_.end(), from, from + size);
  }
  NetlinkMessage bytes_;
};

// ---- reading

template <class T>
std::optional<T> Value(std::span<const std::byte> bytes) {
  if (bytes.size() < sizeof(T)) return std::nullopt;
  T value;
  std::memcpy(&value, bytes.data(), sizeof value);
  return value;
}

/// Calls `visit(type, payload)` for each attribute. False: impossible lengths.
template <class Visit>
bool ForEachAttribute(std::span<const std::byte> bytes, const Visit& visit) {
  while (bytes.size() >= sizeof(nlattr)) {
    const nlattr header = *Value<nlattr>(bytes);
    if (header.nla_len < sizeof header || header.nla_len > bytes.size()) return false;
    visit(static_cast<std::uint16_t>(header.nla_type & kTypeMask),
          bytes.subspan(sizeof header, header.nla_len - sizeof header));
    bytes = bytes.subspan(std::min<std::size_t>(bytes.size(), (header.nla_len + 3u) & ~3u));
  }
  return true;
}

std::string TextOf(std::span<const std::byte> bytes) {
  std::string text;
  for (const std::byte byte : bytes) {
    if (byte == std::byte{0}) break;
    text.push_back(static_cast<char>(byte));
  }
  return text;
}

void ReadCanAttribute(std::uint16_t type, std::span<const std::byte> payload, CanLink* link) {
  if (type == IFLA_CAN_BITTIMING) {
    if (const auto timing = Value<can_bittiming>(payload)) link->bit_rate_bps = timing->bitrate;
  } else if (type == IFLA_CAN_DATA_BITTIMING) {
    if (const auto timing = Value<can_bittiming>(payload))
      link->data_bit_rate_bps = timing->bitrate;
  } else if (type == IFLA_CAN_STATE) {
    const auto state = Value<std::uint32_t>(payload);
    if (state && *state < CAN_STATE_MAX) link->state = static_cast<ControllerState>(*state);
  } else if (type == IFLA_CAN_RESTART_MS) {
    link->restart_ms = Value<std::uint32_t>(payload).value_or(0);
  } else if (type == IFLA_CAN_BERR_COUNTER) {
    const auto counter = Value<can_berr_counter>(payload).value_or(can_berr_counter{});
    link->tx_errors = counter.txerr;
    link->rx_errors = counter.rxerr;
  }
}

bool ReadLinkInfo(std::span<const std::byte> info, CanLink* link) {
  std::span<const std::byte> data;
  if (!ForEachAttribute(info, [&](std::uint16_t type, std::span<const std::byte> payload) {
        if (type == IFLA_INFO_KIND) link->kind = TextOf(payload);
        if (type == IFLA_INFO_DATA) data = payload;
      }))
    return false;
  if (link->kind != "can") return true;
  return ForEachAttribute(data, [&](std::uint16_t type, std::span<const std::byte> payload) {
    ReadCanAttribute(type, payload, link);
  });
}

tl::unexpected<Error> NoAnswer() {
  return Fail(ErrorCode::kInvalid, "the kernel's answer about the interface cannot be read");
}

struct Head {
  std::uint16_t type = 0;
  std::span<const std::byte> body;
};
Result<Head> ReadHead(std::span<const std::byte> answer) {
  const auto header = Value<nlmsghdr>(answer);
  if (!header || header->nlmsg_len < sizeof(nlmsghdr) || header->nlmsg_len > answer.size())
    return NoAnswer();
  return Head{header->nlmsg_type,
              answer.subspan(sizeof(nlmsghdr), header->nlmsg_len - sizeof(nlmsghdr))};
}

// ---- Exchange with the kernel

Result<NetlinkMessage> AskKernel(const NetlinkMessage& request) {
  const int fd = MakeSocket(SocketKind::kNetlink);
  if (fd < 0)
    return Fail(ErrorCode::kUnavailable, std::string("no netlink: ") + std::strerror(errno));
  ::setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &kAnswerLost, sizeof kAnswerLost);
  NetlinkMessage answer(kAnswerMax);
  ssize_t got = ::send(fd, request.data(), request.size(), 0);
  if (got >= 0) {
    do {
      got = ::recv(fd, answer.data(), answer.size(), 0);
    } while (got < 0 && errno == EINTR);
  }
  const int error = errno;
  ::close(fd);
  if (got < 0)
    return Fail(ErrorCode::kUnavailable, std::string("netlink: ") + std::strerror(error));
  answer.resize(static_cast<std::size_t>(got));
  return answer;
}

/// The process has a single one: a lock of the kernel holds up all interfaces alike.
BoundedQuestion& QuestionInTime() {
  static BoundedQuestion question({});
  return question;
}

Result<CanLink> LinkIn(const NetlinkMessage& answer, const std::string& interface) {
  auto link = ReadLink(answer);
  if (!link)
    return Fail(ErrorCode::kUnavailable,
                "no CAN interface '" + interface + "': " + link.error().text);
  if (!link->can) return Fail(ErrorCode::kUnavailable, "'" + interface + "' is no CAN interface");
  return link;
}

Result<int> Order(const NetlinkMessage& order) {
  FOCALFLEET_TRY_ASSIGN(const NetlinkMessage answer, AskKernel(order));
  return ReadAcknowledgement(answer);
}

Status Failure(const std::string& interface, const char* what, int error) {
  if (error == EPERM)
    return Fail(ErrorCode::kRefused, std::string("no privilege to ") + what + " it: `ip link set " +
                                         interface +
                                         " type can restart`, or CAP_NET_ADMIN for the daemon");
  return Fail(ErrorCode::kUnavailable,
              std::string("cannot ") + what + " it: " + std::strerror(error));
}

}  // namespace

Result<NetlinkMessage> QuestionAboutLink(const std::string& interface) {
  if (interface.empty() || interface.size() >= IFNAMSIZ)
    return Fail(ErrorCode::kInvalid, "no CAN interface can be called '" + interface + "'");
  Writer writer(RTM_GETLINK, NLM_F_REQUEST, {});
  writer.Attribute(IFLA_IFNAME, interface.c_str(), interface.size() + 1);
  return writer.Take();
}

NetlinkMessage OrderToRestart(int index) {
  ifinfomsg link{};
  link.ifi_index = index;
  Writer writer(RTM_NEWLINK, NLM_F_REQUEST | NLM_F_ACK, link);
  const std::size_t info = writer.Open(IFLA_LINKINFO);
  writer.Attribute(IFLA_INFO_KIND, "can", 4);
  const std::size_t data = writer.Open(IFLA_INFO_DATA);
  const std::uint32_t restart = 1;
  writer.Attribute(IFLA_CAN_RESTART, &restart, sizeof restart);
  writer.Close(data);
  writer.Close(info);
  return writer.Take();
}

NetlinkMessage OrderToRaise(int index, bool up) {
  ifinfomsg link{};
  link.ifi_index = index;
  link.ifi_flags = up ? IFF_UP : 0;
  link.ifi_change = IFF_UP;
  return Writer(RTM_NEWLINK, NLM_F_REQUEST | NLM_F_ACK, link).Take();
}

Result<int> ReadAcknowledgement(std::span<const std::byte> answer) {
  FOCALFLEET_TRY_ASSIGN(const Head head, ReadHead(answer));
  const auto error = Value<nlmsgerr>(head.body);
  // The limit also excludes -INT_MIN, which does not exist. The kernel encodes no errno beyond this
  // in a pointer.
  constexpr int kErrnoMax = 4095;
  if (head.type != NLMSG_ERROR || !error || error->error > 0 || error->error < -kErrnoMax)
    return NoAnswer();
  return -error->error;
}

Result<CanLink> ReadLink(std::span<const std::byte> answer) {
  FOCALFLEET_TRY_ASSIGN(const Head head, ReadHead(answer));
  if (head.type == NLMSG_ERROR) {
    FOCALFLEET_TRY_ASSIGN(const int error, ReadAcknowledgement(answer));
    return Fail(ErrorCode::kUnavailable, std::strerror(error));
  }
  const auto about = Value<ifinfomsg>(head.body);
  if (head.type != RTM_NEWLINK || !about) return NoAnswer();
  CanLink link;
  link.index = about->ifi_index;
  link.can = about->ifi_type == kCanHardware;
  link.up = (about->ifi_flags & IFF_UP) != 0;
  link.echoes = (about->ifi_flags & kEchoFlag) != 0;
  bool well = true;
  well &= ForEachAttribute(head.body.subspan(sizeof(ifinfomsg)),
                           [&](std::uint16_t type, std::span<const std::byte> payload) {
                             if (type == IFLA_LINKINFO) well &= ReadLinkInfo(payload, &link);
                             if (type == IFLA_MTU)
                               link.mtu = Value<std::uint32_t>(payload).value_or(0);
                             if (type == IFLA_TXQLEN)
                               link.queue_frames = Value<std::uint32_t>(payload).value_or(0);
                           });
  if (!well) return NoAnswer();
  return link;
}

Result<CanLink> LookAtLink(const std::string& interface) {
  FOCALFLEET_TRY_ASSIGN(const NetlinkMessage question, QuestionAboutLink(interface));
  FOCALFLEET_TRY_ASSIGN(const NetlinkMessage answer, AskKernel(question));
  return LinkIn(answer, interface);
}

Result<CanLink> LookAtLinkInTime(const std::string& interface) {
  FOCALFLEET_TRY_ASSIGN(NetlinkMessage question, QuestionAboutLink(interface));
  const auto ask = [question = std::move(question)] { return AskKernel(question); };
  FOCALFLEET_TRY_ASSIGN(const NetlinkMessage answer, QuestionInTime()(ask));
  return LinkIn(answer, interface);
}

Status ReviveLink(const std::string& interface, bool* taken_down) {
  FOCALFLEET_TRY_ASSIGN(const CanLink link, LookAtLink(interface));
  const auto bring_up = [&]() -> Status {
    FOCALFLEET_TRY_ASSIGN(const int up, Order(OrderToRaise(link.index, true)));
    if (up != 0) return Failure(interface, "bring up", up);
    *taken_down = false;
    return {};
  };
  if (!link.up) return *taken_down ? bring_up() : Status{};
  if (link.state && *link.state != ControllerState::kBusOff) return {};
  FOCALFLEET_TRY_ASSIGN(const int restart, Order(OrderToRestart(link.index)));
  if (restart == 0) return {};
  if (restart != EOPNOTSUPP) return Failure(interface, "restart", restart);
  // The driver has no restart, so the interface goes down and up again.
  FOCALFLEET_TRY_ASSIGN(const int down, Order(OrderToRaise(link.index, false)));
  if (down != 0) return Failure(interface, "take down", down);
  *taken_down = true;
  return bring_up();
}

}  // namespace focalfleet
