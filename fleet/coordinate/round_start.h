// The common start of a round: the start signal, said some times, and the judgement afterwards.
// Each unit dates its start by its own clock. Where the starts were certainly further apart than
// the plan allowed for, an alarm says so, and the next plans allow for more.
// docs/adr/0010-start-skew.md
#pragma once

#include "fleet/coordinate/configuration_view.h"
#include "fleet/coordinate/coordination.h"
#include "fleet/coordinate/round.h"
#include "fleet/coordinate/start_skew.h"

namespace focalfleet {

class RoundStart {
 public:
  /// `round` outlives this.
  RoundStart(const Coordination& fleet, Round* round) : fleet_(fleet), round_(*round) {}

  /// All units of the plan start at this instant: says it for the first time. Returns when it is to
  /// be repeated; kNever: not any more.
  HostInstant Begin(HostInstant at);
  /// Says the start signal again where that is due; returns as Begin.
  HostInstant Repeat();
  /// The start signal is not said any more.
  void Cancel() { repeat_at_ = kNever; }

  /// The unit's start is known. Brings `view` up to date, which keeps the widest of all rounds.
  void NoteStart(PositionerIndex i, std::uint32_t round_number, StartView* view);
  /// The answer that dates the unit's start is on its way: the round is over when it has come.
  [[nodiscard]] bool Awaits(PositionerIndex i) const;
  /// The round is over: widens the skew of the next plans where the starts prove that it must be.
  void Judge();

 private:
  HostInstant Say();
  [[nodiscard]] DurationNs Left() const;

  const Coordination fleet_;
  Round& round_;
  HostInstant repeat_at_ = kNever;
  int said_ = 0;
  StartSkew skew_;  // of this round
};

}  // namespace focalfleet
