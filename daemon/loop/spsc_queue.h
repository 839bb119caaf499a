// A queue between two threads: one puts, one takes, none waits. The queue is a ring of fixed size
// with two counters. A full ring refuses the item and leaves it with the caller, which decides what
// to do.
#pragma once

#include <atomic>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

namespace focalfleet {

template <class T>
class SpscQueue {
 public:
  explicit SpscQueue(std::size_t capacity) : slots_(capacity) {}

  /// `*item` is in the queue. False: the queue is full, and `*item` is untouched.
  [[nodiscard]] bool Push(T* item) {
    const std::size_t put = put_.load(std::memory_order_relaxed);
    if (put - taken_.load(std::memory_order_acquire) == slots_.size()) return false;
    slots_[put % slots_.size()] = std::move(*item);
    put_.store(put + 1, std::memory_order_release);
    return true;
  }

  std::optional<T> Pop() {
    const std::size_t taken = taken_.load(std::memory_order_relaxed);
    if (taken == put_.load(std::memory_order_acquire)) return std::nullopt;
    std::optional<T> item;
    item.emplace(std::move(slots_[taken % slots_.size()]));
    taken_.store(taken + 1, std::memory_order_release);
    return item;
  }

  /// The size is exact on either thread while the other is at rest; else it may be outdated.
  [[nodiscard]] std::size_t size() const {
    return put_.load(std::memory_order_acquire) - taken_.load(std::memory_order_acquire);
  }
  [[nodiscard]] std::size_t capacity() const { return slots_.size(); }

 private:
  std::vector<T> slots_;
  // Each counter has its own cache line. On one line, each write would evict it from the other
  // core.
  alignas(64) std::atomic<std::size_t> put_{0};
  alignas(64) std::atomic<std::size_t> taken_{0};
};

}  // namespace focalfleet
