// Any bytes as samples of each topic, as DDS hands them over: numbers of any value, texts that end
// within their bound. A sample becomes a value of this project whose codes all exist, or is
// refused. A value that was taken goes out again as a sample that is taken again.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>

#include "daemon/dds/sample_conversion.h"
#include "focalfleet.h"  // generated from focalfleet.idl
#include "protocol/base/check.h"

namespace focalfleet {
namespace {

using namespace dds_internal;

// DDS gives flags as 0 or 1, and ends each text.
void Repair(focalfleet_UnitStatus* sample, std::uint8_t odd) { sample->enabled = odd % 2 == 1; }
void Repair(focalfleet_BusStatus*, std::uint8_t) {}
void Repair(focalfleet_FleetStatus* sample, std::uint8_t odd) {
  sample->busy = odd % 2 == 1;
  sample->store_failing = odd % 4 >= 2;
  sample->version[sizeof sample->version - 1] = '\0';
}
void Repair(focalfleet_UnitOrientation* sample, std::uint8_t) {
  sample->verdict[sizeof sample->verdict - 1] = '\0';
}
void Repair(focalfleet_ConfigurationProgress* sample, std::uint8_t) {
  sample->source[sizeof sample->source - 1] = '\0';
}
void Repair(focalfleet_NamedAlarm* sample, std::uint8_t) {
  sample->name[sizeof sample->name - 1] = '\0';
  sample->text[sizeof sample->text - 1] = '\0';
}

template <class Value, class Sample>
void TakeAndGive(const std::uint8_t* data, std::size_t size, std::uint8_t odd) {
  Sample sample{};
  // Flags are never made of raw bytes: a bool of 7 is no value of C++.
  if (size > 0) {
    alignas(Sample) std::uint8_t bytes[sizeof(Sample)] = {};
    for (std::size_t i = 0; i < sizeof bytes; ++i) bytes[i] = data[i % size];
    std::memcpy(static_cast<void*>(&sample), bytes, sizeof bytes);
  }
  Repair(&sample, odd);
  Value value;
  if (!FromSample(sample, &value)) return;
  if constexpr (requires { Flaw(value); }) FOCALFLEET_CHECK(Flaw(value) == nullptr);
  Sample given{};
  ToSample(value, &given);
  Value again;
  FOCALFLEET_CHECK(FromSample(given, &again));
}

}  // namespace
}  // namespace focalfleet

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace focalfleet;
  if (size < 2) return 0;
  const std::uint8_t odd = data[1];
  const std::uint8_t topic = data[0];
  data += 2;
  size -= 2;
  switch (topic % 6) {
    case 0:
      TakeAndGive<UnitStatusValue, focalfleet_UnitStatus>(data, size, odd);
      break;
    case 1:
      TakeAndGive<BusStatusValue, focalfleet_BusStatus>(data, size, odd);
      break;
    case 2:
      TakeAndGive<FleetStatusValue, focalfleet_FleetStatus>(data, size, odd);
      break;
    case 3:
      TakeAndGive<UnitOrientationValue, focalfleet_UnitOrientation>(data, size, odd);
      break;
    case 4:
      TakeAndGive<ConfigurationProgressValue, focalfleet_ConfigurationProgress>(data, size, odd);
      break;
    default:
      TakeAndGive<AlarmValue, focalfleet_NamedAlarm>(data, size, odd);
      break;
  }
  return 0;
}
