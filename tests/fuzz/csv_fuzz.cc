// Any bytes as each of the project's tables: a table or an error, never more. What was read and is
// written again reads back with as many rows.
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "fleet/files/csv.h"
#include "fleet/files/layout_file.h"
#include "fleet/files/obstacles_file.h"
#include "fleet/files/plan_file.h"
#include "fleet/files/state_file.h"
#include "fleet/files/targets_file.h"
#include "fleet/hex_layout.h"
#include "fleet/targets.h"
#include "protocol/base/check.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace focalfleet;  // NOLINT(google-build-using-namespace): the whole file is one
                               // function
  const std::string_view text(static_cast<const char*>(static_cast<const void*>(data)), size);
  if (const auto table = CsvTable::Parse(text, "fuzz.csv")) {
    for (std::size_t row = 0; row < table->size(); ++row)
      for (std::size_t column = 0; column < table->columns().size(); ++column)
        FOCALFLEET_CHECK(table->cell(row, column).size() <= size);
  } else {
    FOCALFLEET_CHECK(!table.error().text.empty());
  }
  static const auto layout = Layout::Create(MakeHexLayout({.count = 7}), {});
  static const std::vector<UnitDrive> drives(7);
  if (const auto targets = ReadTargets(text, "fuzz.csv")) {
    const auto again = ReadTargets(WriteTargets(*targets), "again.csv");
    FOCALFLEET_CHECK(again && again->rows.size() == targets->rows.size());
    if (const auto poses = ResolveTargets(*targets, *layout, drives, {}); !poses) {
      FOCALFLEET_CHECK(!poses.error().text.empty());
    }
  }
  if (const auto poses = ReadState(text, "fuzz.csv", *layout, drives)) {
    const auto again = ReadState(WriteState(*layout, drives, *poses), "again.csv", *layout, drives);
    FOCALFLEET_CHECK(again && *again == *poses);
  }
  if (const auto units = ReadLayout(text, "fuzz.csv", {})) {
    const auto again = ReadLayout(WriteUnits(units->units()), "again.csv", {});
    FOCALFLEET_CHECK(again && again->size() == units->size());
  }
  if (const auto obstacles = ReadObstacles(text, "fuzz.csv")) {
    const auto again = ReadObstacles(WriteObstacles(*obstacles), "again.csv");
    FOCALFLEET_CHECK(again && again->size() == obstacles->size());
  }
  if (const auto plan = ReadPlan(text, "fuzz.csv")) {
    const auto again = ReadPlan(WritePlan(*plan), "again.csv");
    FOCALFLEET_CHECK(again && again->size() == plan->size());
  }
  return 0;
}
