// BoundedQuestion asks something that may hang, and waits for the answer no longer than its
// patience. The kernel takes a question about an interface within `send`, and holds the caller
// there while another interface goes down and up (its global lock; up to a second with some
// drivers). No timeout of a socket ends that, so the question has a thread of its own, which ends
// with it.
//
// While a question hangs no other is begun: it would hang, too. Its callers are refused at once.
// Thereby fifty buses together wait no longer than one, and at most one thread hangs.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "protocol/base/result.h"

namespace focalfleet {

class BoundedQuestion {
 public:
  using Answer = Result<std::vector<std::byte>>;
  struct Options {
    /// An answer that does not wait for the lock comes within some 100 us. With a tenth of it a
    /// busy host would lose answers; five times as much is half of what a stop may take.
    std::chrono::milliseconds patience{20};
    /// Starts a thread, or throws as std::thread does.
    std::function<std::thread(std::function<void()>)> start = [](std::function<void()> work) {
      return std::thread(std::move(work));
    };
  };
  explicit BoundedQuestion(Options options) : options_(std::move(options)) {}

  /// The answer of `ask`. Any thread may call. Errors: those of `ask`; kUnavailable: there is no
  /// answer within the patience, an earlier question hangs still, or there is no thread.
  Answer operator()(std::function<Answer()> ask);

 private:
  struct Open {
    std::mutex lock;
    std::condition_variable done;
    bool over = false;  // under the lock
    Answer answer;      // likewise
  };

  Options options_;
  std::mutex lock_;
  std::shared_ptr<Open> open_;  // under the lock; null: none is under way
};

}  // namespace focalfleet
