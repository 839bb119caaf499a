#include "fleet/alarm_name.h"

#include <cstddef>
#include <iterator>

namespace focalfleet {
namespace {

using enum AlarmName;
using enum Severity;
using enum AlarmLife;

constexpr AlarmKind kKinds[] = {
    {kUnnamed, "unnamed", kWarning, kEvent},
    {kStoreFailing, "StoreFailing", kError, kOfHost},
    {kStoreFull, "StoreFull", kError, kOfHost},
    {kRowRefused, "RowRefused", kError, kEvent},
    {kDdsMissing, "DdsMissing", kError, kOfHost},
    {kCameraDdsMissing, "CameraDdsMissing", kError, kOfHost},
    {kDdsBack, "DdsBack", kInfo, kNote},
    {kMetricsMissing, "MetricsMissing", kWarning, kOfHost},
    {kMetricsBack, "MetricsBack", kInfo, kNote},
    {kJournalMissing, "JournalMissing", kWarning, kOfHost},
    {kJournalBack, "JournalBack", kInfo, kNote},
    {kDdsCredentialsEnding, "DdsCredentialsEnding", kWarning, kOfHost},
    {kDdsCredentialsEnded, "DdsCredentialsEnded", kError, kOfHost},
    {kDdsCredentialsRenewed, "DdsCredentialsRenewed", kInfo, kNote},
    {kBusDown, "BusDown", kError, kOfHost},
    {kBusPassive, "BusPassive", kWarning, kOfHost},
    {kBusTrouble, "BusTrouble", kWarning, kEvent},
    {kBusUp, "BusUp", kInfo, kNote},
    {kUnitSilent, "UnitSilent", kError, kCondition},
    {kUnitFault, "UnitFault", kError, kCondition},
    {kUnitLostPower, "UnitLostPower", kError, kEvent},
    {kUnitNeverBegan, "UnitNeverBegan", kWarning, kEvent},
    {kUnitUnfit, "UnitUnfit", kError, kCondition},
    {kUnitForeign, "UnitForeign", kWarning, kCondition},
    {kUnitsExchanged, "UnitsExchanged", kError, kCondition},
    {kUnitOtherVersion, "UnitOtherVersion", kError, kCondition},
    {kUnitWithoutSerial, "UnitWithoutSerial", kError, kCondition},
    {kUnitPlaceLost, "UnitPlaceLost", kWarning, kCondition},
    {kUnitClockOff, "UnitClockOff", kError, kEvent},
    {kUnitDidNotMove, "UnitDidNotMove", kWarning, kEvent},
    {kUnitsSwapped, "UnitsSwapped", kError, kEvent},
    {kUnitRefused, "UnitRefused", kWarning, kEvent},
    {kParameterRefused, "ParameterRefused", kWarning, kEvent},
    {kCountRefused, "CountRefused", kWarning, kEvent},
    {kSensorsSilent, "SensorsSilent", kWarning, kCondition},
    {kSensorsDoubted, "SensorsDoubted", kWarning, kCondition},
    {kConfigurationCutShort, "ConfigurationCutShort", kWarning, kEvent},
    {kConfigurationNotMeasured, "ConfigurationNotMeasured", kError, kEvent},
    {kCameraLate, "CameraLate", kWarning, kCondition},
    {kCameraFailed, "CameraFailed", kError, kCondition},
    {kExposureRefused, "ExposureRefused", kWarning, kCondition},
    {kLostNotSought, "LostNotSought", kWarning, kEvent},
    {kStartsApart, "StartsApart", kError, kEvent},
    {kStoppedByOther, "StoppedByOther", kWarning, kEvent},
    {kHomingUnproven, "HomingUnproven", kWarning, kEvent},
    {kUnitsTooNear, "UnitsTooNear", kWarning, kEvent},
    {kNoRunUp, "NoRunUp", kWarning, kEvent},
    {kRunUpsLeftOut, "RunUpsLeftOut", kInfo, kNote},
    {kUnitHeldBack, "UnitHeldBack", kInfo, kNote},
    {kUnitRetargeted, "UnitRetargeted", kInfo, kNote},
    {kPlaneSilent, "PlaneSilent", kError, kOfHost},
    {kPlaneHeard, "PlaneHeard", kInfo, kNote},
    {kSectorSilent, "SectorSilent", kError, kEvent},
    {kSectorStartMissed, "SectorStartMissed", kWarning, kEvent},
    {kSectorClockLoose, "SectorClockLoose", kError, kOfHost},
    {kSectorClocksGood, "SectorClocksGood", kInfo, kNote},
};

constexpr bool InOrder() {
  for (std::size_t n = 0; n < std::size(kKinds); ++n)
    if (static_cast<std::size_t>(kKinds[n].name) != n) return false;
  return std::size(kKinds) == static_cast<std::size_t>(kLastAlarmName) + 1;
}
static_assert(InOrder());

}  // namespace

std::span<const AlarmKind> AlarmKinds() { return kKinds; }

const AlarmKind& KindOf(AlarmName name) {
  return kKinds[name <= kLastAlarmName ? static_cast<std::size_t>(name) : 0];
}

const char* Name(AlarmName name) { return KindOf(name).text; }

AlarmName AlarmNameOf(std::string_view text) {
  for (const AlarmKind& kind : kKinds)
    if (text == kind.text) return kind.name;
  return kUnnamed;
}

std::string RunbookOf(AlarmName name) {
  if (name == kUnnamed) return {};
  std::string anchor = "docs/runbook.md#";
  for (const char letter : std::string_view(Name(name)))
    anchor += letter >= 'A' && letter <= 'Z' ? static_cast<char>(letter - 'A' + 'a') : letter;
  return anchor;
}

}  // namespace focalfleet
