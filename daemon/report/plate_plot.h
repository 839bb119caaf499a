// These functions draw a value or a vector of each unit at its place on the focal plane, seen from
// the sky side: x to the right, y upwards. They are small plots of a page, 380 px wide. Units of
// one class are one path, so that 5000 of them are 70 kB. The colours of classes are from pale to
// strong, in blue and then in orange, which colour-blind readers see, too.
#pragma once

#include <string>
#include <vector>

#include "daemon/report/plot.h"

namespace focalfleet::report {

struct PlateValue {
  double x_mm = 0;
  double y_mm = 0;
  double value = 0;  // NaN: not known, drawn hollow
};

/// The number of classes, one more than their limits.
inline constexpr std::size_t kPlateClasses = 6;

/// Pre: `limits` are kPlateClasses - 1 finite values that ascend.
struct PlateMap {
  std::string title;
  std::string unit;
  std::vector<double> limits;  // the upper end of each class but the last
  std::vector<PlateValue> units;
};
/// Cost: O(units).
Svg DrawPlateMap(const PlateMap& map);

/// Limits for maps that are to be compared: round numbers between which the values, which are not
/// negative, share out. Values that are not finite have no part.
std::vector<double> PlateLimits(std::vector<double> values);

struct PlateVector {
  double x_mm = 0;
  double y_mm = 0;
  double dx_um = 0;  // NaN: not known, not drawn
  double dy_um = 0;
};

struct PlateArrows {
  std::string title;
  double scale_um = 0;  // the arrow that is as long as the distance between units; the key shows it
  std::vector<PlateVector> units;
};
/// Arrows longer than six times `scale_um` are drawn at that length, and counted below the plot.
/// Pre: scale_um > 0. Cost: O(units).
Svg DrawPlateArrows(const PlateArrows& arrows);

}  // namespace focalfleet::report
