// Result<T> is the outcome of an operation that can fail for reasons outside this project's
// reasoning. An Error is a code that some caller acts on and a sentence for people. Misbehaviour of
// a device is no Error: it is data.
#pragma once

#include <cstdint>
#include <string>
#include <tl/expected.hpp>
#include <utility>

namespace focalfleet {

enum class ErrorCode : std::uint8_t {
  kInvalid,      // the input is wrong and stays wrong: report it to its author
  kRefused,      // the input is fine, but the present state forbids it: try later
  kUnavailable,  // a file, interface, device or peer is missing or broken
  kFull,         // a disk, queue or table has no room
  kNewer,        // a later version of this program wrote it
};

struct Error {
  ErrorCode code = ErrorCode::kInvalid;
  std::string
      text;  // one line a fault: what, where (file:row), why, and what to do where that helps
};

template <class T>
using Result = tl::expected<T, Error>;
using Status = Result<void>;

[[nodiscard]] inline tl::unexpected<Error> Fail(ErrorCode code, std::string text) {
  return tl::unexpected<Error>(Error{code, std::move(text)});
}

}  // namespace focalfleet

#define FOCALFLEET_CONCAT_INNER(a, b) a##b
#define FOCALFLEET_CONCAT(a, b) FOCALFLEET_CONCAT_INNER(a, b)

/// The error of `expr` (a Result or Status), if it has one, is returned from the enclosing
/// function.
#define FOCALFLEET_TRY(expr)                                                            \
  do {                                                                                  \
    if (auto focalfleet_status = (expr); !focalfleet_status)                            \
      return tl::unexpected<::focalfleet::Error>(std::move(focalfleet_status).error()); \
  } while (false)

/// Like FOCALFLEET_TRY, and binds the value: FOCALFLEET_TRY_ASSIGN(const auto plan, MakePlan(...));
#define FOCALFLEET_TRY_ASSIGN(lhs, expr) \
  FOCALFLEET_TRY_ASSIGN_INNER(FOCALFLEET_CONCAT(focalfleet_result_, __LINE__), lhs, expr)
#define FOCALFLEET_TRY_ASSIGN_INNER(result, lhs, expr)                                \
  auto result = (expr);                                                               \
  if (!result) return tl::unexpected<::focalfleet::Error>(std::move(result).error()); \
  lhs = std::move(*result)
