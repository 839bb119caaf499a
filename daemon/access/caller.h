// A caller is whoever asks something of the daemon, by whichever door: the user of a process at the
// control socket, or the bearer of a token over HTTP.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "daemon/access/peer.h"
#include "daemon/access/role.h"

namespace focalfleet {

enum class Door : std::uint8_t { kSocket, kHttp };
constexpr const char* Name(Door door) { return door == Door::kSocket ? "socket" : "http"; }

struct Caller {
  Role role = Role::kNone;
  Door door = Door::kSocket;
  std::optional<Peer> peer = {};  // of the socket; none: the kernel did not say
  std::string token = {};         // name of the token that HTTP was asked with
  std::string address = {};       // of HTTP: where the request came from
};

/// `uid 1000`, or `token NAME`. A name of a user may be slow to find, so programs for people do it.
std::string NameOf(const Caller& caller);
/// For logs: `uid 1000 (viewer, pid 77, focalfleet)`.
std::string Describe(const Caller& caller);

}  // namespace focalfleet
