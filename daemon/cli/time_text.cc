#include "daemon/cli/time_text.h"

#include <charconv>
#include <chrono>
#include <cstdio>
#include <string_view>

namespace focalfleet::cli {
namespace {

constexpr double kSecondsMax = 100 * 365.25 * 86'400;

tl::unexpected<Error> NoTime(const std::string& text) {
  return Fail(ErrorCode::kInvalid,
              "'" + text + "' is no time; write 30m, 2h or 7d, or 2026-11-26T15:00:00Z (UTC)");
}

/// The part of a day in ns of `15:00` or `15:00:30`; below 0: it is none.
std::int64_t TimeOfDay(const std::string& text) {
  unsigned hour = 0;
  unsigned minute = 0;
  unsigned second = 0;
  int end = 0;
  if (std::sscanf(text.c_str(), "%2u:%2u%n", &hour, &minute, &end) != 2) return -1;
  if (static_cast<std::size_t>(end) < text.size()) {
    int rest = 0;
    if (std::sscanf(text.c_str() + end, ":%2u%n", &second, &rest) != 1) return -1;
    end += rest;
  }
  // Answers show milliseconds; a part of a second may follow.
  double part_s = 0;
  if (static_cast<std::size_t>(end) < text.size()) {
    const char* const last = text.data() + text.size();
    const auto [at, error] = std::from_chars(text.data() + end, last, part_s);
    if (text[static_cast<std::size_t>(end)] != '.' || error != std::errc() || at != last) return -1;
  }
  if (hour > 23 || minute > 59 || second > 59) return -1;
  return (std::int64_t{hour} * 3600 + minute * 60 + second) * 1'000'000'000 +
         static_cast<std::int64_t>(part_s * 1e9);
}

}  // namespace

Result<double> SecondsOf(const std::string& text) {
  const std::string_view units = "smhd";
  constexpr double kSeconds[] = {1, 60, 3600, 86'400};
  double factor = 1;
  std::string_view number = text;
  if (!number.empty())
    if (const auto unit = units.find(number.back()); unit != std::string_view::npos) {
      factor = kSeconds[unit];
      number.remove_suffix(1);
    }
  double value = 0;
  const auto [at, error] = std::from_chars(number.data(), number.data() + number.size(), value);
  const bool good = error == std::errc() && at == number.data() + number.size();
  if (!good || !(value > 0 && value * factor <= kSecondsMax)) return NoTime(text);
  return value * factor;
}

Result<WallTime> InstantOf(const std::string& text, WallTime now) {
  int year = 0;
  unsigned month = 0;
  unsigned day = 0;
  int end = 0;
  if (std::sscanf(text.c_str(), "%4d-%2u-%2u%n", &year, &month, &day, &end) != 3) {
    FOCALFLEET_TRY_ASSIGN(const double before_s, SecondsOf(text));
    return WallTime{now.ns - static_cast<std::int64_t>(before_s * 1e9)};
  }
  const std::chrono::year_month_day date{std::chrono::year(year), std::chrono::month(month),
                                         std::chrono::day(day)};
  std::string rest = text.substr(static_cast<std::size_t>(end));
  if (!rest.empty() && rest.back() == 'Z') rest.pop_back();
  const bool has_time = rest.size() > 1 && (rest.front() == 'T' || rest.front() == ' ');
  const std::int64_t of_day = has_time ? TimeOfDay(rest.substr(1)) : 0;
  if (!date.ok() || year < 1970 || year > 2200 || of_day < 0 || (!has_time && !rest.empty()))
    return NoTime(text);
  const std::chrono::nanoseconds days = std::chrono::sys_days(date).time_since_epoch();
  return WallTime{days.count() + of_day};
}

}  // namespace focalfleet::cli
