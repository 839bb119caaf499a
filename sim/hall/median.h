// The median of a list of numbers, robust against a few that are far off.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace focalfleet::sim {

/// The upper of the two middle values where their number is even; 0 of an empty list. Cost: O(n).
inline double Median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace focalfleet::sim
