// Homing of units, wave by wave. The moves that make way for a wave are a round like any other. The
// units of the wave then run to their stops, each by its own firmware, and begin to count anew.
#pragma once

#include <vector>

#include "fleet/coordinate/configuration.h"
#include "fleet/coordinate/coordination.h"
#include "fleet/coordinate/round.h"

namespace focalfleet {

class Homing {
 public:
  /// All arguments outlive this.
  Homing(const Coordination& fleet, Configuration* configuration, Round* round)
      : fleet_(fleet), configuration_(*configuration), round_(*round) {}

  /// A configuration begins; `to_home` is empty unless it is one of homing.
  void Begin(const Goal& goal);
  void Clear();

  /// The units that are still to home, ascending.
  [[nodiscard]] const std::vector<PositionerIndex>& to_home() const { return to_home_; }
  [[nodiscard]] bool unproven() const { return unproven_; }

  /// Units that cannot home now are refused, with the reason. A goal of a daemon of its own has
  /// none, at first.
  void RefuseUnready();
  /// The planner's next wave.
  void SetWave(std::vector<PositionerIndex> wave) { wave_ = std::move(wave); }
  [[nodiscard]] bool HasWave() const { return !to_home_.empty() && !wave_.empty(); }
  /// Commits the intents of the wave. False: none of its units can home.
  [[nodiscard]] bool Commit();
  /// The intents are durable: the wave homes.
  void Start();
  /// True where the unit refuses to home: it has failed, and has no part in the round any more.
  [[nodiscard]] bool Refuses(PositionerIndex i, const HomeReply& reply);
  void NoteHomed(PositionerIndex i) { std::erase(to_home_, i); }
  /// The wave is over. A unit that did not get home is not tried again: its reason is on record.
  void EndWave();

 private:
  [[nodiscard]] bool MayBegin(PositionerIndex i) const;

  const Coordination fleet_;
  Configuration& configuration_;
  Round& round_;
  std::vector<PositionerIndex> to_home_;
  std::vector<PositionerIndex> wave_;
  bool unproven_ = false;  // HomeCommand::unproven
};

}  // namespace focalfleet
