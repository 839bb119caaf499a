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
  HandOverIfFollowed();
  bool waits = current_->Publish(status);
  if (next_ != nullptr) waits = next_->Publish(status) || waits;
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
  if (next_ != nullptr) next_->Publish(alarm);
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

StatusBatch RenewingStatusPublisher::WholeState() const {
  StatusBatch all = rest_;
  all.units = units_.values;
  all.orientations = orientations_.values;
  all.buses = buses_.values;
  return all;
}

void RenewingStatusPublisher::RenewIfAsked() {
  if (next_ != nullptr || !asked_.exchange(false)) return;
  end_ = {asked_end_ns_};
  next_ = std::make_unique<BufferedStatusPublisher>(options_.join);
  next_->Publish(WholeState());
  for (const AlarmValue& alarm : alarms_) next_->Publish(alarm);
}

void RenewingStatusPublisher::HandOverIfFollowed() {
  if (next_ == nullptr) return;
  const HostInstant now = options_.clock.Now();
  const bool all_there = next_->joined() && next_->unit_readers() >= current_->unit_readers();
  // A reader that is known here may still wait for its own end of the handshake. A value that it
  // has acknowledged shows that it reads.
  if (!all_there)
    followed_since_.reset();
  else if (!followed_since_ && next_->acknowledged())
    followed_since_ = now;
  const bool followed = followed_since_ && now - *followed_since_ >= options_.settled;
  if (!followed && options_.clock.Wall() < end_) return;
  followed_since_.reset();
  earlier_samples_ += current_->samples();
  earlier_bytes_ += current_->bytes();
  current_ = std::move(next_);
  current_->Publish(WholeState());
  spdlog::info("DDS: a new participant has taken the place of the old one");
}

void RenewingStatusPublisher::Count() {
  const bool renewing = next_ != nullptr;
  samples_ = earlier_samples_ + current_->samples() + (renewing ? next_->samples() : 0);
  bytes_ = earlier_bytes_ + current_->bytes() + (renewing ? next_->bytes() : 0);
}

}  // namespace focalfleet
