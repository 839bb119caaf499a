// A track of poses alone: for effects that need no covariate, where there is no campaign. What a
// unit did since then, and what it is about to do, as the daemon's compensation asks for it.
#pragma once

#include <array>
#include <vector>

#include "sim/campaigns/effects/effect.h"

namespace focalfleet::sim {

/// An effect that looks at the unit's own poses and at nothing else, and moves nothing but the
/// unit.
bool IsOfPosesAlone(const Effect& effect);

class PoseTrack {
 public:
  using AxisPair = std::array<double, 2>;  // degrees, theta and phi

  /// Begins anew: nothing is known of what the unit did before it stood at `begin_deg`. `unit` is
  /// read as long as the track lives.
  PoseTrack(const CampaignUnit& unit, const AxisPair& begin_deg);
  /// One more move, straight from where the last one ended, or from elsewhere.
  void Go(const AxisPair& cmd_deg);
  void Go(const AxisPair& from_deg, const AxisPair& cmd_deg);
  /// As if only so many had been made. Pre: no fewer were.
  void Cut(std::size_t moves);

  /// Valid until it changes. facts is null.
  [[nodiscard]] const UnitTrack& track();
  [[nodiscard]] std::size_t moves() const { return cmd_[kTheta].size(); }

 private:
  const CampaignUnit& unit_;
  AxisPair begin_deg_;
  std::vector<double> cmd_[2];
  std::vector<double> from_[2];
  std::vector<double> step_[2];
  std::vector<char> restarts_;
  UnitTrack track_;
};

}  // namespace focalfleet::sim
