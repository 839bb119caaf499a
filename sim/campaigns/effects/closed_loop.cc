#include "sim/campaigns/effects/closed_loop.h"

#include <algorithm>
#include <cmath>

#include "protocol/base/units.h"
#include "sim/campaigns/effects/effect.h"

namespace focalfleet::sim {
namespace {

std::array<std::vector<double>, 2> FindBeginErrors(const UnitTrack& track) {
  constexpr int kRounds = 3;  // Newton: each squares the error
  std::array<std::vector<double>, 2> off_deg;
  for (std::vector<double>& of_axis : off_deg) of_axis.assign(track.moves, 0);
  const Campaign& campaign = *track.facts->campaign;
  const CampaignUnit& table =
      (campaign.coordinator_units.empty() ? campaign.units
                                          : campaign.coordinator_units)[track.unit_index];
  const CampaignUnit& unit = *track.unit;
  for (std::size_t i = 0; i < track.moves; ++i) {
    if (track.restarts[i] != 0) continue;
    if (track.facts->closed[track.first_row + i] == 0) {
      // The coordinator counts on from where the loop was closed last.
      for (std::vector<double>& of_axis : off_deg) of_axis[i] = i > 0 ? of_axis[i - 1] : 0;
      continue;
    }
    const double from[2] = {track.from_deg[kTheta][i], track.from_deg[kPhi][i]};
    const PlacePoint seen = PlaceOf(table, from[kTheta], from[kPhi]);
    for (int round = 0; round < kRounds; ++round) {
      const double theta = from[kTheta] + off_deg[kTheta][i], phi = from[kPhi] + off_deg[kPhi][i];
      const PlacePoint at = PlaceOf(unit, theta, phi);
      const double a = (theta + unit.zero_deg[kTheta]) * kRadiansPerDegree;
      const double b = a + (phi + unit.zero_deg[kPhi]) * kRadiansPerDegree;
      const auto turn =
          AnglesOfShift(unit.arm_mm[kTheta] * std::cos(a), unit.arm_mm[kTheta] * std::sin(a),
                        unit.arm_mm[kPhi] * std::cos(b), unit.arm_mm[kPhi] * std::sin(b),
                        seen.x_mm - at.x_mm, seen.y_mm - at.y_mm);
      for (const std::size_t axis : {kTheta, kPhi}) off_deg[axis][i] += turn[axis];
    }
  }
  return off_deg;
}

}  // namespace

std::array<double, 2> AnglesOfShift(double elbow_x_mm, double elbow_y_mm, double reach_x_mm,
                                    double reach_y_mm, double shift_x_mm, double shift_y_mm) {
  // A turn of a radian that moves the fibre by less than this share of the arms is not asked for:
  // least squares are damped as far as that needs.
  constexpr double kDamping = 0.02;
  const double tx = -(elbow_y_mm + reach_y_mm), ty = elbow_x_mm + reach_x_mm;
  const double px = -reach_y_mm, py = reach_x_mm;
  const double arms2 = elbow_x_mm * elbow_x_mm + elbow_y_mm * elbow_y_mm + px * px + py * py;
  double a = tx * tx + ty * ty, c = px * px + py * py;
  const double b = tx * px + ty * py;
  const double weakest = (a + c) / 2 - std::hypot((a - c) / 2, b);
  const double damping = std::max(kDamping * kDamping * arms2 - weakest, 0.0);
  a += damping, c += damping;
  const double u = tx * shift_x_mm + ty * shift_y_mm, v = px * shift_x_mm + py * shift_y_mm;
  const double determinant = a * c - b * b;
  return {(c * u - b * v) / determinant / kRadiansPerDegree,
          (a * v - b * u) / determinant / kRadiansPerDegree};
}

std::shared_ptr<const BegunTrack> MakeBegunTrack(const UnitTrack& track) {
  auto made = std::make_shared<BegunTrack>();
  made->restarts.reserve(2 * track.moves);
  for (std::size_t i = 0; i < track.moves; ++i) {
    const std::size_t row = track.first_row + i;
    made->restarts.insert(made->restarts.end(), {track.restarts[i], 0});
    made->row.insert(made->row.end(), {i > 0 && track.restarts[i] == 0 ? row - 1 : row, row});
    for (const std::size_t axis : {kTheta, kPhi}) {
      const double from = track.from_deg[axis][i];
      made->from_deg[axis].insert(made->from_deg[axis].end(), 2, from);
      made->cmd_deg[axis].insert(made->cmd_deg[axis].end(), {from, track.cmd_deg[axis][i]});
      made->step_deg[axis].insert(made->step_deg[axis].end(), {0, track.step_deg[axis][i]});
    }
  }
  UnitTrack& along = made->track;
  along.facts = track.facts, along.unit = track.unit, along.unit_index = track.unit_index;
  along.first_row = track.first_row, along.moves = 2 * track.moves;
  for (const std::size_t axis : {kTheta, kPhi}) {
    along.cmd_deg[axis] = made->cmd_deg[axis], along.from_deg[axis] = made->from_deg[axis];
    along.step_deg[axis] = made->step_deg[axis];
  }
  along.restarts = made->restarts;
  along.of_beginnings = made.get();
  made->begin_error_deg = FindBeginErrors(track);
  TakePoses(&along);
  return made;
}

void AddDifferences(const UnitTrack& track, const PoseErrors& along, PoseErrors* errors) {
  const UnitTrack& poses = track.beginnings->track;
  const auto to = errors->channels();
  const auto from = along.channels();
  std::array<double, 2> begun_deg = {0, 0};  // since the loop was closed last
  for (std::size_t i = 0; i < track.moves; ++i) {
    for (std::size_t k = 0; k < to.size(); ++k) (*to[k])[i] += (*from[k])[2 * i + 1];
    if (track.restarts[i] != 0) {
      begun_deg = {0, 0};
    } else if (track.facts->closed[track.first_row + i] != 0) {
      const std::size_t b = 2 * i;
      const double of_theta = along.arm_mm[kTheta][b] / track.unit->arm_mm[kTheta];
      const double of_phi = along.arm_mm[kPhi][b] / track.unit->arm_mm[kPhi];
      const double x =
          along.x_mm[b] + of_theta * poses.elbow_x_mm[b] + of_phi * poses.reach_x_mm[b];
      const double y =
          along.y_mm[b] + of_theta * poses.elbow_y_mm[b] + of_phi * poses.reach_y_mm[b];
      begun_deg = AnglesOfShift(poses.elbow_x_mm[b], poses.elbow_y_mm[b], poses.reach_x_mm[b],
                                poses.reach_y_mm[b], x, y);
      for (const std::size_t axis : {kTheta, kPhi}) begun_deg[axis] += along.angle_deg[axis][b];
    }
    for (const std::size_t axis : {kTheta, kPhi}) errors->angle_deg[axis][i] -= begun_deg[axis];
  }
}

}  // namespace focalfleet::sim
