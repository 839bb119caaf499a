// Confidence intervals for a share of which `hits` in `trials` were seen.
#pragma once

namespace focalfleet::hidden {

struct Interval {
  double low = 0;
  double high = 1;
};

/// Wilson's score interval, 95 %. Without trials: 0 to 1.
Interval Wilson(int hits, int trials);

/// Clopper and Pearson's exact interval, 95 %: never too short. Cost: some 100 sums of `trials`
/// terms.
Interval ClopperPearson(int hits, int trials);

}  // namespace focalfleet::hidden
