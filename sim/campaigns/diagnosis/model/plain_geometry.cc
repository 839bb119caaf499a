#include "sim/campaigns/diagnosis/model/plain_geometry.h"

#include <algorithm>
#include <cmath>

#include "protocol/base/units.h"
#include "sim/campaigns/diagnosis/model/chances.h"
#include "sim/campaigns/diagnosis/model/static_geometry.h"

namespace focalfleet::sim {
namespace {

// Median distance, which a minority of bad rows does not move.
double MedianMiss(const std::vector<PlainRow>& rows, const CampaignUnit& unit) {
  std::vector<double> misses;
  for (const PlainRow& row : rows) {
    const PlacePoint at = PlaceOf(unit, row.theta_deg, row.phi_deg);
    misses.push_back(std::hypot(row.x_mm - at.x_mm, row.y_mm - at.y_mm));
  }
  return misses.empty() ? 0 : Median(std::move(misses));
}

}  // namespace

// Levenberg-Marquardt with L1-like weights about the median distance.
CampaignUnit FitPlain(const std::vector<PlainRow>& rows, const CampaignUnit& table,
                      CampaignUnit unit, int rounds) {
  std::vector<double> angles_deg[2];
  for (const PlainRow& row : rows)
    angles_deg[kTheta].push_back(row.theta_deg), angles_deg[kPhi].push_back(row.phi_deg);
  const bool moves[2] = {TellsOfItself(angles_deg[kTheta]), TellsOfItself(angles_deg[kPhi])};
  const StaticVector prior = StaticPriorWeights(GeometryIs::kAnywhere, moves);
  double damping = 1e-3;
  double miss_mm = std::max(MedianMiss(rows, unit), 1e-5);
  for (int round = 0; round < rounds; ++round) {
    StaticMatrix normal = StaticMatrix::Zero();
    StaticVector right = StaticVector::Zero();
    for (const PlainRow& row : rows) {
      const double a = (row.theta_deg + unit.zero_deg[0]) * kRadiansPerDegree;
      const double b = a + (row.phi_deg + unit.zero_deg[1]) * kRadiansPerDegree;
      const double ca = std::cos(a), sa = std::sin(a), cb = std::cos(b), sb = std::sin(b);
      const double ex = unit.arm_mm[0] * ca, ey = unit.arm_mm[0] * sa;
      const double rx = unit.arm_mm[1] * cb, ry = unit.arm_mm[1] * sb;
      Eigen::Matrix<double, 2, 6> j;
      j << 1, 0, ca, cb, -(ey + ry) * kRadiansPerDegree, -ry * kRadiansPerDegree, 0, 1, sa, sb,
          (ex + rx) * kRadiansPerDegree, rx * kRadiansPerDegree;
      const Eigen::Vector2d r(row.x_mm - unit.base_x_mm - ex - rx,
                              row.y_mm - unit.base_y_mm - ey - ry);
      const double w = 1 / std::max(1.0, r.norm() / (2 * miss_mm)) / (miss_mm * miss_mm);
      normal.noalias() += w * j.transpose() * j;
      right.noalias() += w * j.transpose() * r;
    }
    normal.diagonal() += prior;
    right -= prior.cwiseProduct((ToVector(unit) - ToVector(table)));
    StaticMatrix damped = normal;
    damped.diagonal() *= 1 + damping;
    const StaticVector step = damped.ldlt().solve(right);
    CampaignUnit next = unit;
    AddStatic(step, &next);
    const double next_mm = std::max(MedianMiss(rows, next), 1e-5);
    if (next_mm <= miss_mm * (1 + 1e-9)) {
      const bool rests = next_mm > miss_mm * (1 - 1e-6);
      unit = next, miss_mm = next_mm, damping = std::max(damping / 5, 1e-9);
      if (rests && round > 3) break;
    } else {
      damping *= 10;
      if (damping > 1e8) break;
    }
  }
  return unit;
}

CampaignUnit FindPlain(const std::vector<PlainRow>& rows, const CampaignUnit& table) {
  constexpr double kGood_mm = 0.1;
  constexpr int kStarts = 12;
  if (rows.size() < 4) return table;
  CampaignUnit best = FitPlain(rows, table, table, 40);
  double best_mm = MedianMiss(rows, best);
  if (best_mm < kGood_mm) return best;
  for (int a = 0; a < kStarts; ++a)
    for (int b = 0; b < kStarts; ++b) {
      CampaignUnit start = table;
      start.zero_deg[0] += 360.0 / kStarts * a;
      start.zero_deg[1] += 360.0 / kStarts * b;
      const CampaignUnit found = FitPlain(rows, table, start, 15);
      const double found_mm = MedianMiss(rows, found);
      if (found_mm < 0.98 * best_mm) best = found, best_mm = found_mm;
    }
  best = FitPlain(rows, table, best, 40);
  for (const std::size_t axis : {kTheta, kPhi})
    best.zero_deg[axis] =
        table.zero_deg[axis] + std::remainder(best.zero_deg[axis] - table.zero_deg[axis], 360.0);
  return best;
}

std::vector<CampaignUnit> FindCoordinatorsGeometry(const Campaign& campaign) {
  constexpr std::size_t kRowsMin = 8;
  constexpr double kAgree_mm = 0.05;  // more is no rounding of angles, and no noise of a camera
  const std::span<const double> closed = campaign.Find("from_measured");
  const std::span<const double> rehomed = campaign.Find("rehomed");
  std::vector<CampaignUnit> units = campaign.units;
  for (std::size_t unit = 0; unit < units.size() && !closed.empty(); ++unit) {
    std::vector<PlainRow> rows;
    for (std::size_t row = campaign.first_row[unit] + 1; row < campaign.first_row[unit + 1]; ++row)
      if (closed[row] > 0.5 && (rehomed.empty() || !(rehomed[row] > 0.5)) &&
          std::isfinite(campaign.x_mm[row - 1]))
        rows.push_back({campaign.from_deg[kTheta][row], campaign.from_deg[kPhi][row],
                        campaign.x_mm[row - 1], campaign.y_mm[row - 1]});
    // The table's geometry is the coordinator's where it agrees.
    if (rows.size() < kRowsMin || MedianMiss(rows, units[unit]) <= kAgree_mm) continue;
    const CampaignUnit found = FindPlain(rows, units[unit]);
    if (MedianMiss(rows, found) < kAgree_mm) units[unit] = found;
  }
  return units;
}

}  // namespace focalfleet::sim
