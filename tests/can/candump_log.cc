#include "tests/can/candump_log.h"

#include <charconv>
#include <sstream>

#include "protocol/wire/candump_line.h"

namespace focalfleet::test {
namespace {

template <class Number>
bool Parse(std::string_view text, Number* out) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), *out);
  return error == std::errc() && end == text.data() + text.size() && !text.empty();
}

bool ParseTime(std::string_view text, std::int64_t* at_us) {
  std::int64_t seconds = 0;
  std::int64_t fraction = 0;
  const std::size_t dot = text.find('.');
  if (dot == std::string_view::npos || text.size() - dot != 7) return false;
  if (!Parse(text.substr(0, dot), &seconds) || !Parse(text.substr(dot + 1), &fraction))
    return false;
  *at_us = seconds * 1'000'000 + fraction;
  return true;
}

}  // namespace

Result<CandumpLog> ParseCandump(const std::string& text) {
  CandumpLog log;
  std::istringstream in(text);
  int number = 0;
  for (std::string line; std::getline(in, line);) {
    ++number;
    const auto parsed = ParseCandumpLine(line);
    LoggedFrame logged;
    if (!parsed || !ParseTime(parsed->time, &logged.at_us))
      return Fail(ErrorCode::kInvalid, "line " + std::to_string(number) + ": not candump: " + line);
    if (parsed->foreign != nullptr) {
      ++log.foreign;
      continue;
    }
    logged.interface = parsed->interface;
    if (!parsed->group) {
      logged.frame = parsed->frame;
      log.frames.push_back(std::move(logged));
      continue;
    }
    const auto entries = UnpackGroup(*parsed->group);
    if (!entries)
      return Fail(ErrorCode::kInvalid, "line " + std::to_string(number) + ": no group: " + line);
    for (std::size_t i = 0; i < entries->count; ++i) {
      logged.frame = entries->frame[i];
      log.frames.push_back(logged);
    }
  }
  return log;
}

}  // namespace focalfleet::test
