#include "protocol/wire/names.h"

#include <cstddef>

#include "protocol/base/check.h"
#include "protocol/wire/codec.h"

namespace focalfleet {
namespace {

template <std::size_t n, class Enumeration>
const char* Pick(const char* const (&names)[n], Enumeration value) {
  const auto index = static_cast<std::size_t>(value);
  FOCALFLEET_CHECK(index < n);
  return names[index];
}

}  // namespace

const char* Name(UnitState state) { return Pick(kUnitStateNames, state); }

const char* Name(FaultCode code) { return Pick(kFaultCodeNames, code); }

const char* Name(Outcome outcome) { return Pick(kOutcomeNames, outcome); }

const char* Name(Answer answer) { return Pick(kAnswerNames, answer); }

const char* Name(Parameter parameter) { return Pick(kParameterNames, parameter); }

const char* Name(Malformed malformed) {
  static constexpr const char* kNames[] = {"identifier", "function", "direction", "node",
                                           "length",     "value",    "reserved"};
  return Pick(kNames, malformed);
}

}  // namespace focalfleet
