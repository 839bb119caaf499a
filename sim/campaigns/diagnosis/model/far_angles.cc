#include "sim/campaigns/diagnosis/model/far_angles.h"

#include <algorithm>
#include <cmath>

#include "protocol/base/units.h"

namespace focalfleet::sim {

AnglesToPlace FindAngles(const CampaignUnit& unit, double x_mm, double y_mm, double theta_deg,
                         double phi_deg) {
  constexpr double kBeyond = 0.02;  // of the arms
  const double a = unit.arm_mm[kTheta], b = unit.arm_mm[kPhi];
  const double x = x_mm - unit.base_x_mm, y = y_mm - unit.base_y_mm, r = std::hypot(x, y);
  AnglesToPlace out{theta_deg, phi_deg, r <= (a + b) * (1 + kBeyond)};
  if (!out.reached) return out;
  const double cosine = std::clamp((r * r - a * a - b * b) / (2 * a * b), -1.0, 1.0);
  const double bend_deg = std::acos(cosine) / kRadiansPerDegree;
  double least = 1e300;
  for (const double side : {1.0, -1.0}) {
    const double phi = side * bend_deg - unit.zero_deg[kPhi];
    const double bend = side * bend_deg * kRadiansPerDegree;
    const double theta =
        (std::atan2(y, x) - std::atan2(b * std::sin(bend), a + b * std::cos(bend))) /
            kRadiansPerDegree -
        unit.zero_deg[kTheta];
    const double of_theta = std::remainder(theta - theta_deg, 360);
    // Phi decides the side: it has a range of half a turn, and theta any angle.
    for (const double turn : {-360.0, 0.0, 360.0}) {
      constexpr double kBeyondRange_deg = 5;  // an error at the end of the range
      const double of_phi = std::remainder(phi - phi_deg, 360) + turn;
      const bool in_range = phi_deg + of_phi >= unit.min_deg[kPhi] - kBeyondRange_deg &&
                            phi_deg + of_phi <= unit.max_deg[kPhi] + kBeyondRange_deg;
      const double cost = std::abs(of_phi) + (in_range ? 0 : 720);
      if (cost < least)
        least = cost, out.theta_deg = theta_deg + of_theta, out.phi_deg = phi_deg + of_phi;
    }
  }
  return out;
}

void TakeFarAngles(const UnitTrack& track, const std::vector<double>& theta_deg,
                   const std::vector<double>& phi_deg, std::vector<double>* x_um,
                   std::vector<double>* y_um) {
  constexpr double kFar_um = 500;  // an arc of 6 mm and its chord differ by 5 um there
  const Campaign& campaign = *track.facts->campaign;
  const bool closed = !track.facts->closed.empty();
  double off_deg = 0;  // of theta, by the row before: an error that adds up goes on from there
  for (std::size_t i = 0; i < track.moves; ++i) {
    const std::size_t row = track.first_row + i;
    if (track.restarts[i] != 0) off_deg = 0;
    // An axis that is a whole turn off is at its place.
    const bool is_near =
        std::hypot((*x_um)[row], (*y_um)[row]) < kFar_um && std::abs(off_deg) < 180;
    if (!std::isfinite((*x_um)[row])) continue;
    if (is_near) {
      off_deg = 0;
      continue;
    }
    const AnglesToPlace at =
        FindAngles(*track.unit, campaign.x_mm[row], campaign.y_mm[row], theta_deg[i], phi_deg[i]);
    if (!at.reached) continue;
    double theta_off = at.theta_deg - theta_deg[i];
    const double phi_off = at.phi_deg - phi_deg[i];
    // Whole turns: by the camera's next word where the loop is closed, else nearest to the error of
    // the row before.
    const bool seen_next = closed && i + 1 < track.moves && track.restarts[i + 1] == 0 &&
                           track.facts->closed[row + 1] != 0;
    const double about = seen_next ? track.from_deg[kTheta][i + 1] - theta_deg[i] : off_deg;
    theta_off = about + std::remainder(theta_off - about, 360);
    if (!closed) off_deg = theta_off;
    const double per = kRadiansPerDegree * kUmPerMm;
    const double ex = track.elbow_x_mm[i], ey = track.elbow_y_mm[i];
    const double rx = track.reach_x_mm[i], ry = track.reach_y_mm[i];
    (*x_um)[row] = per * (-(ey + ry) * theta_off - ry * phi_off);
    (*y_um)[row] = per * ((ex + rx) * theta_off + rx * phi_off);
  }
}

}  // namespace focalfleet::sim
