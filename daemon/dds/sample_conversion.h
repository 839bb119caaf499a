// SampleConversion converts between this project's values and the types that idlc generates. Every
// code is checked in both directions. Text is shortened to its bound without cutting a UTF-8
// character. The way out allocates nothing.
#pragma once

#include "daemon/dds/status_values.h"
#include "focalfleet.h"

namespace focalfleet::dds_internal {

/// Text that names a code that does not exist, or nullptr where all do.
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
void ToSample(const AlarmValue& value, focalfleet_NamedAlarm* sample);
void ToSample(const AuditHeadValue& value, focalfleet_AuditHead* sample);

/// Fills `value`. False: the sample has a code that this version does not know.
bool FromSample(const focalfleet_UnitStatus& sample, UnitStatusValue* value);
bool FromSample(const focalfleet_UnitOrientation& sample, UnitOrientationValue* value);
bool FromSample(const focalfleet_BusStatus& sample, BusStatusValue* value);
bool FromSample(const focalfleet_FleetStatus& sample, FleetStatusValue* value);
bool FromSample(const focalfleet_ConfigurationProgress& sample, ConfigurationProgressValue* value);
bool FromSample(const focalfleet_NamedAlarm& sample, AlarmValue* value);
bool FromSample(const focalfleet_AuditHead& sample, AuditHeadValue* value);

}  // namespace focalfleet::dds_internal
