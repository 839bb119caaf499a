// Between values of ours and the types that idlc generates: checks every code on both ways,
// shortens text to its bound without cutting a UTF-8 character, and allocates nothing on the way
// out.
#pragma once

#include "daemon/dds/status_values.h"
#include "focalfleet.h"

namespace focalfleet::dds_internal {

/// Text that says which code does not exist, or nullptr where all do.
const char* Flaw(const UnitStatusValue& value);
const char* Flaw(const UnitOrientationValue& value);
const char* Flaw(const BusStatusValue& value);
const char* Flaw(const ConfigurationProgressValue& value);
const char* Flaw(const AlarmValue& value);

void ToSample(const UnitStatusValue& value, focalfleet_UnitStatus* sample);
void ToSample(const UnitOrientationValue& value, focalfleet_UnitOrientation* sample);
void ToSample(const BusStatusValue& value, focalfleet_BusStatus* sample);
void ToSample(const FleetStatusValue& value, focalfleet_FleetStatus* sample);
void ToSample(const ConfigurationProgressValue& value, focalfleet_ConfigurationProgress* sample);
void ToSample(const AlarmValue& value, focalfleet_Alarm* sample);

/// False: a code that this version does not know.
bool FromSample(const focalfleet_UnitStatus& sample, UnitStatusValue* value);
bool FromSample(const focalfleet_UnitOrientation& sample, UnitOrientationValue* value);
bool FromSample(const focalfleet_BusStatus& sample, BusStatusValue* value);
bool FromSample(const focalfleet_FleetStatus& sample, FleetStatusValue* value);
bool FromSample(const focalfleet_ConfigurationProgress& sample, ConfigurationProgressValue* value);
bool FromSample(const focalfleet_Alarm& sample, AlarmValue* value);

}  // namespace focalfleet::dds_internal
