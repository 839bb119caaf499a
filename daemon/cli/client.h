// Ask sends one request to the daemon and maps a failure to an exit code. No daemon gives 4, a
// refusal gives 1. The connection may break or stay silent after the request went out. A mere
// question then ends with 4, too. A command ends with 5, because its effect is not known.
#pragma once

#include <functional>
#include <string>
#include <tl/expected.hpp>

#include "daemon/cli/context.h"
#include "daemon/control/messages.h"

namespace focalfleet::cli {

struct Question {
  std::string verb;
  Json args = Json::object();
  bool long_lasting = false;  // answered when the motion is over; until then progress shows that
                              // the daemon lives
  std::function<void(const Json&)> on_progress;
};

tl::expected<Json, Failure> Ask(const Context& context, const Question& question);

/// The name that the daemon uses for a file: its path, or the last part of a path that is
/// longer than the daemon keeps.
std::string SourceOf(const std::string& file);

/// Members of an answer. The functions are total: a member that is missing or of another type gives
/// the default. Texts are safe for a terminal (control/printable.h).
double NumberIn(const Json& object, const char* key, double otherwise = 0);
std::uint64_t CountIn(const Json& object, const char* key);
std::string TextIn(const Json& object, const char* key);
std::string TextOf(const Json& value);
const Json& ObjectIn(const Json& object, const char* key);
const Json& ListIn(const Json& object, const char* key);

/// `value` with its unit, or a dash where it is missing.
std::string Shown(const Json& object, const char* key, const char* unit, int decimals);

}  // namespace focalfleet::cli
