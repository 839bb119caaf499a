#include "daemon/access/caller.h"

namespace focalfleet {

std::string NameOf(const Caller& caller) {
  if (caller.door == Door::kHttp) return "token " + caller.token;
  return caller.peer ? "uid " + std::to_string(caller.peer->uid) : "somebody";
}

std::string Describe(const Caller& caller) {
  std::string text =
      NameOf(caller) + " (" + (caller.role == Role::kNone ? "without a role" : Name(caller.role));
  if (caller.peer) {
    text += ", pid " + std::to_string(caller.peer->pid);
    if (!caller.peer->program.empty()) text += ", " + caller.peer->program;
  }
  if (!caller.address.empty()) text += ", from " + caller.address;
  return text + ")";
}

}  // namespace focalfleet
