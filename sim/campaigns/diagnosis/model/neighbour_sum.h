// The variance of a sum of vectors of which neighbours are alike, as noise with memory makes them.
// Products of neighbours count too, with weights that fall to zero. Vectors come one by one, in the
// order of their times. Source: Newey and West, Econometrica 55, 703, 1987.
#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cstddef>

#include "sim/campaigns/effects/effect.h"

namespace focalfleet::sim {

inline constexpr std::size_t kNeighbourLags = 4;

/// The weight of a product of vectors so many places apart.
constexpr double NeighbourShare(std::size_t lag) {
  return 1 - static_cast<double>(lag) / (kNeighbourLags + 1);
}

/// The running sum. kSize: of the vectors; Eigen::Dynamic: up to kColumnsMax.
template <int kSize>
class NeighbourSum {
 public:
  static constexpr int kMost = kSize == Eigen::Dynamic ? static_cast<int>(kColumnsMax) : kSize;
  using Small = Eigen::Matrix<double, kSize, 1, 0, kMost, 1>;
  using Square = Eigen::Matrix<double, kSize, kSize, 0, kMost, kMost>;

  /// `inverse`: of the matrix that is the unit of the variance.
  explicit NeighbourSum(const Square& inverse) : inverse_(inverse) {
    past_.fill(Small::Zero(inverse.rows()));
  }
  void Add(const Small& v) {
    const Small w = inverse_ * v;
    sum_ += v.dot(w);
    for (std::size_t lag = 1; lag <= kNeighbourLags; ++lag)
      sum_ +=
          2 * NeighbourShare(lag) * past_[(next_ + kNeighbourLags - lag) % kNeighbourLags].dot(w);
    past_[next_++ % kNeighbourLags] = v;
  }
  /// Trace of inverse * variance. Never negative.
  [[nodiscard]] double sum() const { return std::max(sum_, 0.0); }

 private:
  Square inverse_;
  std::array<Small, kNeighbourLags> past_;
  std::size_t next_ = 0;
  double sum_ = 0;
};

}  // namespace focalfleet::sim
