// A histogram counts values by upper bounds, as Prometheus takes it. A single thread observes, and
// any thread may read meanwhile: a reading may lack the newest value in its sum.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <span>
#include <vector>

namespace focalfleet {

struct HistogramReading {
  std::vector<double> bounds;         // ascending; the bucket above the last has no bound
  std::vector<std::uint64_t> counts;  // Shape: (bounds + 1); of each bucket alone
  double sum = 0;
};

class Histogram {
 public:
  static constexpr std::size_t kBucketsMax = 12;  // with the one above the last bound

  /// Pre: `bounds` ascend, are at most kBucketsMax - 1, and live as long as the program.
  explicit Histogram(std::span<const double> bounds) : bounds_(bounds) {}

  void Observe(double value) {
    const auto bucket = std::distance(bounds_.begin(), std::ranges::lower_bound(bounds_, value));
    counts_[static_cast<std::size_t>(bucket)].fetch_add(1, std::memory_order_relaxed);
    sum_.fetch_add(value, std::memory_order_relaxed);
  }

  [[nodiscard]] HistogramReading Read() const {
    HistogramReading reading{.bounds = {bounds_.begin(), bounds_.end()}};
    for (std::size_t i = 0; i <= bounds_.size(); ++i)
      reading.counts.push_back(counts_[i].load(std::memory_order_relaxed));
    reading.sum = sum_.load(std::memory_order_relaxed);
    return reading;
  }

 private:
  std::span<const double> bounds_;
  std::array<std::atomic<std::uint64_t>, kBucketsMax> counts_{};
  std::atomic<double> sum_{0};
};

}  // namespace focalfleet
