// The writer of rows into the open transaction. A row runs one prepared statement or a few.
#pragma once

#include <cstdint>
#include <string_view>

#include "daemon/clock/wall_time.h"
#include "daemon/store/statements.h"
#include "fleet/records.h"
#include "protocol/base/result.h"

namespace focalfleet::store_internal {

class RowWriter {
 public:
  /// `statements` outlives the writer. All rows bear the time `now`.
  RowWriter(Statements* statements, WallTime now);

  /// The row is in the open transaction. Pre: fleet/row_check.h finds no flaw in it. Errors: as
  /// Statement::Run.
  Status Write(const Row& row);
  /// A homing that ended counts as such at this place among the rows. The end itself is written
  /// after all other rows of its batch.
  Status NoteEnd(const IntentEndRow& row);
  /// The store counts its open moves as they are after all rows. Call it last.
  Status Finish();

 private:
  Status Put(const VectorRow& row);
  Status Put(const MeasurementRow& row);
  Status Put(const IntentRow& row);
  Status Put(const IntentEndRow& row);
  Status Put(const BindingRow& row);
  Status Put(const EnableRow& row);
  Status Put(const ParameterRow& row);
  Status Put(const TuningRow& row);
  Status Put(const ConfigurationRow& row);
  Status Put(const AlarmRow& row);
  static Status Put(const AlarmEndRow&) { return {}; }  // its OpenAlarmRow is written
  Status Put(const OpenAlarmRow& row);
  Status Put(const MuteRow& row);
  Status Put(const NextMoveRow& row);
  Status Put(const ModelRow& row);
  Status Put(const AuditRow& row);
  Status WriteAxis(const VectorRow& row, Axis axis);
  Status WriteOrientation(const MeasurementRow& row, const FibreCarrierReading& carrier);
  Status KeepVector(const VectorRow& row, Axis axis);
  Status KeepUnit(UnitId unit);
  static Status SetMeta(Statement& s, std::string_view key, std::uint64_t value);

  Statements& statements_;
  WallTime now_;
  std::int64_t opened_ = 0;  // moves, less those that ended
};

}  // namespace focalfleet::store_internal
