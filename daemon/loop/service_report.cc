#include "daemon/loop/service_report.h"

#include <fmt/format.h>

#include <algorithm>

#include "daemon/clock/clock.h"

namespace focalfleet {

std::string ServiceStatusLine(const FleetView& view, const std::string& trouble) {
  const FleetCounts counts = CountFleet(view);
  std::string line = fmt::format(
      "{} of {} units ready", counts.by_phase[std::size_t(UnitPhase::kReady)], view.layout->size());
  const ConfigurationView& configuration = view.coordinator->configuration();
  if (view.coordinator->busy())
    line += fmt::format("; configuration {} is {}: {} of {} arrived", configuration.id,
                        Name(configuration.state), configuration.counts.arrived,
                        configuration.counts.targeted);
  if (!trouble.empty()) line += "; " + trouble;
  return line;
}

void ServiceReport::Serve(const FleetView& view, bool changed) {
  if (!socket_->present()) return;
  changed_ |= changed;
  const bool had_trouble = watchdog_ != nullptr && !watchdog_->trouble().empty();
  if (watchdog_ != nullptr) watchdog_->Serve(view.now);
  const std::string trouble = watchdog_ != nullptr ? watchdog_->trouble() : "";
  // The line is late by no more than a period, but trouble may be the last that is heard.
  const bool due = changed_ && view.now >= status_at_;
  if (ready_ && !due && had_trouble == !trouble.empty()) return;
  std::string line = ServiceStatusLine(view, trouble);
  status_at_ = view.now + status_period_;
  changed_ = false;
  if (ready_ && line == status_) return;
  // A message that finds the queue full is sent in a later turn.
  if (!socket_->Send((ready_ ? "STATUS=" : "READY=1\nSTATUS=") + line)) {
    changed_ = true;
    return;
  }
  ready_ = true;
  status_ = std::move(line);
}

HostInstant ServiceReport::wake_at() const {
  if (!socket_->present()) return kNever;
  const HostInstant watchdog = watchdog_ != nullptr ? watchdog_->wake_at() : kNever;
  return changed_ ? std::min(watchdog, status_at_) : watchdog;
}

void ServiceReport::BeginReload() {
  [[maybe_unused]] const bool sent =
      socket_->Send(fmt::format("RELOADING=1\nMONOTONIC_USEC={}", ReadMonotonicNs() / 1000));
}
void ServiceReport::EndReload() {
  if (!ready_) return;                            // the first turn reports it
  if (!socket_->Send("READY=1")) ready_ = false;  // the next turn reports it
}
void ServiceReport::Ending() {
  [[maybe_unused]] const bool sent = socket_->Send("STOPPING=1\nSTATUS=ending");
}

}  // namespace focalfleet
