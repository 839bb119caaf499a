#include "daemon/campaign/campaign_log.h"

#include <cmath>
#include <utility>

namespace focalfleet {
namespace {

constexpr double kMovedDeg = 1e-9;

bool Moved(const LoggedMove& row) {
  return std::abs(row.to.theta_deg - row.from.theta_deg) > kMovedDeg ||
         std::abs(row.to.phi_deg - row.from.phi_deg) > kMovedDeg;
}

sim::CampaignUnit Describe(const Unit& unit) {
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
  enum { kTime, kSigma, kVolts, kMovers, kCounter1, kRepeat, kCyclesTheta, kCyclesPhi, kCount };
  std::array<sim::Covariate, kCount> columns{{{"t_s", {}},
                                              {"sigma_um", {}},
                                              {"v_bus_V", {}},
                                              {"movers_on_rail", {}},
                                              {"counter1", {}},
                                              {"repeat", {}},
                                              {"cycles_theta", {}},
                                              {"cycles_phi", {}}}};
  sim::WordColumn mode{.name = "mode", .words = {conditions_.mode}, .values = {}};
  campaign.first_row.push_back(0);
  for (const Unit& unit : layout_->units()) {
    const auto found = of_unit_.find(unit.id.value);
    if (found == of_unit_.end()) continue;
    campaign.units.push_back(Describe(unit));
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
      const double values[kCount] = {
          row.t_s,
          row.sigma_um,
          conditions_.v_bus_V,
          movers == movers_.end() ? 0.0 : static_cast<double>(movers->second),
          conditions_.counter1[0],
          conditions_.repeat,
          cycles[0],
          cycles[1]};
      for (std::size_t column = 0; column < kCount; ++column)
        columns[column].values.push_back(values[column]);
      mode.values.push_back(0);
    }
    campaign.first_row.push_back(campaign.move_id.size());
  }
  for (sim::Covariate& column : columns) campaign.covariates.push_back(std::move(column));
  campaign.word_columns.push_back(std::move(mode));
  return campaign;
}

}  // namespace focalfleet
