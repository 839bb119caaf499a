#include "fleet/files/spots_file.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdio>
#include <unordered_map>

#include "fleet/files/csv.h"
#include "fleet/files/line_limit.h"
#include "fleet/files/place.h"
#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

constexpr std::int64_t kNsPerSecond = 1'000'000'000;
constexpr std::int64_t kSecondsPerDay = 86'400;
constexpr int kYearMax = 2261;  // the last whole one that 63 bits of nanoseconds hold

std::string_view Trimmed(std::string_view text) {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t' || text.back() == '\r'))
    text.remove_suffix(1);
  return text;
}

struct Keyed {
  std::string_view value;
  int line = 0;  // 0: the key is not there
};

std::string Where(const std::string& file, int line) {
  return file + ":" + std::to_string(line) + ": ";
}

// Finds `# key: value` among the comment lines before the table.
Result<Keyed> FindKey(std::string_view text, const std::string& file, std::string_view key) {
  Keyed found;
  int line = 0;
  while (!text.empty()) {
    ++line;
    const std::size_t end = text.find('\n');
    std::string_view row = Trimmed(text.substr(0, end));
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    if (row.empty() || row.front() != '#') continue;
    row = Trimmed(row.substr(1));
    if (!row.starts_with(key)) continue;
    row = Trimmed(row.substr(key.size()));
    if (row.empty() || row.front() != ':') continue;
    if (found.line != 0)
      return Fail(ErrorCode::kInvalid, Where(file, line) + std::string(key) +
                                           ": is there twice, first in line " +
                                           std::to_string(found.line));
    found = {Trimmed(row.substr(1)), line};
  }
  if (found.line == 0)
    return Fail(ErrorCode::kInvalid,
                file + ": no line `# " + std::string(key) + ": ...` before the table");
  return found;
}

// Days since 1970-01-01 of the proleptic Gregorian calendar: years begin in March, so that the day
// that leaps is the last.
std::int64_t DaysOf(int year, int month, int day) {
  const std::int64_t y = year - (month <= 2 ? 1 : 0);
  const std::int64_t era = y / 400;
  const std::int64_t year_of_era = y - era * 400;
  const std::int64_t day_of_year = (153 * (month + (month > 2 ? -3 : 9)) + 2) / 5 + day - 1;
  return era * 146'097 + year_of_era * 365 + year_of_era / 4 - year_of_era / 100 + day_of_year -
         719'468;
}

int DaysIn(int year, int month) {
  constexpr std::array<int, 12> kDays = {31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31};
  const bool leap = (year % 4 == 0 && year % 100 != 0) || year % 400 == 0;
  return kDays[static_cast<std::size_t>(month - 1)] + (month == 2 && leap ? 1 : 0);
}

// Takes exactly `digits` digits, and then `after` where it is not 0.
bool Take(std::string_view* text, std::size_t digits, char after, int* value) {
  if (text->size() < digits + (after == 0 ? 0u : 1u)) return false;
  const std::string_view number = text->substr(0, digits);
  if (!std::all_of(number.begin(), number.end(), [](char c) { return c >= '0' && c <= '9'; }))
    return false;
  std::from_chars(number.data(), number.data() + digits, *value);
  text->remove_prefix(digits);
  if (after == 0) return true;
  const bool follows = text->front() == after;
  text->remove_prefix(1);
  return follows;
}

Spot ReadSpot(CsvRow* row, const SensorLimits& sensor) {
  Spot spot;
  spot.id = static_cast<std::uint32_t>(row->Integer("spot_id", {0, UINT32_MAX}));
  spot.x_px = row->Number("x_px");
  spot.y_px = row->Number("y_px");
  spot.flux = row->Number("flux");
  spot.fwhm_px = row->NumberIfAny("fwhm_px").value_or(0);
  if (row->error()) return spot;
  if (spot.x_px < -0.5 || spot.x_px > sensor.columns_px - 0.5)
    row->Reject("x_px", row->Text("x_px") + " is off the sensor");
  if (spot.y_px < -0.5 || spot.y_px > sensor.rows_px - 0.5)
    row->Reject("y_px", row->Text("y_px") + " is off the sensor");
  if (spot.flux <= 0) row->Reject("flux", row->Text("flux") + " is not above 0");
  if (spot.fwhm_px < 0) row->Reject("fwhm_px", row->Text("fwhm_px") + " is negative");
  return spot;
}

}  // namespace

Status CheckExposureId(std::string_view id) {
  const auto is_control = [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; };
  if (id.empty()) return Fail(ErrorCode::kInvalid, "is empty");
  if (id.size() > limits::kExposureIdBytes)
    return Fail(ErrorCode::kInvalid,
                "is longer than " + std::to_string(limits::kExposureIdBytes) + " characters");
  if (std::any_of(id.begin(), id.end(), is_control))
    return Fail(ErrorCode::kInvalid, "has control characters");
  return {};
}

