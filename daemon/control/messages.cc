#include "daemon/control/messages.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "protocol/base/json_marks.h"
#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

constexpr std::array<std::pair<ErrorCode, const char*>, 5> kCodes = {{
    {ErrorCode::kInvalid, "invalid"},
    {ErrorCode::kRefused, "refused"},
    {ErrorCode::kUnavailable, "unavailable"},
    {ErrorCode::kFull, "full"},
    {ErrorCode::kNewer, "newer"},
}};

std::string Dump(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

tl::unexpected<Error> Malformed(const std::string& what) {
  return Fail(ErrorCode::kInvalid, "malformed control line: " + what);
}

const Json* Member(const Json& object, const char* name) {
  const auto it = object.find(name);
  return it == object.end() ? nullptr : &*it;
}

tl::unexpected<Error> BadArgument(const char* name, const char* expected) {
  return Fail(ErrorCode::kInvalid, std::string("argument '") + name + "' must be " + expected);
}

/// An unsigned number; one that this program made may be of a signed type.
std::optional<std::uint64_t> UnsignedOf(const Json& value) {
  if (!value.is_number_integer()) return std::nullopt;
  if (!value.is_number_unsigned() && value.get<std::int64_t>() < 0) return std::nullopt;
  return value.get<std::uint64_t>();
}

/// Checks depth and number of values before any is made: a parser takes 60 bytes for a bracket.
Status CheckShape(std::string_view line, std::size_t values_max) {
  std::size_t values = 0;
  Status shape;
  ForEachJsonMark(line, [&](char mark, std::size_t, std::size_t depth) {
    if (mark == ',' || mark == '[' || mark == '{') ++values;
    if (depth > limits::kControlDepth)
      shape = Malformed("lists and objects within one another, more than " +
                        std::to_string(limits::kControlDepth) + " deep");
    else if (values > values_max)
      shape = Malformed("more than " + std::to_string(values_max) + " values");
    return shape.has_value();
  });
  return shape;
}

Result<Json> ParseObject(std::string_view line, std::size_t values_max) {
  FOCALFLEET_TRY(CheckShape(line, values_max));
  Json json = Json::parse(line, nullptr, /*allow_exceptions=*/false);
  if (json.is_discarded()) return Malformed("not JSON");
  if (!json.is_object()) return Malformed("not an object");
  return json;
}

/// Whether the line may be a model: the verb stands before its arguments or behind them, so near an
/// end of the line.
bool MayBeAModel(std::string_view line) {
  constexpr std::string_view kVerb = "\"model_load\"";
  constexpr std::size_t kNear = 512;
  const auto names_it = [](std::string_view part) {
    return part.find(kVerb) != std::string_view::npos;
  };
  return names_it(line.substr(0, kNear)) ||
         names_it(line.substr(line.size() - std::min(kNear, line.size())));
}

/// {token, role, address}, all of them texts.
Result<Caller> CallerOf(const Json& object) {
  const auto text = [&](const char* name) {
    const Json* const value = object.is_object() ? Member(object, name) : nullptr;
    const bool fits = value != nullptr && value->is_string() &&
                      value->get_ref<const std::string&>().size() <= limits::kTextBytes;
    return fits ? value->get<std::string>() : std::string();
  };
  const auto role = RoleOf(text("role"));
  if (!role || text("token").empty()) return Malformed("'caller' must name a token and its role");
  return Caller{
      .role = *role, .door = Door::kHttp, .token = text("token"), .address = text("address")};
}

Result<std::uint64_t> IdOf(const Json& object) {
  const Json* id = Member(object, "id");
  const auto number = id == nullptr ? std::nullopt : UnsignedOf(*id);
  if (!number) return Malformed("'id' must be a whole number, not negative");
  return *number;
}

}  // namespace

Json Number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

const char* CodeName(ErrorCode code) {
  for (const auto& [known, name] : kCodes)
    if (known == code) return name;
  return "unavailable";
}

ErrorCode CodeOf(std::string_view name) {
  for (const auto& [code, known] : kCodes)
    if (name == known) return code;
  return ErrorCode::kUnavailable;
}

Result<Json> DecodeObject(std::string_view text) {
  return ParseObject(text, limits::kControlValues);
}

Result<ControlRequest> DecodeRequest(std::string_view line) {
  if (line.size() > limits::kControlLineBytes && !MayBeAModel(line))
    return Malformed("more than " + std::to_string(limits::kControlLineBytes) +
                     " bytes, which a model alone may have");
  FOCALFLEET_TRY_ASSIGN(Json json, ParseObject(line, limits::kControlValues));
  ControlRequest request;
  FOCALFLEET_TRY_ASSIGN(request.id, IdOf(json));
  const Json* verb = Member(json, "verb");
  if (verb == nullptr || !verb->is_string()) return Malformed("'verb' must be a text");
  request.verb = verb->get<std::string>();
  if (request.verb.size() > limits::kVerbBytes)
    return Malformed("'verb' has more than " + std::to_string(limits::kVerbBytes) + " bytes");
  if (const auto args = json.find("args"); args != json.end()) {
    if (!args->is_object()) return Malformed("'args' must be an object");
    request.args = std::move(*args);
  }
  if (const Json* const caller = Member(json, "caller")) {
    FOCALFLEET_TRY_ASSIGN(request.caller, CallerOf(*caller));
  }
  return request;
}

