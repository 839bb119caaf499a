// LinkRecovery brings a controller back from bus-off. A driver may take a second to restart, so
// each attempt runs on a thread of its own that ends with it. Attempts are 1, 2, 4 ... 60 s apart.
// The growing wait protects a bus that throws its controller off again at once. The first short one
// lets a bus recover from a brief short circuit without an operator.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include "protocol/base/instants.h"
#include "protocol/base/result.h"

namespace focalfleet {

class LinkRecovery {
 public:
  using Reviver = std::function<Status()>;
  struct Options {
    Reviver revive;
    DurationNs first_wait = Milliseconds(1000);  // of real time, as all durations here
    DurationNs longest_wait = Milliseconds(60'000);
    DurationNs poll_period = Milliseconds(10);  // while an attempt is under way
    /// Starts a thread, or throws as std::thread does.
    std::function<std::thread(std::function<void()>)> start = [](std::function<void()> work) {
      return std::thread(std::move(work));
    };
  };
  explicit LinkRecovery(Options options) : options_(std::move(options)) {}
  LinkRecovery(const LinkRecovery&) = delete;
  LinkRecovery& operator=(const LinkRecovery&) = delete;
  ~LinkRecovery();

  /// The controller is off, and nothing else restarts it. Repeated calls change nothing.
  void BusOff(HostInstant now);
  /// The controller works again. A bus-off soon afterwards waits as long as the next attempt would
  /// have.
  void Well(HostInstant now);

  /// Begins the attempt that is due. Returns the outcome of each attempt, once.
  std::optional<Status> Poll(HostInstant now);
  [[nodiscard]] HostInstant wake_at() const { return wake_at_; }
  /// True while an attempt is under way.
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
