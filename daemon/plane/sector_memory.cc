#include "daemon/plane/sector_memory.h"

#include <fmt/format.h>

#include <filesystem>
#include <sstream>

#include "daemon/files/text_file.h"

namespace focalfleet {

Result<SectorMemory> SectorMemory::BeginLife(const std::string& path) {
  SectorMemory memory(path);
  std::error_code error;
  if (std::filesystem::exists(path, error)) {
    FOCALFLEET_TRY_ASSIGN(const std::string text, ReadTextFile(path));
    std::istringstream words(text);
    std::string life, epoch;
    words >> life >> memory.life_ >> epoch >> memory.epoch_.number >> memory.epoch_.coordinator;
    if (!words || life != "life" || epoch != "epoch")
      return Fail(ErrorCode::kInvalid, path +
                                           ": this is no memory of a sector; a sector that "
                                           "begins anew needs it removed");
  }
  ++memory.life_;
  FOCALFLEET_TRY(memory.Write(memory.life_, memory.epoch_));
  return memory;
}

Status SectorMemory::Keep(const PlaneEpoch& epoch) {
  FOCALFLEET_TRY(Write(life_, epoch));
  epoch_ = epoch;
  return {};
}

Status SectorMemory::Write(std::uint64_t life, const PlaneEpoch& epoch) const {
  return WriteFileAtomically(
      path_, fmt::format("life {}\nepoch {} {}\n", life, epoch.number, epoch.coordinator));
}

}  // namespace focalfleet
