// OpenInterface opens a CAN_RAW socket for a port. The socket is bound to one interface, never
// waits and receives only the frames of the other side. The socket reports the controller's errors,
// and the kernel stamps its frames on arrival.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "daemon/ports/can_netlink.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// The senders that a port receives: the coordinator receives units, the simulated units receive
/// hosts. Frames of the other direction, frames of 11 bits and remote frames do not even wake the
/// port.
enum class Hears : std::uint8_t { kUnits, kHosts };

struct Listening {
  Hears hears = Hears::kUnits;
  bool groups = false;    // CAN FD frames pass in both directions
  bool may_wait = false;  // for the kernel: nothing else runs yet
};

struct OpenedInterface {
  int socket = -1;  // -1: the interface exists, and is down
  CanLink link;
};

/// The socket of an interface.
/// Errors: kUnavailable: the kernel has no CAN, or no such interface (named), or does not answer in
/// time; kInvalid: none can have this name.
Result<OpenedInterface> OpenInterface(const std::string& name, const Listening& listening);
/// A function like OpenInterface. Tests on a kernel without CAN supply another one.
using InterfaceOpener =
    std::function<Result<OpenedInterface>(const std::string& name, const Listening& listening)>;

/// The bytes that the kernel charges to the socket for frames that it still holds below. Units:
/// bytes. 0 where the kernel does not report them.
std::size_t BytesBelow(int socket);

/// Frames sent from now on overtake those of other programs (and earlier ones of this one) that
/// wait in an interface's queue with bands. The usual queue, pfifo_fast, has bands.
void SetUrgent(int socket, bool urgent);

}  // namespace focalfleet
