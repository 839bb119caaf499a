// The store in memory, for tests that need no file: it keeps, merges and refuses exactly what
// daemon/store/store.h does (tests/daemon/store/memory_store_test.cc feeds both the same batches),
// and remembers the events that a test may ask for.
#pragma once

#include <cstddef>
#include <set>
#include <span>
#include <vector>

#include "fleet/records.h"
#include "protocol/base/result.h"

namespace focalfleet::test {

class MemoryStore {
 public:
  /// As Store::Commit: all rows or none; ends of intents come last. Errors: kInvalid, and `refused`
  /// is the row that it is about.
  Status Commit(std::span<const Row> rows, std::size_t* refused = nullptr);
  /// As StoreThread: rows that can never be kept are set aside, the rest is kept.
  std::vector<RefusedRow> CommitAllBut(std::uint64_t batch, std::vector<Row> rows);

  /// What Store::Load gives, in the same order.
  StoredFleet fleet;

  // Everything that was ever durable, in order.
  std::vector<IntentRow> begun;
  std::vector<IntentEndRow> ended;
  std::vector<AlarmRow> alarms;
  std::vector<ConfigurationRow> configurations;

  [[nodiscard]] const VectorRow* Vector(SerialNumber serial) const;

 private:
  void Keep(const VectorRow& row);
  void Keep(const MeasurementRow& row);
  void Keep(const IntentRow& row);
  void Keep(const IntentEndRow& row);
  void Keep(const BindingRow& row);
  void Keep(const EnableRow& row);
  void Keep(const ParameterRow& row);
  void Keep(const TuningRow& row);
  void Keep(const ConfigurationRow& row);
  void Keep(const AlarmRow& row);
  void Keep(const NextMoveRow& row);
  void Keep(const ModelRow& row);

  std::set<std::uint64_t> model_entries_;
};

}  // namespace focalfleet::test
