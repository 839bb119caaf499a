#include "sim/campaigns/campaign/campaign.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>

namespace focalfleet::sim {
namespace {

std::string Where(const Campaign& campaign, std::size_t unit, std::size_t row) {
  return campaign.name + ": unit " + std::to_string(campaign.units[unit].id) + ", move " +
         std::to_string(campaign.move_id[row]);
}

Status ValidateShapes(const Campaign& campaign) {
  const std::size_t rows = campaign.rows();
  bool good = campaign.first_row.size() == campaign.units.size() + 1 &&
              campaign.x_mm.size() == rows && campaign.y_mm.size() == rows;
  for (const std::size_t axis : {kTheta, kPhi})
    good = good && campaign.from_deg[axis].size() == rows && campaign.cmd_deg[axis].size() == rows;
  for (const Covariate& covariate : campaign.covariates)
    good = good && covariate.values.size() == rows;
  for (const WordColumn& column : campaign.word_columns)
    good = good && column.values.size() == rows;
  good = good && campaign.first_row.front() == 0 && campaign.first_row.back() == rows &&
         std::is_sorted(campaign.first_row.begin(), campaign.first_row.end());
  if (!good) return Fail(ErrorCode::kInvalid, campaign.name + ": columns of unequal length");
  return {};
}

Status ValidateUnit(const Campaign& campaign, std::size_t unit) {
  const CampaignUnit& u = campaign.units[unit];
  for (const std::size_t axis : {kTheta, kPhi})
    if (!(u.arm_mm[axis] > 0) || !(u.gear[axis] > 0) || !std::isfinite(u.zero_deg[axis]))
      return Fail(ErrorCode::kInvalid, campaign.name + ": unit " + std::to_string(u.id) +
                                           ": arm, gear or zero is wrong");
  std::set<std::int64_t> moves;
  for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row) {
    for (const std::size_t axis : {kTheta, kPhi})
      if (!std::isfinite(campaign.from_deg[axis][row]) ||
          !std::isfinite(campaign.cmd_deg[axis][row]))
        return Fail(ErrorCode::kInvalid, Where(campaign, unit, row) + ": an angle is missing");
    if (!moves.insert(campaign.move_id[row]).second)
      return Fail(ErrorCode::kInvalid, Where(campaign, unit, row) + " is there twice");
  }
  return {};
}

template <class T>
void KeepValues(const std::vector<T>& from, const std::vector<bool>& keep, std::vector<T>* to) {
  for (std::size_t row = 0; row < from.size(); ++row)
    if (keep[row]) to->push_back(from[row]);
}

}  // namespace

std::span<const double> Campaign::Find(std::string_view covariate) const {
  for (const Covariate& candidate : covariates)
    if (candidate.name == covariate) return candidate.values;
  return {};
}

Exposures FindExposures(const Campaign& campaign) {
  // Rows of a unit are in the order in which they were made. Exposures have the order of the first
  // unit that has them, and later units add the exposures that it lacks.
  Exposures exposures;
  std::map<std::int64_t, std::uint32_t> index;
  exposures.of_row.reserve(campaign.rows());
  for (const std::int64_t move : campaign.move_id) {
    const auto next = static_cast<std::uint32_t>(exposures.move_id.size());
    const auto [it, fresh] = index.emplace(move, next);
    if (fresh) exposures.move_id.push_back(move);
    exposures.of_row.push_back(it->second);
  }
  return exposures;
}

Status Validate(const Campaign& campaign) {
  if (campaign.units.empty() || campaign.rows() == 0)
    return Fail(ErrorCode::kInvalid, campaign.name + ": no units or no moves");
  FOCALFLEET_TRY(ValidateShapes(campaign));
  std::set<std::uint32_t> ids;
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit) {
    if (!ids.insert(campaign.units[unit].id).second)
      return Fail(
          ErrorCode::kInvalid,
          campaign.name + ": unit " + std::to_string(campaign.units[unit].id) + " is there twice");
    FOCALFLEET_TRY(ValidateUnit(campaign, unit));
  }
  return {};
}

Campaign Keep(const Campaign& campaign, const std::vector<bool>& keep_row) {
  Campaign kept;
  kept.name = campaign.name;
  kept.units = campaign.units;
  kept.coordinator_units = campaign.coordinator_units;
  kept.first_row.push_back(0);
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit) {
    std::size_t rows = 0;
    for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row)
      if (keep_row[row]) ++rows;
    kept.first_row.push_back(kept.first_row.back() + rows);
  }
  KeepValues(campaign.move_id, keep_row, &kept.move_id);
  for (const std::size_t axis : {kTheta, kPhi}) {
    KeepValues(campaign.from_deg[axis], keep_row, &kept.from_deg[axis]);
    KeepValues(campaign.cmd_deg[axis], keep_row, &kept.cmd_deg[axis]);
  }
  KeepValues(campaign.x_mm, keep_row, &kept.x_mm);
  KeepValues(campaign.y_mm, keep_row, &kept.y_mm);
  for (const Covariate& covariate : campaign.covariates) {
    kept.covariates.push_back({covariate.name, {}});
    KeepValues(covariate.values, keep_row, &kept.covariates.back().values);
  }
  for (const WordColumn& column : campaign.word_columns) {
    kept.word_columns.push_back({column.name, column.words, {}});
    KeepValues(column.values, keep_row, &kept.word_columns.back().values);
  }
  return kept;
}

PlacePoint PlaceOf(const CampaignUnit& unit, double theta_deg, double phi_deg) {
  constexpr double kRadians = std::numbers::pi / 180;
  const double theta = (theta_deg + unit.zero_deg[kTheta]) * kRadians;
  const double both = theta + (phi_deg + unit.zero_deg[kPhi]) * kRadians;
  return {
      unit.base_x_mm + unit.arm_mm[kTheta] * std::cos(theta) + unit.arm_mm[kPhi] * std::cos(both),
      unit.base_y_mm + unit.arm_mm[kTheta] * std::sin(theta) + unit.arm_mm[kPhi] * std::sin(both)};
}

}  // namespace focalfleet::sim
