#include "sim/campaigns/effects/pose_track.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <string_view>

namespace focalfleet::sim {

PoseTrack::PoseTrack(const CampaignUnit& unit, const AxisPair& begin_deg)
    : unit_(unit), begin_deg_(begin_deg) {}

void PoseTrack::Go(const AxisPair& cmd_deg) {
  Go(cmd_[kTheta].empty() ? begin_deg_ : AxisPair{cmd_[kTheta].back(), cmd_[kPhi].back()}, cmd_deg);
}

void PoseTrack::Go(const AxisPair& from_deg, const AxisPair& cmd_deg) {
  constexpr double kRadians = std::numbers::pi / 180;
  for (const std::size_t axis : {kTheta, kPhi}) {
    from_[axis].push_back(from_deg[axis]);
    cmd_[axis].push_back(cmd_deg[axis]);
    step_[axis].push_back(cmd_deg[axis] - from_deg[axis]);
  }
  restarts_.push_back(restarts_.empty() ? 1 : 0);
  const double theta = (cmd_deg[kTheta] + unit_.zero_deg[kTheta]) * kRadians;
  const double both = theta + (cmd_deg[kPhi] + unit_.zero_deg[kPhi]) * kRadians;
  track_.elbow_x_mm.push_back(unit_.arm_mm[kTheta] * std::cos(theta));
  track_.elbow_y_mm.push_back(unit_.arm_mm[kTheta] * std::sin(theta));
  track_.reach_x_mm.push_back(unit_.arm_mm[kPhi] * std::cos(both));
  track_.reach_y_mm.push_back(unit_.arm_mm[kPhi] * std::sin(both));
  track_.fibre_x_mm.push_back(unit_.base_x_mm + track_.elbow_x_mm.back() +
                              track_.reach_x_mm.back());
  track_.fibre_y_mm.push_back(unit_.base_y_mm + track_.elbow_y_mm.back() +
                              track_.reach_y_mm.back());
}

void PoseTrack::Cut(std::size_t moves) {
  for (const std::size_t axis : {kTheta, kPhi})
    for (std::vector<double>* column : {&from_[axis], &cmd_[axis], &step_[axis]})
      column->resize(moves);
  for (std::vector<double>* column : {&track_.elbow_x_mm, &track_.elbow_y_mm, &track_.reach_x_mm,
                                      &track_.reach_y_mm, &track_.fibre_x_mm, &track_.fibre_y_mm})
    column->resize(moves);
  restarts_.resize(moves);
}

const UnitTrack& PoseTrack::track() {
  track_.unit = &unit_;
  track_.moves = moves();
  for (const std::size_t axis : {kTheta, kPhi}) {
    track_.cmd_deg[axis] = cmd_[axis];
    track_.from_deg[axis] = from_[axis];
    track_.step_deg[axis] = step_[axis];
  }
  track_.restarts = restarts_;
  return track_;
}

}  // namespace focalfleet::sim
