#include "tests/can/candump_log.h"

#include <charconv>
#include <optional>
#include <sstream>

namespace focalfleet::testing {
namespace {

constexpr std::size_t kExtendedDigits =
    8;  // candump writes 29-bit identifiers with 8 digits, others with 3
constexpr std::uint32_t kErrorFlag = 0x20000000;

template <class Number>
bool Parse(std::string_view text, int base, Number* out) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), *out, base);
  return error == std::errc() && end == text.data() + text.size() && !text.empty();
}

bool ParseTime(std::string_view text, std::int64_t* at_us) {
  std::int64_t seconds = 0;
  std::int64_t fraction = 0;
  if (text.size() < 3 || text.front() != '(' || text.back() != ')') return false;
  text = text.substr(1, text.size() - 2);
  const std::size_t dot = text.find('.');
  if (dot == std::string_view::npos || text.size() - dot != 7) return false;
  if (!Parse(text.substr(0, dot), 10, &seconds) || !Parse(text.substr(dot + 1), 10, &fraction))
    return false;
  *at_us = seconds * 1'000'000 + fraction;
  return true;
}

bool ParseData(std::string_view digits, CanFrame* frame) {
  if (digits.size() % 2 != 0 || digits.size() > 2 * frame->data.size()) return false;
  for (std::size_t i = 0; i < digits.size() / 2; ++i)
    if (!Parse(digits.substr(2 * i, 2), 16, &frame->data[i])) return false;
  frame->length = static_cast<std::uint8_t>(digits.size() / 2);
  return true;
}

enum class Kind { kFrame, kForeign, kBroken };

Kind ParseFrame(std::string_view text, CanFrame* frame) {
  const std::size_t hash = text.find('#');
  if (hash == std::string_view::npos || !Parse(text.substr(0, hash), 16, &frame->id))
    return Kind::kBroken;
  const std::string_view data = text.substr(hash + 1);
  const bool special = !data.empty() && (data[0] == '#' || data[0] == 'R');
  if (hash != kExtendedDigits || (frame->id & kErrorFlag) != 0 || special) return Kind::kForeign;
  return ParseData(data, frame) ? Kind::kFrame : Kind::kBroken;
}

}  // namespace

Result<CandumpLog> ParseCandump(const std::string& text) {
  CandumpLog log;
  std::istringstream in(text);
  int number = 0;
  for (std::string line; std::getline(in, line);) {
    ++number;
    std::istringstream words(line);
    std::string time;
    std::string frame_text;
    LoggedFrame logged;
    const bool three = static_cast<bool>(words >> time >> logged.interface >> frame_text);
    const Kind kind = three && ParseTime(time, &logged.at_us)
                          ? ParseFrame(frame_text, &logged.frame)
                          : Kind::kBroken;
    if (kind == Kind::kBroken)
      return Fail(ErrorCode::kInvalid, "line " + std::to_string(number) + ": not candump: " + line);
    if (kind == Kind::kForeign) ++log.foreign;
    if (kind == Kind::kFrame) log.frames.push_back(std::move(logged));
  }
  return log;
}

}  // namespace focalfleet::testing
