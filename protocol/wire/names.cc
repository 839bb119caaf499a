#include <cstddef>

#include "protocol/base/check.h"
#include "protocol/wire/codec.h"
#include "protocol/wire/messages.h"

namespace focalfleet {
namespace {

template <std::size_t n, class Enumeration>
const char* Pick(const char* const (&names)[n], Enumeration value) {
  const auto index = static_cast<std::size_t>(value);
  FOCALFLEET_CHECK(index < n);
  return names[index];
}

}  // namespace

const char* Name(UnitState state) {
  static constexpr const char* kNames[kUnitStateCount] = {"rest",   "staging", "armed",    "moving",
                                                          "homing", "fault",   "host_lost"};
  return Pick(kNames, state);
}

const char* Name(FaultCode code) {
  static constexpr const char* kNames[kFaultCodeCount] = {
      "none", "over_temperature", "under_voltage", "over_current", "flash", "driver"};
  return Pick(kNames, code);
}

const char* Name(Outcome outcome) {
  static constexpr const char* kNames[kOutcomeCount] = {"arrived", "stopped", "fault", "homed"};
  return Pick(kNames, outcome);
}

const char* Name(Answer answer) {
  static constexpr const char* kNames[kAnswerCount] = {
      "ok",          "wrong_move",   "incomplete", "out_of_range",
      "wrong_state", "begun_before", "bad_value",  "interrupted"};
  return Pick(kNames, answer);
}

const char* Name(Parameter parameter) {
  static constexpr const char* kNames[kParameterCount] = {
      "counter1",     "repeat",       "subdivision",   "mode",           "position",
      "min_position", "max_position", "home_position", "host_timeout_ms"};
  return Pick(kNames, parameter);
}

const char* Name(Malformed malformed) {
  static constexpr const char* kNames[] = {"identifier", "function", "direction", "node",
                                           "length",     "value",    "reserved"};
  return Pick(kNames, malformed);
}

}  // namespace focalfleet
