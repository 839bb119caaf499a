#include "sim/campaigns/effects/arm_gap.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>

namespace focalfleet::sim {
namespace {

struct Point {
  double x, y;
};
struct Arm {
  Point elbow, fibre;
};

Arm ArmOf(const CampaignUnit& unit, double theta_deg, double phi_deg) {
  constexpr double kRadians = std::numbers::pi / 180;
  const double first = (theta_deg + unit.zero_deg[kTheta]) * kRadians;
  const double second = first + (phi_deg + unit.zero_deg[kPhi]) * kRadians;
  const Point elbow = {unit.base_x_mm + unit.arm_mm[kTheta] * std::cos(first),
                       unit.base_y_mm + unit.arm_mm[kTheta] * std::sin(first)};
  return {elbow,
          {elbow.x + unit.arm_mm[kPhi] * std::cos(second),
           elbow.y + unit.arm_mm[kPhi] * std::sin(second)}};
}

double SquaredDistance(Point p, const Arm& arm) {
  const double dx = arm.fibre.x - arm.elbow.x, dy = arm.fibre.y - arm.elbow.y;
  const double along =
      ((p.x - arm.elbow.x) * dx + (p.y - arm.elbow.y) * dy) / std::max(dx * dx + dy * dy, 1e-12);
  const double share = std::clamp(along, 0.0, 1.0);
  const double off_x = p.x - arm.elbow.x - share * dx, off_y = p.y - arm.elbow.y - share * dy;
  return off_x * off_x + off_y * off_y;
}

bool Cross(const Arm& a, const Arm& b) {
  const auto side = [](const Arm& arm, Point p) {
    return (arm.fibre.x - arm.elbow.x) * (p.y - arm.elbow.y) -
           (arm.fibre.y - arm.elbow.y) * (p.x - arm.elbow.x);
  };
  return side(a, b.elbow) * side(a, b.fibre) < 0 && side(b, a.elbow) * side(b, a.fibre) < 0;
}

double Gap(const Arm& a, const Arm& b) {
  if (Cross(a, b)) return 0;
  return std::sqrt(std::min({SquaredDistance(a.elbow, b), SquaredDistance(a.fibre, b),
                             SquaredDistance(b.elbow, a), SquaredDistance(b.fibre, a)}));
}

}  // namespace

ArmGaps FindArmGaps(const Campaign& campaign, const Exposures& exposures,
                    const std::vector<std::vector<std::size_t>>& neighbours, double pitch_mm) {
  constexpr double kProbe_deg = 2;
  ArmGaps gaps;
  gaps.gap_mm.assign(campaign.rows(), pitch_mm);
  gaps.side.assign(campaign.rows(), 0);
  std::vector<std::size_t> row_of(exposures.size());
  for (std::size_t u = 0; u < campaign.units.size(); ++u)
    for (const std::size_t v : neighbours[u]) {
      std::fill(row_of.begin(), row_of.end(), SIZE_MAX);
      for (std::size_t row = campaign.first_row[v]; row < campaign.first_row[v + 1]; ++row)
        row_of[exposures.of_row[row]] = row;
      const CampaignUnit& own = campaign.units[u];
      for (std::size_t row = campaign.first_row[u]; row < campaign.first_row[u + 1]; ++row) {
        const std::size_t other = row_of[exposures.of_row[row]];
        if (other == SIZE_MAX) continue;
        const double theta = campaign.cmd_deg[kTheta][row], phi = campaign.cmd_deg[kPhi][row];
        const Arm arm = ArmOf(campaign.units[v], campaign.cmd_deg[kTheta][other],
                              campaign.cmd_deg[kPhi][other]);
        const double gap = Gap(ArmOf(own, theta, phi), arm);
        if (gap >= gaps.gap_mm[row]) continue;
        gaps.gap_mm[row] = gap;
        const double more = Gap(ArmOf(own, theta, phi + kProbe_deg), arm);
        gaps.side[row] = more >= Gap(ArmOf(own, theta, phi - kProbe_deg), arm) ? 1 : -1;
      }
    }
  return gaps;
}

}  // namespace focalfleet::sim
