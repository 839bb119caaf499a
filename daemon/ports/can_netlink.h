// What rtnetlink knows of a CAN interface, and the orders that bring one back. The messages are
// built and read without a socket, so they can be tested without CAN; whatever the kernel says is
// bounds-checked as if it came from a stranger.
//
// A question costs two system calls and is answered at once. The orders may wait for a driver
// (up to a second): never on the core thread (link_recovery.h).
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

/// As linux/can/netlink.h numbers them.
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
  bool can = false;  // its frames are CAN frames at all
  bool up = false;
  bool echoes = false;  // own frames are given back when they have left (IFF_ECHO)
  std::string kind;     // "can": a controller; "vcan", "vxcan"; empty: its driver does not say
  std::uint32_t bit_rate_bps = 0;       // 0: it has no bit timing
  std::uint32_t data_bit_rate_bps = 0;  // of CAN FD frames' inner part; 0: as above, or none set
  std::uint32_t mtu = 0;                // bytes: 72 where it carries CAN FD frames, else 16
  std::optional<ControllerState> state;
  std::uint32_t restart_ms = 0;  // the kernel restarts it so long after bus-off; 0: it does not
  std::uint16_t tx_errors = 0;   // the controller's counters, where it shows them
  std::uint16_t rx_errors = 0;

  /// Real units may be behind it, which live in real time.
  [[nodiscard]] bool real() const { return kind != "vcan" && kind != "vxcan"; }
};

// ---- messages

using NetlinkMessage = std::vector<std::byte>;

/// Errors: kInvalid: no interface can have this name.
Result<NetlinkMessage> QuestionAboutLink(const std::string& interface);
NetlinkMessage OrderToRestart(int index);
NetlinkMessage OrderToRaise(int index, bool up);

/// Errors: kUnavailable with the kernel's reason; kInvalid: no answer to such a question.
Result<CanLink> ReadLink(std::span<const std::byte> answer);
/// The errno of an acknowledgement, 0: done. Errors: kInvalid: it is none.
Result<int> ReadAcknowledgement(std::span<const std::byte> answer);

// ---- the kernel

/// Errors: kUnavailable: no such interface, or it is no CAN (named); kInvalid: none can have this
/// name.
Result<CanLink> LookAtLink(const std::string& interface);

/// Brings a controller back from bus-off: by a restart where the driver has one, else by taking the
/// interface down and up. May wait for the driver. `taken_down` is the caller's memory of one
/// interface: down by us, so the next attempt brings it up; one that others took down stays so.
/// Errors: kRefused: no privilege for it; kUnavailable: it does not work. The text says what to do.
Status ReviveLink(const std::string& interface, bool* taken_down);

}  // namespace focalfleet
