// The conditions that a row must satisfy to be kept. A single rule serves all. The store checks
// before it writes and when it reads back. The thread in front of the store sets rows aside by it,
// and the store of the tests refuses by it. A row that passes can be read back as it was given.
#pragma once

#include <string>

#include "fleet/records.h"

namespace focalfleet {

inline constexpr MeasurementStatus kLastMeasurementStatus = MeasurementStatus::kTooCoarse;
inline constexpr MeasurementSource kLastMeasurementSource = MeasurementSource::kSensors;
inline constexpr WaveMode kLastMode = WaveMode::kSevenSegment;
inline constexpr IntentEnd kLastIntentEnd = IntentEnd::kHomed;
inline constexpr ConfigurationState kLastConfigurationState = ConfigurationState::kFailed;
inline constexpr Severity kLastSeverity = Severity::kError;
inline constexpr Parameter kLastParameter = static_cast<Parameter>(kParameterCount - 1);

// Each overload returns nullptr, or the fault in words for operators.
const char* Flaw(const AxisKnowledge& knowledge);
const char* Flaw(const FibreCarrierReading& carrier);
const char* Flaw(const TuningRow& row);
const char* Flaw(const Row& row);

/// The subject of the row: "vectors of serial 7", "alarm 12".
std::string Describe(const Row& row);

}  // namespace focalfleet
