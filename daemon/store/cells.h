// A row that came out of SQLite, read column by column with a range for each. The first value out
// of its range is kept as an error that names table, row and column; the rest of the row then reads
// as zero.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>

#include "daemon/clock/wall_time.h"
#include "daemon/store/history.h"
#include "daemon/store/sqlite.h"
#include "fleet/knowledge.h"
#include "fleet/records.h"
#include "fleet/row_check.h"
#include "protocol/base/result.h"

namespace focalfleet::store_internal {

class Cells {
 public:
  /// The first `key_columns` columns name the row in errors. Lifetime: until the statement's next
  /// step.
  Cells(const Statement& statement, const char* table, int key_columns)
      : statement_(statement.get()), table_(table), key_columns_(key_columns) {}

  std::int64_t Integer(int column, std::int64_t low, std::int64_t high);
  double Real(int column);  // NULL: NaN
  std::string Text(int column);
  [[nodiscard]] bool IsNull(int column) const {
    return sqlite3_column_type(statement_, column) == SQLITE_NULL;
  }

  template <class T>
  T Whole(int column) {
    using Limits = std::numeric_limits<T>;
    constexpr std::int64_t kHigh = sizeof(T) == sizeof(std::int64_t)
                                       ? std::numeric_limits<std::int64_t>::max()
                                       : static_cast<std::int64_t>(Limits::max());
    return static_cast<T>(Integer(column, static_cast<std::int64_t>(Limits::min()), kHigh));
  }
  template <class Enum>
  Enum Code(int column, Enum last) {
    return static_cast<Enum>(Integer(column, 0, static_cast<std::int64_t>(last)));
  }
  bool Flag(int column) { return Integer(column, 0, 1) == 1; }
  SerialNumber Serial(int column) {  // not 0: of real hardware
    return {
        static_cast<std::uint32_t>(Integer(column, 1, std::numeric_limits<std::uint32_t>::max()))};
  }
  WallTime Time(int column) { return {Whole<std::int64_t>(column)}; }
  AlarmName AlarmNameAt(int column);  // NULL: kUnnamed
  Axis AxisAt(int column) { return Code(column, Axis::kPhi); }
  /// The columns witness, low, high, from `column` on.
  AxisKnowledge Knowledge(int column);
  /// A condition across columns; `what` is the text of the error where it does not hold.
  void Require(bool condition, const char* what);

  [[nodiscard]] const std::optional<Error>& error() const { return error_; }

 private:
  void Fault(const std::string& what);

  sqlite3_stmt* statement_;
  const char* table_;
  int key_columns_;
  std::optional<Error> error_;
};

/// The columns id, source, state, targeted, arrived, refused, failed, makespan_predicted_s,
/// makespan_s, energy_J, peak_power_W, start_skew_s, start_skew_bound_s, stopped, unmeasured, in
/// this order from column 0 on.
ConfigurationRow ReadConfiguration(Cells& cells);

/// The columns of a configuration with its times, for ReadConfigurationHistory.
inline constexpr const char* kConfigurationColumns =
    "SELECT id, source, state, targeted, arrived, refused, failed, makespan_predicted_s, "
    "makespan_s, energy_J, peak_power_W, start_skew_s, start_skew_bound_s, stopped, unmeasured, "
    "began_ns, changed_ns FROM configuration ";
ConfigurationHistory ReadConfigurationHistory(Cells& cells);

/// The columns of a move, for ReadMove.
inline constexpr const char* kMoveColumns =
    "SELECT entry, configuration, unit_id, serial, move, theta_from, phi_from, theta_to, phi_to, "
    "theta_low, theta_high, phi_low, phi_high, began_ns, ended_ns, end, theta_end_witness, "
    "theta_end_low, theta_end_high, phi_end_witness, phi_end_low, phi_end_high FROM intent ";
MoveHistory ReadMove(Cells& cells);

/// The columns serial, axis, critical, repeat, margin, load_uNm, v_bus_V, counter1, subdivision,
/// mode, origin, in this order from column `first` on.
TuningRow ReadTuning(Cells& cells, int first);
/// The columns id, severity, unit_id, bus_id, text, name, in this order from column 0 on.
AlarmRow ReadAlarm(Cells& cells);
/// The same, then count, state, first_ns, last_ns, acknowledged_ns, ended_ns, acknowledged_by.
OpenAlarmRow ReadOpenAlarm(Cells& cells);
/// The columns trusted, verdict, used, three angles and six covariances, in this order from column
/// `first` on; no reading where the first is NULL.
std::optional<FibreCarrierReading> ReadFibreCarrier(Cells& cells, int first);

/// All tables that the coordinator needs, read in one transaction.
Result<StoredFleet> LoadFleet(Connection& connection);

}  // namespace focalfleet::store_internal
