#include "daemon/campaign/class_table.h"

#include <fmt/format.h>

namespace focalfleet {

bool NeedsRepair(sim::AxisClass axis_class) {
  return axis_class != sim::AxisClass::kHealthy && axis_class != sim::AxisClass::kUnknown;
}

std::vector<std::vector<std::string>> ClassRows(const std::vector<sim::AxisReport>& axes) {
  constexpr std::size_t kNamed = 8;
  std::vector<std::vector<std::string>> rows;
  for (const sim::AxisClass of :
       {sim::AxisClass::kHealthy, sim::AxisClass::kScale, sim::AxisClass::kSlipping,
        sim::AxisClass::kStuck, sim::AxisClass::kWrapped, sim::AxisClass::kUnknown}) {
    std::size_t count = 0;
    std::string which;
    for (const sim::AxisReport& axis : axes) {
      if (axis.is != of || ++count > kNamed || !NeedsRepair(of)) continue;
      which += fmt::format("{}{} {}", which.empty() ? "" : ", ",
                           axis.axis == sim::kTheta ? "theta" : "phi", axis.unit_id);
    }
    if (!which.empty() && count > kNamed) which += fmt::format(" and {} more", count - kNamed);
    if (count > 0) rows.push_back({std::string(Name(of)), std::to_string(count), which});
  }
  return rows;
}

}  // namespace focalfleet
