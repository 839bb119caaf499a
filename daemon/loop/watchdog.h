// The watchdog asks each thread in rounds whether it still works, and tells the service manager
// that the daemon does only after all have answered. Serve runs on the core thread, so a core that
// hangs feeds nothing either. A thread that has not answered within the limit is named once, and
// nothing is fed until it answers.
//
// The limit is counted in four parts, each of which the core must see pass. Where the whole process
// was paused, the threads thereby get time to answer before they are named.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "daemon/loop/heartbeat.h"
#include "protocol/base/instants.h"

namespace focalfleet {

class Watchdog {
 public:
  struct Thread {
    std::string name;  // for people
    Heartbeat* heartbeat = nullptr;
    std::function<void()> wake;  // a thread that sleeps wakes up, and answers
  };
  struct Options {
    /// From one round to the next, in host time. A round that is answered late delays the next.
    DurationNs period;
    /// Within this host time of a question all must have answered.
    DurationNs limit;
    std::function<void()> feed;
    std::function<void(const std::string&)> log_error;
    std::function<void(const std::string&)> log_info;
  };
  Watchdog(std::vector<Thread> threads, Options options);

  /// A turn of the core: asks, feeds or names where it is time.
  void Serve(HostInstant now);
  /// The instant at which Serve has something to do without an answer.
  [[nodiscard]] HostInstant wake_at() const { return next_; }
  /// The threads that do not answer, for people; empty: all do.
  [[nodiscard]] const std::string& trouble() const { return trouble_; }

 private:
  static constexpr int kParts = 4;

  void AskAll(HostInstant now);
  [[nodiscard]] std::string Unanswered() const;

  std::vector<Thread> threads_;
  Options options_;
  bool asking_ = false;
  int parts_passed_ = 0;
  HostInstant asked_at_;
  HostInstant next_;  // of the next round, or of the next part of the limit
  std::string trouble_;
};

}  // namespace focalfleet
