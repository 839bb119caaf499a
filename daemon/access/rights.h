// The table of rights: each verb of the daemon with the least role that may use it. Every door asks
// this one table: the control socket, HTTP and its pages, and programs by the verb `access`. A verb
// that is not in it does not exist.
//
// A flag of a request may need more than its verb: homing without a proof of a clear way is the
// engineer's risk. A role also limits the length of a line: who may not load a model sends none,
// and its line is refused before anything of it is parsed.
#pragma once

#include <cstddef>
#include <nlohmann/json.hpp>
#include <span>
#include <string_view>

#include "daemon/access/caller.h"
#include "daemon/access/role.h"
#include "protocol/base/result.h"

namespace focalfleet {

struct Right {
  const char* verb;
  bool changes;           // false: a question, which changes nothing
  Role least;             // may use the verb
  const char* flag = "";  // of the arguments; where it is given and not false it needs more
  Role flag_least = Role::kNone;
};

/// All verbs, by ascending role.
std::span<const Right> Rights();
/// The right of a verb; null: there is no such verb.
const Right* RightOf(std::string_view verb);

/// The caller may use the verb with these arguments.
/// Errors: kInvalid: there is no such verb; kRefused: names caller, verb and the role that it
/// needs.
Status CheckRight(const Caller& caller, std::string_view verb, const nlohmann::json& args);

/// Limit of a line from a caller of this role. Units: bytes.
std::size_t LineBytesMaxOf(Role role);

/// {name, door, role, verbs}: what the caller may do. A verb is {verb, changes, least, allowed},
/// and where a flag of it needs more, {flag, flag_least, flag_allowed}.
nlohmann::json AccessJson(const Caller& caller);

}  // namespace focalfleet
