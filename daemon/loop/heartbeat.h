// A question to a thread whether it still works, and its answer. The core asks. The thread answers
// whenever it passes a place that shows it at work: a turn of its loop, a step of a long plan.
// Neither waits.
#pragma once

#include <atomic>
#include <cstdint>

namespace focalfleet {

class Heartbeat {
 public:
  /// An answer is expected from now on; one to an earlier question does not count.
  void Ask() { asked_.fetch_add(1); }
  /// The last question has its answer, or none was asked.
  [[nodiscard]] bool answered() const { return answered_ == asked_; }

  /// All questions so far have their answer. True: one of them had none. Any thread may call this.
  bool Answer() {
    const std::uint64_t asked = asked_;
    return answered_.exchange(asked) != asked;
  }

 private:
  std::atomic<std::uint64_t> asked_{0};
  std::atomic<std::uint64_t> answered_{0};
};

}  // namespace focalfleet
