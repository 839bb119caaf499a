// The residuals of a diagnosis as people look at them: signed, along the axes, against the columns
// of the campaign, by order of the gears, by unit. A length hides what a sign shows: play is as far
// off on one side as on the other, and its lengths are flat. Nothing here decides anything.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "sim/campaigns/diagnosis/decide/diagnosis.h"

namespace focalfleet::sim {

/// The errors of both axes' angles at every row, measured less predicted, by static geometry alone
/// and by the extended model. NaN: not measured, or the pose does not separate the axes.
/// Shape: (rows).
struct AngleResiduals {
  std::vector<double> before_deg[2];
  std::vector<double> after_deg[2];
};
/// Cost: O(rows).
AngleResiduals AngleResidualsOf(const CampaignFacts& facts, const Diagnosis& diagnosis);

/// A curve through a cloud: for each bin along x the median of y, and the bounds between which two
/// thirds of y lie. Bins have as many points each; equal x are in one bin.
struct MedianCurve {
  std::vector<double> x;
  std::vector<double> median, low, high;
  /// The chi-square of the medians about their mean, less its expectation, per bin: 0 is chance.
  double structure = 0;
};
/// Points of which either number is not finite have no part. Pre: equal lengths. Cost: O(n log n).
MedianCurve MedianAlong(std::span<const double> x, std::span<const double> y);

/// The amplitude of a sine of so many periods a turn of the axis in the errors of its angle: the
/// root mean square over units, each with its own phase.
struct OrderSpectrum {
  std::vector<double> order;
  std::vector<double> before_deg, after_deg;
  double chance_deg = 0;  // of errors without structure, as large as those after
};
/// Orders go up to six periods a turn of the motor, and between its harmonics only to where gears
/// have teeth. At most kSpectrumRows rows are read, of units taken evenly. Cost: some 1000
/// multiplications a row.
OrderSpectrum SpectrumOf(const Campaign& campaign, const AngleResiduals& residuals,
                         std::size_t axis);
/// Some 40 million multiplications. Half or twice of it changes the noise of
inline constexpr std::size_t kSpectrumRows = 40'000;

/// Root mean square of each unit's residuals. NaN: never measured. Shape: (units).
struct UnitResiduals {
  std::vector<double> before_um, after_um;
};
UnitResiduals UnitResidualsOf(const Campaign& campaign, const Diagnosis& diagnosis);

/// The exposure whose median residual before is the largest, of those that see nearly all units: an
/// index into facts.exposures. nullopt: nothing was measured.
std::optional<std::uint32_t> WorstExposure(const CampaignFacts& facts, const Diagnosis& diagnosis);

}  // namespace focalfleet::sim
