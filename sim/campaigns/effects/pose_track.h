// A track of poses alone runs effects that need no covariate where there is no campaign. The track
// has the moves that a unit made since `begin_deg`, and the one it is about to make. The daemon's
// compensation uses it.
#pragma once

#include <array>
#include <vector>

#include "sim/campaigns/effects/effect.h"

namespace focalfleet::sim {

class PoseTrack {
 public:
  using AxisPair = std::array<double, 2>;  // degrees, theta and phi

  /// A track that begins anew: the unit's moves before it reached `begin_deg` are unknown. `unit`
  /// is read as long as the track lives.
  PoseTrack(const CampaignUnit& unit, const AxisPair& begin_deg);
  /// Adds one more move, straight from where the last one ended, or from elsewhere.
  void Go(const AxisPair& cmd_deg);
  void Go(const AxisPair& from_deg, const AxisPair& cmd_deg);
  /// Drops all moves but the first `moves`. Pre: no fewer were made.
  void Cut(std::size_t moves);

  /// The track as effects read it, valid until it changes. facts is null.
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