Result<ControlAnswer> DecodeAnswer(std::string_view line) {
  FOCALFLEET_TRY_ASSIGN(Json json, ParseObject(line, line.size()));
  ControlAnswer answer;
  FOCALFLEET_TRY_ASSIGN(answer.id, IdOf(json));
  if (const auto progress = json.find("progress"); progress != json.end()) {
    answer.kind = ControlAnswer::Kind::kProgress;
    answer.body = std::move(*progress);
    return answer;
  }
  const Json* ok = Member(json, "ok");
  if (ok == nullptr || !ok->is_boolean()) return Malformed("neither 'progress' nor 'ok'");
  if (ok->get<bool>()) {
    if (const auto result = json.find("result"); result != json.end())
      answer.body = std::move(*result);
    return answer;
  }
  answer.kind = ControlAnswer::Kind::kError;
  const Json* error = Member(json, "error");
  if (error == nullptr || !error->is_object()) return Malformed("'error' must be an object");
  const Json* code = Member(*error, "code");
  const Json* text = Member(*error, "text");
  answer.error.code = code != nullptr && code->is_string()
                          ? CodeOf(code->get_ref<const std::string&>())
                          : ErrorCode::kUnavailable;
  answer.error.text =
      text != nullptr && text->is_string() ? text->get<std::string>() : "no reason given";
  return answer;
}

std::string EncodeRequest(const ControlRequest& request) {
  Json object{{"id", request.id}, {"verb", request.verb}, {"args", request.args}};
  if (request.caller)
    object["caller"] = {{"token", request.caller->token},
                        {"role", Name(request.caller->role)},
                        {"address", request.caller->address}};
  return Dump(object);
}

std::string EncodeText(const Json& json) { return Dump(json); }

std::string ProgressLine(std::uint64_t id, std::string_view text) {
  return R"({"id":)" + std::to_string(id) + R"(,"progress":)" + std::string(text) + "}";
}

std::string EncodeProgress(std::uint64_t id, const Json& progress) {
  return ProgressLine(id, Dump(progress));
}

std::string EncodeResult(std::uint64_t id, const Json& result) {
  return Dump({{"id", id}, {"ok", true}, {"result", result}});
}

std::string EncodeError(std::uint64_t id, const Error& error) {
  return Dump({{"id", id},
               {"ok", false},
               {"error", Json{{"code", CodeName(error.code)}, {"text", error.text}}}});
}

Result<std::uint64_t> UnsignedArgument(const Json& args, const char* name) {
  const Json* value = Member(args, name);
  const auto number = value == nullptr ? std::nullopt : UnsignedOf(*value);
  if (!number) return BadArgument(name, "a whole number, not negative");
  return *number;
}

Result<std::int64_t> IntegerArgument(const Json& args, const char* name) {
  const Json* value = Member(args, name);
  if (value == nullptr || !value->is_number_integer() ||
      (value->is_number_unsigned() &&
       value->get<std::uint64_t>() > std::uint64_t{std::numeric_limits<std::int64_t>::max()}))
    return BadArgument(name, "a whole number");
  return value->get<std::int64_t>();
}

Result<double> NumberArgument(const Json& args, const char* name) {
  const Json* value = Member(args, name);
  if (value == nullptr || !value->is_number()) return BadArgument(name, "a number");
  return value->get<double>();
}

Result<std::string> TextArgument(const Json& args, const char* name, std::size_t bytes_max) {
  const Json* value = Member(args, name);
  if (value == nullptr || !value->is_string()) return BadArgument(name, "a text");
  const auto& text = value->get_ref<const std::string&>();
  if (text.size() > bytes_max)
    return Fail(ErrorCode::kInvalid, std::string("argument '") + name + "' has " +
                                         std::to_string(text.size()) + " bytes, at most " +
                                         std::to_string(bytes_max) + " are taken");
  return text;
}

Result<std::string> TextArgumentOr(const Json& args, const char* name, std::string otherwise,
                                   std::size_t bytes_max) {
  if (Member(args, name) == nullptr) return otherwise;
  return TextArgument(args, name, bytes_max);
}

Result<bool> FlagArgumentOr(const Json& args, const char* name, bool otherwise) {
  const Json* value = Member(args, name);
  if (value == nullptr) return otherwise;
  if (!value->is_boolean()) return BadArgument(name, "true or false");
  return value->get<bool>();
}

Result<std::uint64_t> UnsignedArgumentOr(const Json& args, const char* name,
                                         std::uint64_t otherwise) {
  if (Member(args, name) == nullptr) return otherwise;
  return UnsignedArgument(args, name);
}

Result<std::vector<std::uint32_t>> UnsignedListArgument(const Json& args, const char* name) {
  const Json* list = Member(args, name);
  if (list == nullptr || !list->is_array()) return BadArgument(name, "a list of whole numbers");
  std::vector<std::uint32_t> out;
  out.reserve(list->size());
  for (const Json& item : *list) {
    const auto number = UnsignedOf(item);
    if (!number || *number > std::numeric_limits<std::uint32_t>::max())
      return BadArgument(name, "a list of whole numbers");
    out.push_back(static_cast<std::uint32_t>(*number));
  }
  return out;
}

}  // namespace focalfleet
