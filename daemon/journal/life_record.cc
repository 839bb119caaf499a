#include "daemon/journal/life_record.h"

#include <utility>

#include "daemon/journal/fields.h"

namespace focalfleet::journal {

LifeRecord LifeOf(const Layout& layout, std::vector<UnitDrive> drives,
                  const CoordinatorConfig& config, StoredFleet stored) {
  return {.version = {},
          .at = {},
          .units = {layout.units().begin(), layout.units().end()},
          .clearance_mm = layout.clearance_mm(),
          .obstacles = {layout.obstacles().begin(), layout.obstacles().end()},
          .drives = std::move(drives),
          .config = config,
          .stored = std::move(stored)};
}

std::string BytesOf(const LifeRecord& life) {
  std::string bytes;
  WriteFields(life, &bytes);
  return bytes;
}

Result<LifeRecord> LifeFrom(std::string_view bytes) {
  LifeRecord life;
  ByteReader reader{bytes};
  ReadFields(&reader, &life);
  if (!reader.good || !reader.left.empty() || life.drives.size() != life.units.size())
    return Fail(ErrorCode::kInvalid, "the record of the life's beginning cannot be read");
  return life;
}

}  // namespace focalfleet::journal
