// One request to the daemon, and what its failure means to the caller: nobody there is exit code
// 4, an answer that says no is 1. Where the connection breaks or stays silent after the request
// went out, a mere question ends with 4, too; a command ends with 5, because nobody can say then
// whether it took effect.
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
  bool long_lasting = false;  // answered when the motion is over; progress says until then that
                              // the daemon lives
  std::function<void(const Json&)> on_progress;
};

tl::expected<Json, Failure> Ask(const Context& context, const Question& question);

/// The name by which the daemon is to call a file: its path, or the last part of a path that is
/// longer than the daemon keeps.
std::string SourceOf(const std::string& file);

/// Members of an answer, total: what is missing or of another type is the default. Texts are fit
/// for a terminal (control/printable.h).
double NumberIn(const Json& object, const char* key, double otherwise = 0);
std::uint64_t CountIn(const Json& object, const char* key);
std::string TextIn(const Json& object, const char* key);
std::string TextOf(const Json& value);
const Json& ObjectIn(const Json& object, const char* key);
const Json& ListIn(const Json& object, const char* key);

/// `value` with its unit, or a dash where it is missing.
std::string Shown(const Json& object, const char* key, const char* unit, int decimals);

}  // namespace focalfleet::cli
