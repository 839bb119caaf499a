// A model.toml of a small fleet: arms and zeros only, and where the campaign left each unit.
#pragma once

#include <string>

#include "daemon/campaign/campaign_log.h"
#include "fleet/layout.h"

namespace focalfleet::test {

inline std::string ModelText(const Layout& layout, const std::string& name) {
  std::string text = "name = \"" + name + "\"\ncampaign = \"night\"\nverdict = \"explained\"\n";
  text += "rms_before_um = 54\nrms_after_um = 9\n";
  for (const Unit& described : layout.units()) {
    const sim::CampaignUnit unit = DescribeUnit(described);
    const auto line = [&](const char* key, double value) {
      text += std::string(key) + " = " + std::to_string(value) + "\n";
    };
    text += "[[unit]]\nunit_id = " + std::to_string(unit.id) + "\n";
    line("base_x_mm", unit.base_x_mm);
    line("base_y_mm", unit.base_y_mm);
    line("arm_theta_mm", unit.arm_mm[0]);
    line("arm_phi_mm", unit.arm_mm[1]);
    line("theta_zero_deg", unit.zero_deg[0] + 1);
    line("phi_zero_deg", unit.zero_deg[1]);
    for (const char* key : {"left_theta_deg", "left_phi_deg", "added_theta_deg", "added_phi_deg"})
      line(key, 0);
  }
  return text;
}

}  // namespace focalfleet::test
