#include "daemon/status_outlet.h"

#include <spdlog/spdlog.h>

namespace focalfleet {

bool StatusOutlet::Publish(const StatusBatch& status) {
  Keep(status.units);
  const auto taken = publisher_->Publish(std::span<const UnitStatusValue>(units_));
  if (!taken) Note(tl::unexpected<Error>(taken.error()));
  // A value that DDS calls wrong would be wrong the next time, too.
  const std::size_t gone = taken ? *taken : units_.size();
  units_.erase(units_.begin(), units_.begin() + static_cast<std::ptrdiff_t>(gone));
  place_of_.clear();
  for (std::size_t i = 0; i < units_.size(); ++i) place_of_[units_[i].unit] = i;
  if (!status.orientations.empty()) {
    const auto told =
        publisher_->Publish(std::span<const UnitOrientationValue>(status.orientations));
    if (!told) Note(tl::unexpected<Error>(told.error()));
  }
  if (!status.buses.empty()) {
    const auto buses = publisher_->Publish(std::span<const BusStatusValue>(status.buses));
    if (!buses) Note(tl::unexpected<Error>(buses.error()));
  }
  if (status.fleet) Note(publisher_->Publish(*status.fleet));
  if (status.configuration) Note(publisher_->Publish(*status.configuration));
  publisher_->Flush();
  Count();
  return !units_.empty();
}

void StatusOutlet::Publish(const AlarmValue& alarm) {
  Note(publisher_->Publish(alarm));
  publisher_->Flush();
  Count();
}

void StatusOutlet::Keep(const std::vector<UnitStatusValue>& units) {
  if (units_.empty()) {
    units_ = units;
    return;
  }
  for (const UnitStatusValue& unit : units) {
    const auto [it, is_new] = place_of_.emplace(unit.unit, units_.size());
    if (is_new)
      units_.push_back(unit);
    else
      units_[it->second] = unit;
  }
}

void StatusOutlet::Note(const Status& status) {
  if (status || status.error().text == last_error_) return;
  last_error_ = status.error().text;
  spdlog::error("status cannot be published: {}", last_error_);
}

void StatusOutlet::Count() {
  samples_ = publisher_->counters().samples;
  bytes_ = publisher_->counters().payload_bytes;
}

}  // namespace focalfleet
