// Brings a controller back from bus-off. A driver may take a second to restart, so the attempt runs
// on a thread of its own that lives no longer than it. Attempts come 1, 2, 4 ... 60 s after one
// another: a bus that throws its controller off again at once must not be flooded by it, and a bus
// that was short-circuited for a moment shall not wait for a person.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include "protocol/base/instants.h"
#include "protocol/base/result.h"

namespace focalfleet {

class LinkRecovery {
 public:
  using Reviver = std::function<Status()>;
  struct Options {
    Reviver revive;
    DurationNs first_wait = Milliseconds(1000);  // of real time, as all here
    DurationNs longest_wait = Milliseconds(60'000);
    DurationNs poll_period = Milliseconds(10);  // while an attempt is under way
  };
  explicit LinkRecovery(Options options) : options_(std::move(options)) {}
  LinkRecovery(const LinkRecovery&) = delete;
  LinkRecovery& operator=(const LinkRecovery&) = delete;
  ~LinkRecovery();

  /// The controller is off, and nobody else restarts it. Said again, it changes nothing.
  void BusOff(HostInstant now);
  /// It works again. Soon after, the next bus-off waits as long as the next attempt would have.
  void Well(HostInstant now);

  /// Begins what is due. The outcome of an attempt, once.
  std::optional<Status> Poll(HostInstant now);
  [[nodiscard]] HostInstant wake_at() const { return wake_at_; }
  /// An attempt is under way.
  [[nodiscard]] bool trying() const { return attempt_ != nullptr; }

 private:
  struct Attempt {
    std::atomic<bool> over{false};
    Status outcome;
  };

  Options options_;
  bool off_ = false;
  DurationNs wait_{0};
  HostInstant well_since_{0};
  HostInstant wake_at_ = kNever;
  std::shared_ptr<Attempt> attempt_;
  std::thread thread_;
};

}  // namespace focalfleet
