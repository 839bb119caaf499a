#include "daemon/campaign/campaign_log.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace focalfleet {
namespace {

constexpr double kMovedDeg = 1e-9;
constexpr double kTunedAmplitude = 1;

/// The index of `word` in `words`, to which it is added where it is missing.
int IndexOf(const std::string& word, std::vector<std::string>* words) {
  const auto found = std::find(words->begin(), words->end(), word);
  const auto index = static_cast<int>(found - words->begin());
  if (found == words->end()) words->push_back(word);
  return index;
}

bool Moved(const LoggedMove& row) {
  return std::abs(row.to.theta_deg - row.from.theta_deg) > kMovedDeg ||
         std::abs(row.to.phi_deg - row.from.phi_deg) > kMovedDeg;
}

}  // namespace

sim::CampaignUnit DescribeUnit(const Unit& unit) {
  sim::CampaignUnit described{.id = unit.id.value,
                              .base_x_mm = unit.base_fp.x_mm,
                              .base_y_mm = unit.base_fp.y_mm,
                              .rail = static_cast<double>(unit.rail.value),
                              .rail_slot = unit.rail_slot ? *unit.rail_slot : std::nan(""),
                              .bus = static_cast<double>(unit.bus.value),
                              .bus_slot = unit.bus_slot ? *unit.bus_slot : std::nan(""),
                              .enabled = unit.enabled};
  for (const Axis axis : kAxes) {
    const AxisGeometry& geometry = unit.axis[Index(axis)];
    described.arm_mm[Index(axis)] = geometry.arm_mm;
    described.zero_deg[Index(axis)] = geometry.zero_deg;
    described.gear[Index(axis)] = geometry.gear;
    described.min_deg[Index(axis)] = geometry.min_deg;
    described.max_deg[Index(axis)] = geometry.max_deg;
  }
  return described;
}

namespace {

/// The hardware that made all these moves; 0: not known, or replaced in between.
SerialNumber SerialOf(const std::vector<LoggedMove>& moves) {
  const SerialNumber first = moves.front().serial;
  const bool same =
      std::ranges::all_of(moves, [&](const LoggedMove& move) { return move.serial == first; });
  return same ? first : SerialNumber{};
}

}  // namespace

void CampaignLog::Add(const std::vector<LoggedMove>& units) {
  for (const LoggedMove& row : units) {
    of_unit_[row.unit.value].push_back(row);
    if (const auto i = layout_->Find(row.unit); i && Moved(row))
      ++movers_[{row.move, layout_->unit(*i).rail.value}];
  }
}

sim::Campaign CampaignLog::Campaign(const std::string& name) const {
  sim::Campaign campaign;
  campaign.name = name;
  constexpr std::array kNames{"t_s",          "sigma_um",  "delay_s",  "rail_id",
                              "rail_slot",    "bus_id",    "bus_slot", "movers_on_rail",
                              "v_bus_V",      "counter1",  "repeat",   "drive_amplitude",
                              "cycles_theta", "cycles_phi"};
  std::array<sim::Covariate, kNames.size()> columns;
  for (std::size_t column = 0; column < kNames.size(); ++column)
    columns[column].name = kNames[column];
  sim::WordColumn mode{.name = "mode", .words = {}, .values = {}};
  campaign.first_row.push_back(0);
  for (const Unit& unit : layout_->units()) {
    const auto found = of_unit_.find(unit.id.value);
    if (found == of_unit_.end()) continue;
    campaign.units.push_back(DescribeUnit(unit));
    campaign.units.back().serial = SerialOf(found->second).value;
    const sim::CampaignUnit& described = campaign.units.back();
    double cycles[2] = {0, 0};
    for (const LoggedMove& row : found->second) {
      campaign.move_id.push_back(row.move);
      campaign.from_deg[0].push_back(row.from.theta_deg);
      campaign.from_deg[1].push_back(row.from.phi_deg);
      campaign.cmd_deg[0].push_back(row.to.theta_deg);
      campaign.cmd_deg[1].push_back(row.to.phi_deg);
      campaign.x_mm.push_back(row.x_mm);
      campaign.y_mm.push_back(row.y_mm);
      cycles[0] += std::abs(row.to.theta_deg - row.from.theta_deg) / 360;
      cycles[1] += std::abs(row.to.phi_deg - row.from.phi_deg) / 360;
      const auto movers = movers_.find({row.move, unit.rail.value});
      const std::array<double, kNames.size()> values{
          row.t_s,
          row.sigma_um,
          row.delay_s,
          described.rail,
          described.rail_slot,
          described.bus,
          described.bus_slot,
          movers == movers_.end() ? 0.0 : static_cast<double>(movers->second),
          row.v_bus_V,
          row.counter1,
          row.repeat,
          kTunedAmplitude,
          cycles[0],
          cycles[1]};
      for (std::size_t column = 0; column < values.size(); ++column)
        columns[column].values.push_back(values[column]);
      mode.values.push_back(IndexOf(row.mode, &mode.words));
    }
    campaign.first_row.push_back(campaign.move_id.size());
  }
  for (sim::Covariate& column : columns) campaign.covariates.push_back(std::move(column));
  campaign.word_columns.push_back(std::move(mode));
  return campaign;
}

}  // namespace focalfleet
