// The names of the numbers on the wire, in the order of the numbers.
#pragma once

#include "protocol/base/ids.h"
#include "protocol/wire/messages.h"

namespace focalfleet {

inline constexpr const char* kNoYesNames[] = {"no", "yes"};
inline constexpr const char* kSensorPartNames[kSensorParts] = {"1_to_4", "5_to_8", "9_to_12",
                                                               "13_to_16"};
inline constexpr const char* kAxisNames[kAxisCount] = {Name(Axis::kTheta), Name(Axis::kPhi)};
inline constexpr const char* kWaveModeNames[] = {
    Name(WaveMode::kAsymmetric), Name(WaveMode::kFiveSegment), Name(WaveMode::kSevenSegment)};
inline constexpr const char* kUnitStateNames[kUnitStateCount] = {
    "rest", "staging", "armed", "moving", "homing", "fault", "host_lost"};
inline constexpr const char* kFaultCodeNames[kFaultCodeCount] = {
    "none", "over_temperature", "under_voltage", "over_current", "flash", "driver"};
inline constexpr const char* kOutcomeNames[kOutcomeCount] = {"arrived", "stopped", "fault",
                                                             "homed"};
inline constexpr const char* kAnswerNames[kAnswerCount] = {
    "ok",          "wrong_move",   "incomplete", "out_of_range",
    "wrong_state", "begun_before", "bad_value",  "interrupted"};
inline constexpr const char* kParameterNames[kParameterCount] = {
    "counter1",     "repeat",       "subdivision",   "mode",           "position",
    "min_position", "max_position", "home_position", "host_timeout_ms"};

}  // namespace focalfleet
