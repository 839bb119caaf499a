// The names of alarms. Each alarm that is raised anywhere has one of these names; rules, scripts
// and docs/runbook.md go by it. The text of an alarm may change, its name may not. An alarm of a
// condition is open until the condition ends, any other one until somebody acknowledges it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace focalfleet {

enum class Severity : std::uint8_t { kInfo, kWarning, kError };
constexpr const char* Name(Severity severity) {
  constexpr const char* kNames[] = {"info", "warning", "error"};
  return kNames[static_cast<std::size_t>(severity)];
}

enum class AlarmName : std::uint8_t {
  kUnnamed,  // raised by a version whose alarms had no names
  // the host
  kStoreFailing,
  kStoreFull,
  kRowRefused,
  kDdsMissing,
  kCameraDdsMissing,
  kDdsBack,
  kMetricsMissing,
  kMetricsBack,
  kJournalMissing,
  kJournalBack,
  kDdsCredentialsEnding,
  kDdsCredentialsEnded,
  kDdsCredentialsRenewed,
  // buses
  kBusDown,
  kBusPassive,
  kBusTrouble,
  kBusUp,
  // units
  kUnitSilent,
  kUnitFault,
  kUnitLostPower,
  kUnitNeverBegan,
  kUnitUnfit,
  kUnitForeign,
  kUnitsExchanged,
  kUnitOtherVersion,
  kUnitWithoutSerial,
  kUnitPlaceLost,
  kUnitClockOff,
  kUnitDidNotMove,
  kUnitsSwapped,
  kUnitRefused,
  kParameterRefused,
  kCountRefused,
  kSensorsSilent,
  kSensorsDoubted,
  // configurations
  kConfigurationCutShort,
  kConfigurationNotMeasured,
  kCameraLate,
  kCameraFailed,
  kExposureRefused,
  kLostNotSought,
  kStartsApart,
  kStoppedByOther,
  kHomingUnproven,
  kUnitsTooNear,
  kNoRunUp,
  kRunUpsLeftOut,
  kUnitHeldBack,
  kUnitRetargeted,
  // a plane
  kPlaneSilent,
  kPlaneHeard,
  kSectorSilent,
  kSectorStartMissed,
  kSectorClockLoose,
  kSectorClocksGood,
};
inline constexpr AlarmName kLastAlarmName = AlarmName::kSectorClocksGood;
inline constexpr std::size_t kAlarmNameCount = static_cast<std::size_t>(kLastAlarmName) + 1;

/// When an open alarm is over.
enum class AlarmLife : std::uint8_t {
  kNote,       // never open: an event that asks for nothing
  kEvent,      // when somebody has acknowledged it
  kCondition,  // when the condition has ended
  kOfHost,     // the same; a condition that a new daemon finds anew, or not at all
};

struct AlarmKind {
  AlarmName name;
  const char* text;  // CamelCase
  Severity severity;
  AlarmLife life;
};

/// All names in their order; the entry of a name is at its number.
std::span<const AlarmKind> AlarmKinds();
/// The entry of the name; that of kUnnamed for a code that does not exist.
const AlarmKind& KindOf(AlarmName name);
/// The name as text: `BusDown`.
const char* Name(AlarmName name);
/// The name of a text, letter for letter; kUnnamed where there is none.
AlarmName AlarmNameOf(std::string_view text);
/// Where the runbook explains the alarm: `docs/runbook.md#busdown`; empty for kUnnamed.
std::string RunbookOf(AlarmName name);

}  // namespace focalfleet
