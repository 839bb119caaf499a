// A sector's side of its plane's rounds (sector_round.h): what the agent commands, and how far the
// sector is.
#pragma once

#include "fleet/coordinate/configuration_progress.h"
#include "fleet/coordinate/executor_rooms.h"
#include "fleet/coordinate/sector_round.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// A way to the executor's parts; it lives no longer than they.
class SectorRounds {
 public:
  SectorRounds(ExecutorRooms* rooms, ConfigurationProgress* progress)
      : rooms_(*rooms), progress_(*progress) {}

  /// The sector's part of a plan. Errors: kInvalid: it is none of this sector; kRefused: nobody
  /// waits for it.
  Status Do(const SectorRound& round);
  /// Errors: kRefused where the round is not held, or the instant is too near.
  Status Do(const SectorStartCommand& start);
  Status Do(const SectorWithdrawCommand& withdraw);
  Status Do(const BorderEndCommand& end);
  /// Errors: kInvalid: a unit that is none of this sector; kRefused: no configuration with targets
  /// is under way.
  Status Do(const SectorRetargetCommand& command);
  /// Findings of an exposure that nobody waits for have no effect. Errors: kInvalid: a unit that is
  /// none of this sector, or a place that cannot be.
  Status Do(const SectorFindings& findings);
  [[nodiscard]] SectorView View() const;

 private:
  ExecutorRooms& rooms_;
  ConfigurationProgress& progress_;
};

}  // namespace focalfleet
