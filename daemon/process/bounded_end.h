// Parts of the daemon that may hang end at the same time, within a limit. Such parts are a planner
// in a long search, a camera's folder on a dead file system, a driver that restarts. A part that
// has not ended by then still uses what it was given. The process then has to end by _exit, without
// destructors.
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
    std::function<void()> end;  // runs on a thread of its own; returns when the part has ended
  };

  /// All parts have begun to end.
  explicit BoundedEnd(std::vector<Part> parts);
  BoundedEnd(const BoundedEnd&) = delete;
  BoundedEnd& operator=(const BoundedEnd&) = delete;
  /// Waits for all parts, however long that takes.
  ~BoundedEnd() = default;

  /// The names of the parts that have not ended `limit` after the constructor.
  std::vector<std::string> Wait(std::chrono::milliseconds limit);

 private:
  const std::chrono::steady_clock::time_point begun_ = std::chrono::steady_clock::now();
  std::mutex mutex_;
  std::condition_variable ended_;
  std::set<std::string> left_;
  std::vector<std::jthread> threads_;  // last: the threads use all members above
};

}  // namespace focalfleet
