// The input is any bytes as one of the project's tables, which the first byte picks. The result
// must be a table or an error, never more. A table that was read and is written again reads back
// with as many rows.
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <string>
#include <string_view>
#include <vector>

#include "fleet/files/csv.h"
#include "fleet/files/layout_file.h"
#include "fleet/files/obstacles_file.h"
#include "fleet/files/plan_file.h"
#include "fleet/files/state_file.h"
#include "fleet/files/targets_file.h"
#include "fleet/hex_layout.h"
#include "fleet/targets.h"
#include "protocol/base/check.h"

namespace focalfleet {
namespace {

const Layout& SevenUnits() {
  static const auto layout = Layout::Create(MakeHexLayout({.count = 7}), {});
  return *layout;
}
const std::vector<UnitDrive>& Drives() {
  static const std::vector<UnitDrive> drives(7);
  return drives;
}

void TryTable(std::string_view text) {
  const auto table = CsvTable::Parse(text, "fuzz.csv");
  FOCALFLEET_CHECK(table || !table.error().text.empty());
  if (!table) return;
  for (std::size_t row = 0; row < table->size(); ++row)
    for (std::size_t column = 0; column < table->columns().size(); ++column)
      FOCALFLEET_CHECK(table->cell(row, column).size() <= text.size());
}

void TryTargets(std::string_view text) {
  const auto targets = ReadTargets(text, "fuzz.csv");
  if (!targets) return;
  const auto again = ReadTargets(WriteTargets(*targets), "again.csv");
  FOCALFLEET_CHECK(again && again->rows.size() == targets->rows.size());
  const auto poses = ResolveTargets(*targets, SevenUnits(), Drives(), {});
  FOCALFLEET_CHECK(poses || !poses.error().text.empty());
}

void TryState(std::string_view text) {
  const auto poses = ReadState(text, "fuzz.csv", SevenUnits(), Drives());
  if (!poses) return;
  const std::string written = WriteState(SevenUnits(), Drives(), *poses);
  const auto again = ReadState(written, "again.csv", SevenUnits(), Drives());
  FOCALFLEET_CHECK(again && *again == *poses);
}

void TryUnits(std::string_view text) {
  const auto layout = ReadLayout(text, "fuzz.csv", {});
  if (!layout) return;
  const auto again = ReadLayout(WriteUnits(layout->units()), "again.csv", {});
  FOCALFLEET_CHECK(again && again->size() == layout->size());
}

void TryObstacles(std::string_view text) {
  const auto obstacles = ReadObstacles(text, "fuzz.csv");
  if (!obstacles) return;
  const auto again = ReadObstacles(WriteObstacles(*obstacles), "again.csv");
  FOCALFLEET_CHECK(again && again->size() == obstacles->size());
}

void TryPlan(std::string_view text) {
  const auto plan = ReadPlan(text, "fuzz.csv");
  if (!plan) return;
  const auto again = ReadPlan(WritePlan(*plan), "again.csv");
  FOCALFLEET_CHECK(again && again->size() == plan->size());
}

constexpr void (*kReaders[])(std::string_view) = {TryTable, TryTargets,   TryState,
                                                  TryUnits, TryObstacles, TryPlan};

}  // namespace
}  // namespace focalfleet

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string_view text(static_cast<const char*>(static_cast<const void*>(data + 1)),
                              size - 1);
  focalfleet::kReaders[data[0] % std::size(focalfleet::kReaders)](text);
  return 0;
}
