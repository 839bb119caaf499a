#include "daemon/status/renewing_status_publisher.h"

#include <spdlog/spdlog.h>

#include <utility>

namespace focalfleet {
namespace {

std::uint32_t UnitKey(const UnitStatusValue& value) { return value.unit.value; }
std::uint32_t OrientationKey(const UnitOrientationValue& value) { return value.unit.value; }
std::uint32_t BusKey(const BusStatusValue& value) { return value.bus.value; }

}  // namespace

template <class Value>
void RenewingStatusPublisher::Latest<Value>::Keep(const std::vector<Value>& newer,
                                                  std::uint32_t (*key)(const Value&)) {
  for (const Value& value : newer) {
    const auto [place, is_new] = place_of.emplace(key(value), values.size());
    if (is_new)
      values.push_back(value);
    else
      values[place->second] = value;
  }
}

RenewingStatusPublisher::RenewingStatusPublisher(Options options)
    : options_(std::move(options)),
      current_(std::make_unique<BufferedStatusPublisher>(options_.join)) {}

bool RenewingStatusPublisher::Publish(const StatusBatch& status) {
  if (options_.renews) Remember(status);
  Turn();
  if (next_ != nullptr) next_->Publish(status);
  const bool waits = current_->Publish(status);
  Count();
  return waits;
}

void RenewingStatusPublisher::Publish(const AlarmValue& alarm) {
  if (options_.renews) {
    alarms_.push_back(alarm);
    if (alarms_.size() > StatusPublisher::kAlarmsKept) alarms_.pop_front();
  }
  Turn();
  if (next_ != nullptr) next_->Publish(alarm);
  current_->Publish(alarm);
  Count();
}

void RenewingStatusPublisher::Remember(const StatusBatch& status) {
  units_.Keep(status.units, &UnitKey);
  orientations_.Keep(status.orientations, &OrientationKey);
  buses_.Keep(status.buses, &BusKey);
  if (status.fleet) rest_.fleet = status.fleet;
  if (status.configuration) rest_.configuration = status.configuration;
}

/// A renewal begins, or ends.
void RenewingStatusPublisher::Turn() {
  if (asked_.exchange(false)) {
    // A renewal that is overtaken by another one had older credentials.
    next_ = std::make_unique<BufferedStatusPublisher>(options_.join);
    joined_at_.reset();
    StatusBatch all = rest_;
    all.units = units_.values;
    all.orientations = orientations_.values;
    all.buses = buses_.values;
    next_->Publish(all);
    for (const AlarmValue& alarm : alarms_) next_->Publish(alarm);
  }
  if (next_ == nullptr || !next_->joined()) return;
  const auto now = options_.now();
  if (!joined_at_) joined_at_ = now;
  if (now - *joined_at_ < options_.overlap) return;
  earlier_samples_ += current_->samples();
  earlier_bytes_ += current_->bytes();
  current_ = std::move(next_);
  joined_at_.reset();
  spdlog::info("DDS: the new participant has taken the place of the old one");
}

void RenewingStatusPublisher::Count() {
  const bool both = next_ != nullptr;
  samples_ = earlier_samples_ + current_->samples() + (both ? next_->samples() : 0);
  bytes_ = earlier_bytes_ + current_->bytes() + (both ? next_->bytes() : 0);
}

}  // namespace focalfleet
