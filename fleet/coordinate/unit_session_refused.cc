// UnitSessions, what the store can never keep. A unit of which the store does not hold the place,
// the intent or the binding must not move: after a restart nobody would know where it stands.
// Nothing but a fault of ours, or of the file, leads here; so an operator decides when it is tried
// again.
#include <algorithm>

#include "fleet/coordinate/unit_session.h"
#include "fleet/row_check.h"

namespace focalfleet {
namespace {

/// Whose row it is; 0 or none where it is no unit's.
struct OwnerOf {
  SerialNumber operator()(const VectorRow& row) const { return row.serial; }
  SerialNumber operator()(const MeasurementRow& row) const { return row.serial; }
  SerialNumber operator()(const IntentRow& row) const { return row.serial; }
  SerialNumber operator()(const IntentEndRow& row) const { return row.serial; }
  SerialNumber operator()(const BindingRow& row) const { return row.serial; }
  SerialNumber operator()(const ParameterRow& row) const { return row.serial; }
  SerialNumber operator()(const TuningRow& row) const { return row.serial; }
  template <class OtherRow>
  SerialNumber operator()(const OtherRow&) const {
    return {};
  }
};

bool TellsOfAPlace(const Row& row) {
  return std::holds_alternative<VectorRow>(row) || std::holds_alternative<IntentRow>(row) ||
         std::holds_alternative<IntentEndRow>(row) || std::holds_alternative<BindingRow>(row);
}

bool IsOfACommand(const Row& row) {
  return std::holds_alternative<EnableRow>(row) || std::holds_alternative<BindingRow>(row) ||
         std::holds_alternative<ParameterRow>(row) || std::holds_alternative<ModelRow>(row);
}

}  // namespace

void UnitSessions::StoreRefused(const RefusedRow& refused) {
  const SerialNumber serial = std::visit(OwnerOf{}, refused.row);
  std::optional<PositionerIndex> unit;
  for (std::uint32_t n = 0; n < core_.units.size() && serial.value != 0 && !unit; ++n)
    if (core_.units[n].view.serial == serial) unit = PositionerIndex{n};
  const bool stands = unit && TellsOfAPlace(refused.row);
  // An alarm about an alarm would be refused like it, and so on; the log has it.
  if (std::holds_alternative<AlarmRow>(refused.row)) return;
  core_.Raise(
      Severity::kError, unit, {},
      "the store refuses the " + Describe(refused.row) + ": " + refused.why +
          (stands ? "; " + core_.NameOf(*unit) + " is not moved until it is enabled again" : ""));
  if (IsOfACommand(refused.row))
    core_.RefuseReplies(refused.first_batch, refused.last_batch, refused.why);
  if (!stands) return;
  UnitRecord& record = core_.unit(*unit);
  record.not_kept = refused.why;
  const UnitPhase phase = record.view.phase;
  if (phase == UnitPhase::kReady || IsLoaded(phase) || IsUnderWay(phase))
    Lose(*unit, UnitPhase::kFault, "is not kept by the store", /*alarm=*/false);
}

}  // namespace focalfleet
