#include "daemon/cli/client.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>

#include "daemon/control/line_client.h"
#include "daemon/control/printable.h"
#include "protocol/base/limits.h"

namespace focalfleet::cli {
namespace {

// Progress arrives several times a second; a daemon that is silent for this long hangs.
constexpr DurationNs kHangs = Seconds(120);
constexpr double kConnect_s = 10;  // a daemon takes a connection within a turn

bool ChangesNothing(const std::string& verb) {
  constexpr std::array<const char*, 10> kQuestions = {"status",  "unit",   "state",  "history",
                                                      "params",  "alarms", "events", "select",
                                                      "preview", "wait"};
  return std::find(kQuestions.begin(), kQuestions.end(), verb) != kQuestions.end();
}

}  // namespace

tl::expected<Json, Failure> Ask(const Context& context, const Question& question) {
  const std::string path = context.SocketPath();
  auto client = LineClient::Connect(path, Seconds(context.timeout_s.value_or(kConnect_s)));
  if (!client) {
    return tl::unexpected<Failure>(
        Failure{ExitCode::kNoDaemon,
                {ErrorCode::kUnavailable,
                 fmt::format("{}; is focalfleetd running, and is this its socket (--socket, "
                             "$FOCALFLEET_SOCKET)?",
                             client.error().text)}});
  }
  LineClient::CallOptions options;
  if (question.long_lasting) options.silence_max = kHangs;
  if (context.timeout_s) options.silence_max = Seconds(*context.timeout_s);
  options.on_progress = question.on_progress;
  auto answer = client->Call(question.verb, question.args, options);
  if (answer) return std::move(*answer);
  if (client->connected()) {
    // "Unavailable" from a daemon that listens means that the work began and a resource failed on
    // the way.
    const bool broken = answer.error().code == ErrorCode::kUnavailable;
    return tl::unexpected<Failure>(Failure{.exit = broken ? ExitCode::kBroken : ExitCode::kRefused,
                                           .error = answer.error(),
                                           .answered = true});
  }
  if (ChangesNothing(question.verb)) {
    return tl::unexpected<Failure>(
        Failure{ExitCode::kNoDaemon,
                {ErrorCode::kUnavailable,
                 fmt::format("{}; the daemon may hang (`focalfleet stop --direct` stops the units "
                             "without it)",
                             answer.error().text)}});
  }
  return tl::unexpected<Failure>(
      Failure{ExitCode::kBroken,
              {ErrorCode::kUnavailable,
               fmt::format("{}; whether `{}` took effect is not known: look at `focalfleet status`",
                           answer.error().text, question.verb)}});
}

std::string SourceOf(const std::string& file) {
  return file.size() <= limits::kTextBytes ? file : std::filesystem::path(file).filename().string();
}

namespace {

const Json* Find(const Json& object, const char* key) {
  if (!object.is_object()) return nullptr;
  const auto found = object.find(key);
  return found == object.end() ? nullptr : &*found;
}

}  // namespace

double NumberIn(const Json& object, const char* key, double otherwise) {
  const Json* value = Find(object, key);
  return value != nullptr && value->is_number() ? value->get<double>() : otherwise;
}

std::uint64_t CountIn(const Json& object, const char* key) {
  const Json* value = Find(object, key);
  return value != nullptr && value->is_number_unsigned() ? value->get<std::uint64_t>() : 0;
}

std::string TextOf(const Json& value) {
  return value.is_string() ? Printable(value.get_ref<const std::string&>()) : std::string();
}

std::string TextIn(const Json& object, const char* key) {
  const Json* value = Find(object, key);
  return value != nullptr ? TextOf(*value) : std::string();
}

const Json& ObjectIn(const Json& object, const char* key) {
  static const Json kNothing = Json::object();
  const Json* value = Find(object, key);
  return value != nullptr && value->is_object() ? *value : kNothing;
}

const Json& ListIn(const Json& object, const char* key) {
  static const Json kNothing = Json::array();
  const Json* value = Find(object, key);
  return value != nullptr && value->is_array() ? *value : kNothing;
}

std::string Shown(const Json& object, const char* key, const char* unit, int decimals) {
  const Json* value = Find(object, key);
  if (value == nullptr || !value->is_number()) return "-";
  return fmt::format("{:.{}f}{}{}", value->get<double>(), decimals, *unit == '\0' ? "" : " ", unit);
}

}  // namespace focalfleet::cli
