// Any bytes as a line on a control socket, in both directions, which the first byte picks: a
// message or an error, never more. What was read and is written again reads back the same; a
// request becomes a command of units that exist, or is refused with words.
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <variant>

#include "daemon/control/messages.h"
#include "daemon/requested_command.h"
#include "protocol/base/check.h"
#include "tests/daemon/shell/small_fleet.h"

namespace focalfleet {
namespace {

constexpr std::uint32_t kUnitCount = 3;

void CheckUnits(const Command& command) {
  const auto exists = [](PositionerIndex i) { FOCALFLEET_CHECK(i.value < kUnitCount); };
  std::visit(
      [&](const auto& what) {
        using What = std::decay_t<decltype(what)>;
        if constexpr (requires { what.units; }) {
          for (const PositionerIndex i : what.units) exists(i);
        } else if constexpr (std::is_same_v<What, StopCommand>) {
          if (what.unit) exists(*what.unit);
        } else if constexpr (std::is_same_v<What, MeasureCommand>) {
          return;  // all units at once
        } else if constexpr (std::is_same_v<What, ApplyCommand>) {
          FOCALFLEET_CHECK(what.targets.size() == kUnitCount);
        } else if constexpr (std::is_same_v<What, KeepModelCommand>) {
          FOCALFLEET_CHECK(false);  // made by the desk itself
        } else {
          exists(what.unit);
        }
      },
      command.what);
}

void TryRequest(std::string_view line) {
  const auto request = DecodeRequest(line);
  if (!request) {
    FOCALFLEET_CHECK(!request.error().text.empty());
    return;
  }
  const auto again = DecodeRequest(EncodeRequest(*request));
  FOCALFLEET_CHECK(again && again->id == request->id && again->verb == request->verb);
  FOCALFLEET_CHECK(again->args == request->args);
  static const SmallFleet fleet(kUnitCount);
  const auto command = CommandOf(*request, fleet.View());
  if (command) {
    CheckUnits(*command);
  } else {
    FOCALFLEET_CHECK(!command.error().text.empty());
  }
}

void TryAnswer(std::string_view line) {
  const auto answer = DecodeAnswer(line);
  if (!answer) {
    FOCALFLEET_CHECK(!answer.error().text.empty());
    return;
  }
  using Kind = ControlAnswer::Kind;
  const std::string written = answer->kind == Kind::kError ? EncodeError(answer->id, answer->error)
                              : answer->kind == Kind::kProgress
                                  ? EncodeProgress(answer->id, answer->body)
                                  : EncodeResult(answer->id, answer->body);
  const auto again = DecodeAnswer(written);
  FOCALFLEET_CHECK(again && again->id == answer->id && again->kind == answer->kind);
  FOCALFLEET_CHECK(again->body == answer->body && again->error.code == answer->error.code);
}

}  // namespace
}  // namespace focalfleet

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string_view line(static_cast<const char*>(static_cast<const void*>(data + 1)),
                              size - 1);
  if (data[0] % 2 == 0)
    focalfleet::TryRequest(line);
  else
    focalfleet::TryAnswer(line);
  return 0;
}
