// Reliability compares the probabilities that reports state with how often they are right. Each
// candidate of each named cause counts by its own probability, in ten bins; static geometry, which
// has no rivals, does not count. The candidate "unknown" is right where no other of the cause is.
// A report is calibrated where the share that is right is the mean
// of what was stated.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "tests/hidden/score/verdicts.h"

namespace focalfleet::hidden {

struct ReliabilityBin {
  int count = 0;
  int right = 0;
  double stated_sum = 0;
  [[nodiscard]] double stated() const { return count > 0 ? stated_sum / count : 0; }
  [[nodiscard]] double share() const { return count > 0 ? static_cast<double>(right) / count : 0; }
};

/// Bin k has the candidates stated with a probability from k / 10 to (k + 1) / 10.
using Reliability = std::array<ReliabilityBin, 10>;

Reliability ReliabilityOf(const std::vector<Case>& cases);

/// The mean distance of what is stated from what is right, weighted by counts; nullopt where
/// nothing was stated.
std::optional<double> CalibrationError(const Reliability& reliability);

std::string TableOf(const Reliability& reliability);

/// An SVG picture: a point a bin with its Clopper-Pearson interval and count, and the diagonal.
std::string PictureOf(const Reliability& reliability);

}  // namespace focalfleet::hidden