Result<Exposure> ReadSpots(std::string_view text, std::string file, const SensorLimits& sensor) {
  Exposure exposure;
  FOCALFLEET_TRY_ASSIGN(const Keyed id, FindKey(text, file, "exposure_id"));
  if (const Status good = CheckExposureId(id.value); !good)
    return Fail(ErrorCode::kInvalid, Where(file, id.line) + "exposure_id: " + good.error().text);
  exposure.id = std::string(id.value);
  FOCALFLEET_TRY_ASSIGN(const Keyed taken, FindKey(text, file, "taken_utc"));
  const auto unix_ns = UnixNsOf(taken.value);
  if (!unix_ns)
    return Fail(ErrorCode::kInvalid,
                Where(file, taken.line) + "taken_utc: not a time like 2026-11-22T03:04:05.678Z");
  exposure.taken_unix_ns = *unix_ns;
  FOCALFLEET_TRY(CheckLines(text, file, std::size_t{2} * limits::kSpotsPerExposure));
  FOCALFLEET_TRY_ASSIGN(const CsvTable table, CsvTable::Parse(text, std::move(file)));
  FOCALFLEET_TRY(table.Require({"spot_id", "x_px", "y_px", "flux"}));
  if (table.size() > limits::kSpotsPerExposure)
    return tl::unexpected<Error>(
        table.ErrorAt(limits::kSpotsPerExposure,
                      "more than " + std::to_string(limits::kSpotsPerExposure) + " spots"));
  std::unordered_map<std::uint32_t, int> line_of;
  FOCALFLEET_TRY(table.ReadRows([&](CsvRow& row) {
    const Spot spot = ReadSpot(&row, sensor);
    if (row.error()) return;
    if (const auto [it, fresh] = line_of.emplace(spot.id, row.line()); !fresh)
      return row.RejectRow(
          "spot " + std::to_string(spot.id) + ": is there twice, first in " + LineOrRow(it->second),
          "is there twice");
    exposure.spots.push_back(spot);
  }));
  if (const auto checked = CheckSpots(exposure, sensor); !checked)
    return Fail(checked.error().code, table.file() + ": " + checked.error().text);
  return exposure;
}

std::string WriteSpots(const Exposure& exposure) {
  const bool widths = std::any_of(exposure.spots.begin(), exposure.spots.end(),
                                  [](const Spot& spot) { return spot.fwhm_px > 0; });
  std::vector<std::string_view> columns = {"spot_id", "x_px", "y_px", "flux"};
  if (widths) columns.emplace_back("fwhm_px");
  CsvWriter csv(columns);
  for (const Spot& spot : exposure.spots) {
    csv.Integer(spot.id).Number(spot.x_px).Number(spot.y_px).Number(spot.flux);
    if (widths) csv.Number(spot.fwhm_px);
    csv.EndRow();
  }
  return "# exposure_id: " + exposure.id + "\n# taken_utc: " + UtcOf(exposure.taken_unix_ns) +
         "\n" + csv.Take();
}

std::optional<std::int64_t> UnixNsOf(std::string_view utc) {
  int year = 0;
  int month = 0;
  int day = 0;
  int hour = 0;
  int minute = 0;
  int second = 0;
  if (!Take(&utc, 4, '-', &year) || !Take(&utc, 2, '-', &month) || !Take(&utc, 2, 'T', &day) ||
      !Take(&utc, 2, ':', &hour) || !Take(&utc, 2, ':', &minute) || !Take(&utc, 2, 0, &second))
    return std::nullopt;
  if (year < 1970 || year > kYearMax || month < 1 || month > 12 || day < 1 ||
      day > DaysIn(year, month) || hour > 23 || minute > 59 || second > 59)
    return std::nullopt;
  std::int64_t fraction_ns = 0;
  if (!utc.empty() && utc.front() == '.') {
    utc.remove_prefix(1);
    std::int64_t digit_ns = kNsPerSecond;
    while (!utc.empty() && utc.front() >= '0' && utc.front() <= '9' && digit_ns > 1) {
      digit_ns /= 10;
      fraction_ns += (utc.front() - '0') * digit_ns;
      utc.remove_prefix(1);
    }
    if (digit_ns == kNsPerSecond) return std::nullopt;
  }
  if (!utc.empty() && utc != "Z") return std::nullopt;
  const std::int64_t seconds = DaysOf(year, month, day) * kSecondsPerDay +
                               std::int64_t{hour} * 3600 + std::int64_t{minute} * 60 + second;
  return seconds * kNsPerSecond + fraction_ns;
}

std::string UtcOf(std::int64_t unix_ns) {
  const std::int64_t seconds = unix_ns / kNsPerSecond;
  const std::int64_t days = seconds / kSecondsPerDay;
  const auto of_day = static_cast<int>(seconds % kSecondsPerDay);
  // The year, month and day are found by search: days per year are known only by counting leap
  // days.
  int year = 1970 + static_cast<int>(days / 366);
  while (DaysOf(year + 1, 1, 1) <= days) ++year;
  int month = 1;
  while (month < 12 && DaysOf(year, month + 1, 1) <= days) ++month;
  const auto day = static_cast<int>(days - DaysOf(year, month, 1)) + 1;
  char text[64];
  std::snprintf(text, sizeof text, "%04d-%02d-%02dT%02d:%02d:%02d.%09d", year, month, day,
                of_day / 3600, of_day / 60 % 60, of_day % 60,
                static_cast<int>(unix_ns % kNsPerSecond));
  std::string utc = text;
  constexpr std::size_t kShortest = 23;  // three digits
  while (utc.size() > kShortest && utc.back() == '0') utc.pop_back();
  return utc + "Z";
}

}  // namespace focalfleet
