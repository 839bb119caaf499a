// The reconciliation decides what a unit's position is worth after a restart or a lost link. The
// unit's FLASH, its mark `moving`, the move that it began last, and the store are put side by side:
//
//   mark set                            cut by a power loss        interval over its hull
//   mark clear, intent open, begun      ended by itself, unheard   reported
//   the same, restarted, and FLASH      mark or count was lost     interval over its hull
//     holds `from`, or not `to`           with the power
//   the same of homing, not at its stop cut short                  interval over its hull
//   mark clear, intent open, not begun  never began                reported, if FLASH holds `from`
//   no intent, FLASH equals the store   as good as before          as stored
//   no intent, nothing stored           first session              reported
//   all else                                                       unknown: home it or measure it
//
// The interval is half an electrical turn wider than the hull. At power-on the field pulls the
// rotor to the stored vector, at most that far.
#pragma once

#include <optional>

#include "fleet/knowledge.h"
#include "fleet/records.h"
#include "protocol/wire/messages.h"

namespace focalfleet {

struct UnitSays {
  StatusReply status;
  Pose position{};  // turns * subdivision + vector, from FLASH
  std::array<std::uint16_t, kAxisCount> subdivision{};
};

struct StoreSays {
  std::optional<VectorRow> vector;
  std::optional<IntentRow> intent;  // the open one, if any
  bool homes = false;               // the intent ends where homing ends
};

struct Reconciled {
  UnitKnowledge knowledge;
  std::optional<IntentEnd> intent_end;  // set where an intent was open
  const char* reason = "";              // for people, where the knowledge is an interval or unknown
};

/// Pre: the unit is at rest (status.state is not kMoving or kHoming).
Reconciled Reconcile(const UnitSays& unit, const StoreSays& store);

/// An intent's hull, widened by the half electrical turn that power-on alignment may add.
UnitKnowledge InterruptedHull(const IntentRow& intent,
                              const std::array<std::uint16_t, kAxisCount>& subdivision);

}  // namespace focalfleet
