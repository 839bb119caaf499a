// The truth about a planted campaign is the size and visibility of each effect, and the other
// causes that could have made the same picture. The noise that is left for a perfect model is part
// of it. A perfect model's gain on moves that it has not seen is another.
#pragma once

#include <string>
#include <vector>

#include "tests/hidden/generator/measure.h"

namespace focalfleet::hidden {

struct Visibility {
  double lambda = 0;
  double survival = 0;     // share of the whitened effect that the static geometry leaves
  double rms_um = 0;       // over the seen rows of the units with the effect
  double rms_left_um = 0;  // the same after a least-squares fit of the static geometry
  std::vector<double> lambda_by_unit;  // zero for units without the effect
};

/// The part of the places that an effect adds. Shape: by unit with the effect (weight not 0) the
/// moves, in um; empty for the others.
std::vector<std::vector<Place>> Contribution(const Scene& scene, const Truth& truth,
                                             const Effect& effect);

Visibility Assess(const Scene& scene, const NoiseModel& noise, const std::vector<char>& seen,
                  const std::vector<std::vector<Place>>& contribution_um);

/// The factor on chi-square that makes the effect as easy to find as one with a single free
/// coefficient at `lambda`. The factor is above 1 for several units, each by itself, or many
/// phases.
double LambdaScale(const Effect& effect);

/// Scales the effect until it explains `lambda_wanted` (or as much as physics allows).
void Tune(const Scene& scene, const Truth& truth, const NoiseModel& noise,
          const std::vector<char>& seen, double lambda_wanted, Effect* effect);

struct Rival {
  std::string cause;
  double cosine = 0;
};

/// Other causes, on any axis, with the share of this effect that their own signature can take over,
/// with the static geometry free. Cosines below 0.5 are left out. Sorted, nearest first.
std::vector<Rival> FindRivals(const Scene& scene, const NoiseModel& noise,
                              const std::vector<char>& seen, const Effect& effect);

struct OracleGain {
  double rms_before_um = 0;  // 2-D, held out, static geometry fitted
  double rms_after_um = 0;   // with the true contribution taken away
  double mad_before_um = 0;  // median of the 2-D residuals
  double mad_after_um = 0;
  std::size_t rows = 0;
};

/// The oracle's gain in five folds of moves in short blocks. Rows that are bad or were not seen are
/// left out.
OracleGain AskOracle(const Campaign& campaign, const Measurement& measured,
                     const std::vector<std::vector<Place>>& contribution_um);

struct StaticVisibility {
  double zero_offset = 0;  // chi-square of the error given that the others are free
  double base_offset = 0;
  double arm_length = 0;
};

StaticVisibility AssessStatic(const Campaign& campaign, const Truth& truth, const NoiseModel& noise,
                              const std::vector<char>& seen);

}  // namespace focalfleet::hidden
