// Where sockets of the kernel's networks are opened: in this process' network namespace, or by an
// opener in another one. CAN interfaces in a namespace of their own are out of reach of all other
// programs on the host: AF_CAN takes no right. The daemon itself stays outside, where its DDS and
// its operators are, and gets sockets from the opener. A socket belongs to the namespace in which
// it was opened, whoever holds it.
//
// The opener (focalfleet-can-opener) answers a byte, the kind of socket, with a byte and the socket
// (SCM_RIGHTS), or with the errno alone. Its socket's file says who may ask.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>

#include "protocol/base/result.h"

namespace focalfleet {

enum class SocketKind : std::uint8_t { kCan = 'c', kNetlink = 'n' };

/// Sockets of this process come from the opener at `path` from now on; empty: from its own
/// namespace. Pre: no other thread runs yet.
void TakeSocketsFrom(const std::string& path);

/// A new socket: CAN_RAW that does not block, or NETLINK_ROUTE. -1 with errno.
int MakeSocket(SocketKind kind);

/// The opener's side: requests at the listening socket are answered with sockets of this process'
/// namespace, until `ending`. Errors: kUnavailable: the listening socket fails.
Status ServeOpener(int listener, const std::atomic<bool>& ending);

}  // namespace focalfleet
