// These functions choose where an axis is marked, and with which digits. On a linear axis the step
// is 1, 2 or 5 times a power of ten. A tick is an integer times that power. Labels therefore carry
// exactly the digits that separate neighbours, and no rounding of 0.1 shows. Large or small numbers
// share a factor 10^(3k), which stands once in the axis's title instead of in every label.
#pragma once

#include <string>
#include <vector>

namespace focalfleet::report {

/// Numbers beyond this are treated as infinite: differences of smaller numbers do not overflow.
inline constexpr double kPlottableMax = 1e300;

struct Range {
  double low = 0;
  double high = 1;
};

struct Tick {
  double value = 0;
  std::string label;
};

struct Ticks {
  std::vector<Tick> marks;  // ascending, inside the range
  int exponent = 0;         // label * 10^exponent = value; a multiple of 3
};

/// As many ticks as `count_max` allows, at least one.
/// Pre: low < high, both within kPlottableMax and further apart than a 1e-12th of the larger;
/// count_max > 1.
Ticks LinearTicks(Range range, int count_max);

/// The ticks of a logarithmic axis. Over many decades they are decades, or every second, third...
/// one. Over few decades they are 1-2-5; within less than one they are LinearTicks. The exponent is
/// 0 except within less than one decade.
/// Pre: as LinearTicks, and low > 0.
Ticks LogTicks(Range range, int count_max);

/// The power as text: "10³", "10⁻⁶".
std::string PowerOfTen(int exponent);

}  // namespace focalfleet::report
