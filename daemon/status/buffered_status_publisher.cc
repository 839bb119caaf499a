#include "daemon/status/buffered_status_publisher.h"

#include <spdlog/spdlog.h>

#include <span>

namespace focalfleet {

bool BufferedStatusPublisher::Publish(const StatusBatch& status) {
  Keep(status);
  if (joined_.get() == nullptr) return false;
  Offer(&units_);
  Offer(&orientations_);
  Offer(&buses_);
  Offer(&fleet_);
  Offer(&configuration_);
  Offer(&audit_head_);
  ReportAlarms();
  joined_.get()->Flush();
  Count();
  return !units_.values().empty();
}

void BufferedStatusPublisher::Publish(const AlarmValue& alarm) {
  alarms_.push_back(alarm);
  if (alarms_.size() > StatusPublisher::kAlarmsKept) alarms_.pop_front();
  if (joined_.get() == nullptr) return;
  ReportAlarms();
  joined_.get()->Flush();
  Count();
}

void BufferedStatusPublisher::Keep(const StatusBatch& status) {
  units_.Keep(status.units);
  orientations_.Keep(status.orientations);
  buses_.Keep(status.buses);
  if (status.fleet) fleet_ = status.fleet;
  if (status.configuration) configuration_ = status.configuration;
  if (status.audit_head) audit_head_ = status.audit_head;
}

template <class Value>
void BufferedStatusPublisher::Offer(Newest<Value>* kept) {
  if (kept->values().empty()) return;
  const auto taken = joined_.get()->Publish(std::span<const Value>(kept->values()));
  if (!taken) Note(tl::unexpected<Error>(taken.error()));
  // A value that DDS calls invalid would be invalid the next time, too.
  kept->DropFirst(taken ? *taken : kept->values().size());
}

template <class Value>
void BufferedStatusPublisher::Offer(std::optional<Value>* kept) {
  if (*kept) Note(joined_.get()->Publish(**kept));
  kept->reset();
}

void BufferedStatusPublisher::ReportAlarms() {
  for (const AlarmValue& alarm : alarms_) Note(joined_.get()->Publish(alarm));
  alarms_.clear();
}

void BufferedStatusPublisher::Note(const Status& status) {
  if (status || status.error().text == last_error_) return;
  last_error_ = status.error().text;
  spdlog::error("status cannot be published: {}", last_error_);
}

void BufferedStatusPublisher::Count() {
  samples_ = joined_.get()->counters().samples;
  bytes_ = joined_.get()->counters().payload_bytes;
}

}  // namespace focalfleet
