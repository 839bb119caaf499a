// The measurement of a campaign has the errors of camera and log: noise, outliers, missing rows,
// swaps, wraps. The clean class has Gaussian noise of one size and nothing else.
#pragma once

#include <string>
#include <vector>

#include "tests/hidden/generator/evidence.h"
#include "tests/hidden/generator/plant.h"
#include "tests/hidden/generator/spec.h"

namespace focalfleet::hidden {

/// The measured campaign, by row unless stated otherwise.
struct Measurement {
  std::vector<Place> place_mm;
  std::vector<char> seen;
  // Seen, and not of a stuck unit, which shows nothing of what is planted.
  std::vector<char> counts;
  std::vector<char> bad;  // an outlier, a stuck or swapped unit: an oracle must not fit it
  std::vector<ByAxis> reported_from_deg;
  std::vector<ByAxis> reported_cmd_deg;
  std::vector<double> reported_temp_C;
  std::vector<std::uint32_t> blank;  // bit c: covariate cell c is empty
  std::vector<int> troubled_unit_ids;
  std::vector<std::string> also_true;  // causes that a nuisance makes true
  NoiseModel noise;                    // as drawn
};

/// The true geometry and the scatter of the axes.
Truth DrawTruth(const Spec& spec, const Campaign& campaign);

Measurement Measure(const Spec& spec, const Scene& scene, const Truth& truth,
                    const std::vector<Effect>& effects);

}  // namespace focalfleet::hidden
