// The queue of next events: a binary heap of (instant, slot) in which a slot's instant can be
// moved. Equal instants go by slot, so that the order of events does not depend on the history of
// the heap.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "protocol/base/instants.h"

namespace focalfleet::sim {

class EventQueue {
 public:
  /// All slots begin at kNever.
  explicit EventQueue(std::size_t slots) : at_(slots, kNever), place_(slots), heap_(slots) {
    for (std::size_t i = 0; i < slots; ++i) place_[i] = heap_[i] = static_cast<std::uint32_t>(i);
  }

  [[nodiscard]] HostInstant next() const { return heap_.empty() ? kNever : at_[heap_[0]]; }
  [[nodiscard]] std::size_t slot() const { return heap_[0]; }

  /// Cost: O(log slots).
  void Set(std::size_t slot, HostInstant at) {
    if (at_[slot] == at) return;
    at_[slot] = at;
    std::size_t i = place_[slot];
    while (i > 0 && Before(heap_[i], heap_[(i - 1) / 2])) i = Swap(i, (i - 1) / 2);
    for (;;) {
      std::size_t first = i;
      for (std::size_t child = 2 * i + 1; child <= 2 * i + 2 && child < heap_.size(); ++child)
        if (Before(heap_[child], heap_[first])) first = child;
      if (first == i) return;
      i = Swap(i, first);
    }
  }

 private:
  [[nodiscard]] bool Before(std::uint32_t a, std::uint32_t b) const {
    return at_[a] != at_[b] ? at_[a] < at_[b] : a < b;
  }
  std::size_t Swap(std::size_t i, std::size_t j) {
    std::swap(heap_[i], heap_[j]);
    place_[heap_[i]] = static_cast<std::uint32_t>(i);
    place_[heap_[j]] = static_cast<std::uint32_t>(j);
    return j;
  }

  std::vector<HostInstant> at_;
  std::vector<std::uint32_t> place_;
  std::vector<std::uint32_t> heap_;
};

}  // namespace focalfleet::sim
