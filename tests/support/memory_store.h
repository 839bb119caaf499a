// The store in memory serves tests that need no file. Rows are kept, merged and refused exactly as
// by daemon/store/store.h: tests/daemon/store/memory_store_test.cc feeds both the same batches.
// Events that a test may ask for are remembered, too.
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
  /// Keeps all rows or none, as Store::Commit does; ends of intents come last. Errors: kInvalid;
  /// `refused` is the index of the row at fault.
  Status Commit(std::span<const Row> rows, std::size_t* refused = nullptr);
  /// Sets aside rows that can never be kept and keeps the others, as StoreThread does.
  std::vector<RefusedRow> CommitAllBut(std::uint64_t batch, std::vector<Row> rows);

  /// The content that Store::Load would return, in the same order.
  StoredFleet fleet;

  // All rows that were ever durable, in order.
  std::vector<IntentRow> begun;
  std::vector<IntentEndRow> ended;
  std::vector<AlarmRow> alarms;
  std::vector<AlarmEndRow> alarm_ends;
  std::vector<ConfigurationRow> configurations;
  std::vector<AuditRow> audit;

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
  void Keep(const AlarmEndRow& row) { alarm_ends.push_back(row); }
  void Keep(const OpenAlarmRow& row);
  void Keep(const MuteRow& row);
  void Keep(const NextMoveRow& row);
  void Keep(const ModelRow& row);
  void Keep(const AuditRow& row) { audit.push_back(row); }

  std::set<std::uint64_t> model_entries_;
};

}  // namespace focalfleet::test
