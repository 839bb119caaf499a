// MemoryFile holds FLASH and mechanics of all units as JSON. They survive a restart of the
// simulation as those of real units survive a power cut. The file gives the seed and spread it was
// made with: with others the same units would have other gears and stops.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"
#include "sim/world/world.h"

namespace focalfleet::simulator {

struct MemoryFile {
  std::uint64_t seed = 1;
  sim::Spread spread = sim::Spread::kNominal;
  std::vector<sim::UnitMemory> units;
};

std::string WriteMemory(const MemoryFile& memory);

/// The memory in `text`. Total: any bytes give a memory or an Error.
/// Errors: kInvalid, names the file and the fault.
Result<MemoryFile> ReadMemory(std::string_view text, const std::string& file);

}  // namespace focalfleet::simulator
