// The input is any bytes as lines of candump. A line must give a frame, a foreign frame or a
// reason. An accepted frame stands in bounds. Written as `candump -l` would write it, it reads back
// as the same frame.
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <string>
#include <string_view>

#include "protocol/base/check.h"
#include "protocol/wire/candump_line.h"

namespace focalfleet {
namespace {

void TryAgain(const CanFrame& frame) {
  char text[64];
  int end = std::snprintf(text, sizeof text, "(1.000000) can0 %08X#", frame.id);
  for (const std::uint8_t byte : frame.payload())
    end += std::snprintf(text + end, sizeof text - static_cast<std::size_t>(end), "%02X", byte);
  const auto again = ParseCandumpLine(text);
  FOCALFLEET_CHECK(again && again->foreign == nullptr && again->frame == frame);
}

void Try(std::string_view raw) {
  const std::string line = WithoutDecoration(raw);
  FOCALFLEET_CHECK(line.size() <= raw.size());
  if (const auto note = ParseCandumpNote(line))
    FOCALFLEET_CHECK(!note->text.empty() && note->text.size() <= line.size());
  const auto parsed = ParseCandumpLine(line);
  if (!parsed) {
    FOCALFLEET_CHECK(parsed.error() != nullptr && *parsed.error() != 0);
    return;
  }
  FOCALFLEET_CHECK(parsed->frame.length <= 8 && parsed->frame.id <= kCanIdMax);
  FOCALFLEET_CHECK(!parsed->interface.empty());
  if (parsed->group) {
    FOCALFLEET_CHECK(parsed->foreign == nullptr && parsed->group->length <= 64);
  } else if (parsed->foreign == nullptr) {
    TryAgain(parsed->frame);
  }
}

}  // namespace
}  // namespace focalfleet

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::string_view text(static_cast<const char*>(static_cast<const void*>(data)), size);
  while (!text.empty()) {
    const std::size_t end = text.find('\n');
    focalfleet::Try(text.substr(0, end));
    text = end == std::string_view::npos ? std::string_view{} : text.substr(end + 1);
  }
  return 0;
}
