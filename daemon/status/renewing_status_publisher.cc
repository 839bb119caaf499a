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
  RenewIfAsked();
  const bool waits = current_->Publish(status);
  Count();
  return waits;
}

void RenewingStatusPublisher::Publish(const AlarmValue& alarm) {
  if (options_.renews) {
    alarms_.push_back(alarm);
    if (alarms_.size() > StatusPublisher::kAlarmsKept) alarms_.pop_front();
  }
  RenewIfAsked();
  current_->Publish(alarm);
  Count();
}

void RenewingStatusPublisher::Remember(const StatusBatch& status) {
  units_.Keep(status.units, &UnitKey);
  orientations_.Keep(status.orientations, &OrientationKey);
  buses_.Keep(status.buses, &BusKey);
  if (status.fleet) rest_.fleet = status.fleet;
  if (status.configuration) rest_.configuration = status.configuration;
  if (status.audit_head) rest_.audit_head = status.audit_head;
}

void RenewingStatusPublisher::RenewIfAsked() {
  if (!asked_.exchange(false)) return;
  earlier_samples_ += current_->samples();
  earlier_bytes_ += current_->bytes();
  current_.reset();
  current_ = std::make_unique<BufferedStatusPublisher>(options_.join);
  StatusBatch all = rest_;
  all.units = units_.values;
  all.orientations = orientations_.values;
  all.buses = buses_.values;
  current_->Publish(all);
  for (const AlarmValue& alarm : alarms_) current_->Publish(alarm);
  spdlog::info("DDS: a new participant has taken the place of the old one");
}

void RenewingStatusPublisher::Count() {
  samples_ = earlier_samples_ + current_->samples();
  bytes_ = earlier_bytes_ + current_->bytes();
}

}  // namespace focalfleet
