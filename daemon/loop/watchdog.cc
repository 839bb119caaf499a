#include "daemon/loop/watchdog.h"

#include <utility>

namespace focalfleet {

Watchdog::Watchdog(std::vector<Thread> threads, Options options)
    : threads_(std::move(threads)), options_(std::move(options)) {}

void Watchdog::AskAll(HostInstant now) {
  for (const Thread& thread : threads_) {
    thread.heartbeat->Ask();
    thread.wake();
  }
  asking_ = true;
  parts_passed_ = 0;
  asked_at_ = now;
  next_ = now + DurationNs{options_.limit.ns / kParts};
}

std::string Watchdog::Unanswered() const {
  std::string names;
  for (const Thread& thread : threads_)
    if (!thread.heartbeat->answered())
      names += (names.empty() ? "the " : ", the ") + thread.name + " thread";
  return names;
}

void Watchdog::Serve(HostInstant now) {
  if (!asking_ && now >= next_) AskAll(now);
  if (!asking_) return;
  const std::string unanswered = Unanswered();
  if (unanswered.empty()) {
    if (!std::exchange(trouble_, "").empty()) options_.log_info("all threads answer again");
    options_.feed();
    asking_ = false;
    next_ = asked_at_ + options_.period;
    return;
  }
  if (now < next_) return;
  if (++parts_passed_ < kParts) {
    next_ = now + DurationNs{options_.limit.ns / kParts};
    return;
  }
  next_ = kNever;
  trouble_ = "no answer from " + unanswered;
  options_.log_error(trouble_ + "; the service manager gets no sign of life until there is one");
}

}  // namespace focalfleet
