// CanLink is what rtnetlink reports of a CAN interface; the orders here bring an interface back.
// Messages are built and read without a socket, so they can be tested without CAN. The kernel's
// answers are bounds-checked like data from a stranger.
//
// A question costs two system calls and is answered at once, unless the kernel is busy with an
// order about another interface. The core thread therefore asks with a limit
// (bounded_question.h). The orders may wait for a driver (up to a second), so they never run on the
// core thread (link_recovery.h).
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"

namespace focalfleet {

/// States as linux/can/netlink.h numbers them.
enum class ControllerState : std::uint8_t {
  kActive,
  kWarning,
  kPassive,
  kBusOff,
  kStopped,
  kSleeping
};

struct CanLink {
  int index = 0;
  bool can = false;  // its frames are CAN frames
  bool up = false;
  bool echoes = false;  // own frames come back when they have left (IFF_ECHO)
  std::string kind;     // "can": a controller; "vcan", "vxcan"; empty: the driver gives none
  std::uint32_t bit_rate_bps = 0;       // 0: it has no bit timing
  std::uint32_t data_bit_rate_bps = 0;  // of CAN FD frames' data phase; 0: as above, or unset
  std::uint32_t mtu = 0;                // bytes: 72 where it carries CAN FD frames, else 16
  std::uint32_t queue_frames = 0;       // frames that the kernel queues for the controller
  std::optional<ControllerState> state;
  std::uint32_t restart_ms = 0;  // the kernel's delay before a restart after bus-off; 0: none
  std::uint16_t tx_errors = 0;   // the controller's counters, where available
  std::uint16_t rx_errors = 0;

  /// True where real units may be behind the interface, which run in real time.
  [[nodiscard]] bool real() const { return kind != "vcan" && kind != "vxcan"; }
};

// ---- messages

using NetlinkMessage = std::vector<std::byte>;

/// The message that asks for the state of an interface.
/// Errors: kInvalid: no interface can have this name.
Result<NetlinkMessage> QuestionAboutLink(const std::string& interface);
NetlinkMessage OrderToRestart(int index);
NetlinkMessage OrderToRaise(int index, bool up);

/// The state in the kernel's answer.
/// Errors: kUnavailable with the kernel's reason; kInvalid: no answer to such a question.
Result<CanLink> ReadLink(std::span<const std::byte> answer);
/// The errno of an acknowledgement, 0: done.
/// Errors: kInvalid: not an acknowledgement.
Result<int> ReadAcknowledgement(std::span<const std::byte> answer);

// ---- the kernel

/// The state of the interface now.
/// Errors: kUnavailable: no such interface, or not a CAN interface (named); kInvalid: none can have
/// this name.
Result<CanLink> LookAtLink(const std::string& interface);
/// The same for the core thread, which waits some 20 ms at most. Errors: also kUnavailable: there
/// is no answer by then.
Result<CanLink> LookAtLinkInTime(const std::string& interface);

/// Brings a controller back from bus-off: by a restart where the driver has one, else by taking the
/// interface down and up. May wait for the driver. `taken_down` is the caller's memory of one
/// interface: true if this function took it down, so that the next attempt brings it up. An
/// interface that another program took down stays down.
/// Errors: kRefused: no privilege for it; kUnavailable: the attempt fails. The text gives the
/// remedy.
Status ReviveLink(const std::string& interface, bool* taken_down);

}  // namespace focalfleet
