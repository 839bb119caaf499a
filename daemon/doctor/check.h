// A check of `focalfleet doctor`: whether one thing is as the fleet needs it, and what to type
// where it is not.
#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace focalfleet::doctor {

enum class Verdict : std::uint8_t { kOk, kWarn, kFail };
constexpr const char* Name(Verdict verdict) {
  constexpr const char* kNames[] = {"ok", "warn", "fail"};
  return kNames[static_cast<std::size_t>(verdict)];
}

struct Check {
  std::string name;  // what was looked at; a text for scripts, the same in every version
  Verdict verdict = Verdict::kOk;
  std::string text;  // what was found
  std::string todo;  // what to type, or to do; empty where it is ok

  bool operator==(const Check&) const = default;
};

Check Ok(std::string name, std::string text);
Check Warn(std::string name, std::string text, std::string todo);
Check Fail(std::string name, std::string text, std::string todo);

/// The worst verdict; kOk of none.
Verdict Worst(std::span<const Check> checks);

}  // namespace focalfleet::doctor
