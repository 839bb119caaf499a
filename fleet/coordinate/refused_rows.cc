#include "fleet/coordinate/refused_rows.h"

#include <optional>
#include <string>
#include <variant>

#include "fleet/coordinate/identification.h"
#include "fleet/row_check.h"

namespace focalfleet {
namespace {

/// The serial number of the row's unit; 0 where the row is no unit's.
struct OwnerOf {
  SerialNumber operator()(const VectorRow& row) { return row.serial; }
  SerialNumber operator()(const MeasurementRow& row) { return row.serial; }
  SerialNumber operator()(const IntentRow& row) { return row.serial; }
  SerialNumber operator()(const IntentEndRow& row) { return row.serial; }
  SerialNumber operator()(const BindingRow& row) { return row.serial; }
  SerialNumber operator()(const ParameterRow& row) { return row.serial; }
  SerialNumber operator()(const TuningRow& row) { return row.serial; }
  template <class OtherRow>
  SerialNumber operator()(const OtherRow&) {
    return {};
  }
};

bool IsOfAPlace(const Row& row) {
  return std::holds_alternative<VectorRow>(row) || std::holds_alternative<IntentRow>(row) ||
         std::holds_alternative<IntentEndRow>(row) || std::holds_alternative<BindingRow>(row);
}

bool IsOfACommand(const Row& row) {
  return std::holds_alternative<EnableRow>(row) || std::holds_alternative<BindingRow>(row) ||
         std::holds_alternative<ParameterRow>(row) || std::holds_alternative<ModelRow>(row);
}

}  // namespace

void StoreRefused(const Coordination& fleet, const RefusedRow& refused) {
  const SerialNumber serial = std::visit(OwnerOf{}, refused.row);
  std::optional<PositionerIndex> unit;
  for (std::uint32_t n = 0; n < fleet.units.size() && serial.value != 0 && !unit; ++n)
    if (fleet.units[{n}].view.serial == serial) unit = PositionerIndex{n};
  const bool stands = unit && IsOfAPlace(refused.row);
  // An alarm about an alarm would be refused like it, and so on. The log has it.
  if (std::holds_alternative<AlarmRow>(refused.row) ||
      std::holds_alternative<OpenAlarmRow>(refused.row))
    return;
  fleet.ledger.alarms().Raise(
      AlarmName::kRowRefused, unit, {},
      "the store refuses the " + Describe(refused.row) + ": " + refused.why +
          (stands ? "; " + fleet.units.NameOf(*unit) + " is not moved until it is enabled again"
                  : ""));
  if (IsOfACommand(refused.row))
    fleet.ledger.RefuseReplies(refused.first_batch, refused.last_batch, refused.why);
  if (!stands) return;
  UnitRecord& record = fleet.units[*unit];
  record.trouble.not_kept = refused.why;
  const UnitPhase phase = record.view.phase;
  if (phase == UnitPhase::kReady || IsLoaded(phase) || IsUnderWay(phase))
    Lose(fleet, *unit, UnitPhase::kFault, "is not kept by the store", /*alarm=*/false);
}

}  // namespace focalfleet
