#include "daemon/ports/link_recovery.h"

#include <algorithm>
#include <utility>

namespace focalfleet {

LinkRecovery::~LinkRecovery() {
  if (thread_.joinable()) thread_.join();
}

void LinkRecovery::BusOff(HostInstant now) {
  if (off_) return;
  off_ = true;
  const bool lasted = now - well_since_ > options_.longest_wait;
  if (wait_.ns == 0 || lasted) wait_ = options_.first_wait;
  wake_at_ = now + wait_;
}

void LinkRecovery::Well(HostInstant now) {
  if (!off_) return;
  off_ = false;
  well_since_ = now;
  if (!attempt_) wake_at_ = kNever;
}

std::optional<Status> LinkRecovery::Poll(HostInstant now) {
  if (now < wake_at_) return std::nullopt;
  if (attempt_) {
    wake_at_ = now + options_.poll_period;
    if (!attempt_->over.load(std::memory_order_acquire)) return std::nullopt;
    thread_.join();
    const Status outcome = std::exchange(attempt_, nullptr)->outcome;
    wake_at_ = off_ ? now + wait_ : kNever;
    return outcome;
  }
  attempt_ = std::make_shared<Attempt>();
  thread_ = std::thread([attempt = attempt_, revive = options_.revive] {
    attempt->outcome = revive();
    attempt->over.store(true, std::memory_order_release);
  });
  wait_ = std::min(wait_ * 2, options_.longest_wait);
  wake_at_ = now + options_.poll_period;
  return std::nullopt;
}

}  // namespace focalfleet
