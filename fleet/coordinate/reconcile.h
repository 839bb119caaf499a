// After a restart or a lost link, what is a unit's position worth? The unit's FLASH, its mark
// `moving`, the move that it began last, and what the store remembers are put side by side:
//
//   mark set                                  the move was cut by a power loss: an interval over
//   its hull mark clear, intent open, it began that    it ended by itself while nobody listened:
//   reported mark clear, intent open, it did not       it never began: reported, if FLASH still
//   says `from` no intent, FLASH equals the store         as good as before no intent, nothing
//   stored                 first sessions: reported anything else unknown: home it or measure it
//
// The interval is half an electrical turn wider than the hull: at power-on the field pulls the
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
