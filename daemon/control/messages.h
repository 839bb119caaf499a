// The messages of a control socket: one JSON object a line.
//
//   request   {"id":1,"verb":"apply","args":{...}}
//             {"id":1,"verb":"apply","args":{...},"caller":{...}}        from the daemon's own HTTP
//   answers   {"id":1,"progress":{...}}                                  any number, may be lost
//             {"id":1,"ok":true,"result":{...}}                          the last one, or
//             {"id":1,"ok":false,"error":{"code":"refused","text":"..."}}
//
// All functions are total: any bytes give a request or an Error, and nothing throws. Depth and
// number of a line's values are bounded before it is parsed (limits::kControlDepth,
// kControlValues), because on the core thread a short line must not cost much. Its length is
// bounded, too: a model alone may have more than limits::kControlLineBytes.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/access/caller.h"
#include "protocol/base/limits.h"
#include "protocol/base/result.h"

namespace focalfleet {

using Json = nlohmann::json;

/// The number; null where it is not finite, which JSON cannot say.
Json Number(double value);

struct ControlRequest {
  std::uint64_t id = 0;
  std::string verb;
  Json args = Json::object();
  /// The caller on whose behalf another door of the daemon asks; none: the client itself asks.
  std::optional<Caller> caller = {};
};

struct ControlAnswer {
  enum class Kind : std::uint8_t { kProgress, kResult, kError };
  std::uint64_t id = 0;
  Kind kind = Kind::kResult;
  Json body;    // progress or result
  Error error;  // where kError
};

const char* CodeName(ErrorCode code);
/// The code of a name. An unknown name is kUnavailable: the peer failed in an unknown way.
ErrorCode CodeOf(std::string_view name);

/// The object of a text, within the limits of a request. Errors: kInvalid.
Result<Json> DecodeObject(std::string_view text);
/// The request of a line. Errors: kInvalid; the answer then goes out with id 0, as no id is known.
Result<ControlRequest> DecodeRequest(std::string_view line);
/// The answer of a line. Errors: kInvalid.
Result<ControlAnswer> DecodeAnswer(std::string_view line);

/// Encoders give the line without its newline. Text that is not UTF-8 is repaired, NaN becomes
/// null.
std::string EncodeRequest(const ControlRequest& request);
std::string EncodeProgress(std::uint64_t id, const Json& progress);
/// The same for a progress that many clients get: `text` is EncodeText of it.
std::string ProgressLine(std::uint64_t id, std::string_view text);
std::string EncodeText(const Json& json);
std::string EncodeResult(std::uint64_t id, const Json& result);
std::string EncodeError(std::uint64_t id, const Error& error);

// Arguments by name, checked. Errors of all these functions: kInvalid, names the argument.
Result<std::uint64_t> UnsignedArgument(const Json& args, const char* name);
Result<std::int64_t> IntegerArgument(const Json& args, const char* name);
Result<double> NumberArgument(const Json& args, const char* name);
/// A short text, as a name or a reason. Errors: also where it is longer than `bytes_max`.
Result<std::string> TextArgument(const Json& args, const char* name,
                                 std::size_t bytes_max = limits::kTextBytes);
/// The same, or `otherwise` where the argument is absent.
Result<std::string> TextArgumentOr(const Json& args, const char* name, std::string otherwise,
                                   std::size_t bytes_max = limits::kTextBytes);
Result<bool> FlagArgumentOr(const Json& args, const char* name, bool otherwise);
Result<std::uint64_t> UnsignedArgumentOr(const Json& args, const char* name,
                                         std::uint64_t otherwise);
/// A list of numbers that fit 32 bits.
Result<std::vector<std::uint32_t>> UnsignedListArgument(const Json& args, const char* name);

}  // namespace focalfleet
