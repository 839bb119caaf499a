#include "daemon/ports/link_recovery.h"

#include <algorithm>
#include <string>
#include <system_error>
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
  wait_ = std::min(wait_ * 2, options_.longest_wait);
  wake_at_ = now + options_.poll_period;
  try {
    thread_ = options_.start([attempt = attempt_, revive = options_.revive] {
      attempt->outcome = revive();
      attempt->over.store(true, std::memory_order_release);
    });
  } catch (const std::system_error& error) {
    // A host without a free thread is no reason to end: the bus stays off and is tried again.
    attempt_ = nullptr;
    wake_at_ = now + wait_;
    return Fail(ErrorCode::kUnavailable, std::string("no thread to restart it: ") + error.what());
  }
  return std::nullopt;
}

}  // namespace focalfleet
