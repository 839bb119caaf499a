// A CAN_RAW socket as a port wants it: bound to one interface, never waiting, hearing only what
// the other side sends, told of the controller's troubles, its frames stamped by the kernel when
// they came in.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "daemon/ports/can_netlink.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// Whose frames a port hears: the coordinator hears units, the simulated units hear hosts. Frames
/// of the other direction, of 11 bits, or remote, do not even wake it.
enum class Hears : std::uint8_t { kUnits, kHosts };

struct Listening {
  Hears hears = Hears::kUnits;
  bool groups = false;  // CAN FD frames pass, both ways
};

struct OpenedInterface {
  int socket = -1;  // -1: the interface is there, and down
  CanLink link;
};

/// Errors: kUnavailable: the kernel has no CAN, or no such interface (named); kInvalid: none can
/// have this name.
Result<OpenedInterface> OpenInterface(const std::string& name, const Listening& listening);
/// As OpenInterface; another one in tests on a kernel without CAN.
using InterfaceOpener =
    std::function<Result<OpenedInterface>(const std::string& name, const Listening& listening)>;

/// What the kernel charges to the socket for frames that it holds below. Units: bytes. 0 where it
/// does not tell.
std::size_t BytesBelow(int socket);

/// Frames sent from now on pass those of others (and our earlier ones) that wait in an interface's
/// queue with bands; pfifo_fast, the usual one, has them.
void SetUrgent(int socket, bool urgent);

}  // namespace focalfleet
