// Ends what may hang (a planner in a long search, a camera's folder on a dead file system, a driver
// that restarts) at the same time, and waits no longer than it is told to. What has not ended by
// then still uses what it was given, so the process has to go without taking anything down:
// by _exit.
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <vector>

namespace focalfleet {

class BoundedEnd {
 public:
  struct Part {
    std::string name;           // for people; no two alike
    std::function<void()> end;  // on a thread of its own; returns when it has ended
  };

  /// Begins to end all of them.
  explicit BoundedEnd(std::vector<Part> parts);
  BoundedEnd(const BoundedEnd&) = delete;
  BoundedEnd& operator=(const BoundedEnd&) = delete;
  /// Waits for all of them, however long that takes.
  ~BoundedEnd() = default;

  /// The names of those that have not ended `limit` after they were begun.
  std::vector<std::string> Wait(std::chrono::milliseconds limit);

 private:
  const std::chrono::steady_clock::time_point begun_ = std::chrono::steady_clock::now();
  std::mutex mutex_;
  std::condition_variable ended_;
  std::set<std::string> left_;
  std::vector<std::jthread> threads_;  // last: they use all of the above
};

}  // namespace focalfleet
