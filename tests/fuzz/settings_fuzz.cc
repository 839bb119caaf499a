// The input is any bytes as the daemon's configuration or as the memory file of a simulation, which
// the first byte picks. They must give values or an error that names the file. Values that are
// written again read back the same.
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "daemon/process/config.h"
#include "daemon/simulator/memory_file.h"
#include "protocol/base/check.h"

namespace focalfleet {
namespace {

void TryConfig(std::string_view text) {
  const auto config = ParseConfig(text, "/etc/fuzz.toml");
  if (!config) {
    FOCALFLEET_CHECK(config.error().text.find("fuzz.toml") != std::string::npos);
    return;
  }
  const std::string effective = EffectiveConfig(*config);
  const auto again = ParseConfig(effective, "/etc/fuzz.toml");
  FOCALFLEET_CHECK(again && EffectiveConfig(*again) == effective);
}

void TryMemory(std::string_view text) {
  const auto memory = simulator::ReadMemory(text, "fuzz.json");
  if (!memory) {
    FOCALFLEET_CHECK(memory.error().text.find("fuzz.json") != std::string::npos);
    return;
  }
  const std::string written = simulator::WriteMemory(*memory);
  const auto again = simulator::ReadMemory(written, "again.json");
  FOCALFLEET_CHECK(again && simulator::WriteMemory(*again) == written);
}

}  // namespace
}  // namespace focalfleet

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string_view text(static_cast<const char*>(static_cast<const void*>(data + 1)),
                              size - 1);
  if (data[0] % 2 == 0)
    focalfleet::TryConfig(text);
  else
    focalfleet::TryMemory(text);
  return 0;
}
