// Readers of the store beside its writer: the history of the fleet, and all that the coordinator
// needs to go on. A reader has a connection of its own; any number may read, in any process.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "daemon/clock/wall_time.h"
#include "daemon/store/audit_chain.h"
#include "daemon/store/history.h"
#include "daemon/store/store_options.h"
#include "fleet/records.h"
#include "protocol/base/result.h"

namespace focalfleet {

namespace store_internal {
class Connection;
}  // namespace store_internal

/// A reader beside the writer, in any process. Each query sees one whole state. Lists are newest
/// first. Errors of all queries: kInvalid names table and row; kUnavailable: the file cannot be
/// read.
class StoreReader {
 public:
  /// The store is open for reading. Errors: kUnavailable: no such file, or not readable; kNewer:
  /// written by a later version; kInvalid: not a store.
  static Result<std::unique_ptr<StoreReader>> Open(const std::string& path,
                                                   const StoreOptions& options = {});
  StoreReader(const StoreReader&) = delete;
  StoreReader& operator=(const StoreReader&) = delete;
  ~StoreReader();

  Result<StoredFleet> Load();
  Result<std::vector<MoveHistory>> Moves(std::optional<UnitId> unit, std::uint32_t limit,
                                         const Period& period = {},
                                         std::optional<IntentEnd> end = {});
  /// The period is that of their last change.
  Result<std::vector<ConfigurationHistory>> Configurations(
      std::uint32_t limit, const Period& period = {}, std::optional<ConfigurationState> state = {});
  /// All that one configuration left: moves with entries after `after`, at most `limit`, the oldest
  /// first; 0 begins. Cost: O(limit + log of all moves), plus a row for each unit measured.
  Result<ReplayPage> Replay(std::uint64_t configuration, std::uint64_t after, std::uint32_t limit);
  Result<std::vector<ParameterHistory>> Parameters(SerialNumber serial, std::uint32_t limit);
  Result<std::vector<TuningHistory>> Tunings(SerialNumber serial, std::uint32_t limit);
  Result<std::vector<AlarmHistory>> Alarms(std::uint32_t limit, const Period& period = {});
  /// The alarms that are over, by their newest raise.
  Result<std::vector<OpenAlarmRow>> EarlierAlarms(std::uint32_t limit, const Period& period = {});
  /// The measurements of one exposure, by unit id.
  Result<std::vector<MeasurementHistory>> Measurements(std::uint64_t exposure);
  /// The unit in each exposure of a configuration, the newest first. Cost: some 80 look-ups and two
  /// for each exposure, however many rows there are.
  Result<std::vector<UnitMeasured>> MeasurementsOf(UnitId unit, std::uint64_t configuration);
  /// The newest exposure of a configuration; none: it was never measured.
  Result<std::optional<std::uint64_t>> LastExposure(std::uint64_t configuration);
  Result<std::vector<ModelHistory>> Models(std::uint32_t limit);
  /// The units whose count began anew after this change of the model (ModelRow::entry), in the
  /// order of the store's rows: homed, set by hand, found by the camera, or other hardware was
  /// adopted there.
  Result<std::vector<UnitId>> CountedAnewSince(std::uint64_t change);
  /// The places and the hardware that is bound to each.
  Result<std::vector<std::pair<UnitId, SerialNumber>>> Bindings();
  /// The text of a model. Errors: kRefused: the store has none of that sha256.
  Result<std::string> ModelText(const std::string& sha256);
  Result<std::vector<UnitHistory>> Units(std::optional<UnitId> unit, std::uint32_t limit,
                                         const Period& period = {});
  Result<EntryNumbers> NewestEntries();
  /// At most `limit` of each kind, the oldest first.
  Result<EntriesAfter> After(const EntryNumbers& numbers, std::uint32_t limit);
  /// The newest first.
  Result<std::vector<AuditEntry>> Audit(const AuditFilter& filter);
  /// The chain of the audit from its first entry to its last one, and whether `heads` that were
  /// reported outside are part of it. Cost: some 10 us an entry.
  Result<AuditVerdict> CheckAudit(const std::vector<AuditHead>& heads);
  /// Queries end with kUnavailable once `ending` is true. Pre: `ending` outlives them.
  void EndWith(const std::atomic<bool>* ending);

 private:
  StoreReader();

  std::unique_ptr<store_internal::Connection> connection_;
};

}  // namespace focalfleet
