#include "fleet/records.h"

#include <limits>

namespace focalfleet {
namespace {

// A value that does not fit was never taken by a unit: the drive stays as it is.
template <class Whole>
void Take(std::int32_t value, Whole* into) {
  if (value >= 1 && value <= std::numeric_limits<Whole>::max()) *into = static_cast<Whole>(value);
}

}  // namespace

void TakeParameter(const ParameterRow& row, UnitDrive* drive) {
  AxisDrive& axis = drive->axis[Index(row.axis)];
  switch (row.parameter) {
    case Parameter::kCounter1:
      return Take(row.value, &axis.counter1);
    case Parameter::kRepeat:
      return Take(row.value, &axis.repeat);
    case Parameter::kSubdivision:
      return Take(row.value, &axis.subdivision);
    case Parameter::kMode:
      if (row.value >= 0 && row.value <= static_cast<std::int32_t>(WaveMode::kSevenSegment))
        drive->mode = static_cast<WaveMode>(row.value);
      return;
    case Parameter::kHostTimeoutMs:
    case Parameter::kPosition:
    case Parameter::kMinPosition:
    case Parameter::kMaxPosition:
    case Parameter::kHomePosition:
      return;
  }
}

}  // namespace focalfleet
