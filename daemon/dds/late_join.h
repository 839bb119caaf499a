// LateJoin makes a reader or writer of DDS whose domain can be joined now or only later. Joining
// needs two UDP ports of its own among those still free on this host (docs/adr/0006). Where other
// programs have taken them all, the fleet must still be able to move. The first attempt is made at
// once. After a failure a thread tries again until it succeeds, and ends.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <utility>

#include "protocol/base/result.h"

namespace focalfleet {

template <class T>
class LateJoin {
 public:
  struct Options {
    std::function<Result<std::unique_ptr<T>>()> join;
    /// Receives each new reason for a failure, and an empty text when it joins after a failure.
    /// Runs on the thread that makes the object, or on LateJoin's own.
    std::function<void(const std::string& trouble)> tell = [](const std::string&) {};
    /// An attempt that fails costs some milliseconds of another core. Half of this makes no reader
    /// wait noticeably less, and doubles what Cyclone writes to standard error each time.
    std::chrono::milliseconds period{5000};
  };

  explicit LateJoin(Options options) : options_(std::move(options)) {
    if (!Attempt()) thread_ = std::jthread([this](const std::stop_token& stop) { Retry(stop); });
  }
  LateJoin(const LateJoin&) = delete;
  LateJoin& operator=(const LateJoin&) = delete;
  ~LateJoin() = default;  // the thread, the last member, ends first

  /// The joined object; null: not joined yet. Once there, the object stays. Any thread may ask.
  [[nodiscard]] T* get() const { return joined_.load(std::memory_order_acquire); }

 private:
  bool Attempt() {
    auto made = options_.join();
    if (!made) {
      if (made.error().text != trouble_) options_.tell(made.error().text);
      trouble_ = made.error().text;
      return false;
    }
    held_ = std::move(*made);
    joined_.store(held_.get(), std::memory_order_release);
    if (!trouble_.empty()) options_.tell("");
    return true;
  }

  void Retry(const std::stop_token& stop) {
    std::mutex mutex;
    std::condition_variable_any ended;
    std::unique_lock lock(mutex);
    do {
      ended.wait_for(lock, stop, options_.period, [] { return false; });
      if (stop.stop_requested()) return;
    } while (!Attempt());
  }

  Options options_;
  std::string trouble_;  // used by one thread at a time
  std::unique_ptr<T> held_;
  std::atomic<T*> joined_{nullptr};
  std::jthread thread_;
};

}  // namespace focalfleet
