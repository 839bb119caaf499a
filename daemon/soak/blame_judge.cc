#include "daemon/soak/blame_judge.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <variant>

namespace focalfleet::soak {
namespace {

/// Plans allow for so much.
constexpr double kClockAllowed = 0.005;
/// Readings of a clock are kept for so long, and their bounds hold for all of them.
constexpr DurationNs kReadingsLast = Seconds(200);
/// From a fault to the alarm that it causes, where the disk does not fail.
constexpr DurationNs kAlarmWithin = Seconds(60);

}  // namespace

bool BlameJudge::IsWell(std::size_t row, HostInstant since) const {
  const std::vector<HostInstant>& cuts = troubles_->jumps[row];
  return troubles_->units[row] < since && troubles_->deaf[row] < since &&
         (cuts.empty() || cuts.back() < since);
}

bool BlameJudge::IsHeard(std::size_t row, HostInstant since) const {
  const auto buses = plant_->layout().buses();
  const auto bus = std::lower_bound(buses.begin(), buses.end(), plant_->layout().units()[row].bus);
  return troubles_->buses[static_cast<std::size_t>(bus - buses.begin())] < since &&
         troubles_->store < since && IsWell(row, since);
}

void BlameJudge::Committed(std::span<const Row> rows, HostInstant now) {
  for (const Row& row : rows) {
    const auto* alarm = std::get_if<AlarmRow>(&row);
    if (alarm == nullptr || !alarm->unit) continue;
    const auto unit = plant_->layout().Find(*alarm->unit);
    if (!unit) continue;
    const std::size_t which = unit->value;
    const double error = plant_->world().Truth(*alarm->unit).clock_error;
    if (alarm->name == AlarmName::kUnitClockOff && std::abs(error) < kClockAllowed &&
        IsWell(which, now - kReadingsLast))
      broken_("blame", fmt::format("the clock of unit {} is off by {:.3f} %: {}",
                                   alarm->unit->value, 100 * error, alarm->text));
    if (alarm->name == AlarmName::kUnitSilent && IsHeard(which, now - kAlarmWithin))
      broken_("blame", fmt::format("unit {} was there: {}", alarm->unit->value, alarm->text));
  }
}

}  // namespace focalfleet::soak
