#include "fleet/plan/bounds.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <map>

#include "fleet/estimate.h"
#include "fleet/plan/candidates.h"

namespace focalfleet {

double TimeBoundS(const Service& service) {
  const PlanRequest& request = service.request();
  double bound_s = 0;
  for (std::uint32_t i = 0; i < service.scene().size(); ++i)
    if (service.is_served(i))
      bound_s =
          std::max(bound_s, Straight(request.drives[i], service.start(i), service.goal(i)).end_s);
  return bound_s;
}

double PowerBoundS(const Service& service, const PowerLimits& limits, PowerLedger* ledger) {
  const PlanRequest& request = service.request();
  const Scene& scene = service.scene();
  std::map<std::uint32_t, double> rails;
  double total_J = 0;
  for (std::uint32_t i = 0; i < scene.size(); ++i) {
    if (!service.is_served(i)) continue;
    const double energy_J =
        ledger->Energy(i, Straight(request.drives[i], service.start(i), service.goal(i)).path);
    rails[scene.layout().unit({i}).rail.value] += energy_J;
    total_J += energy_J;
  }
  double bound_s = limits.total_W > 0 ? total_J / limits.total_W : 0;
  if (limits.rail_W > 0)
    for (const auto& [rail, energy_J] : rails)
      bound_s = std::max(bound_s, energy_J / limits.rail_W);
  return bound_s;
}

Status CheckPower(const Service& service, const PlanOptions& options) {
  const PlanRequest& request = service.request();
  const Scene& scene = service.scene();
  PowerLedger ledger(scene.layout(), request.drives, options.motor, options.power, {});
  double least_W = 0;  // of the units that move
  for (std::uint32_t i = 0; i < scene.size(); ++i)
    for (std::size_t k = 0; k < kAxisCount; ++k)
      if (service.is_served(i) && service.goal(i)[k] != service.start(i)[k])
        least_W = std::max(least_W, ledger.Motor_W(i, k));
  std::array<char, 160> text{};
  for (const auto& [limit_W, name] :
       {std::pair{options.power.rail_W, "rail"}, std::pair{options.power.total_W, "total"}}) {
    if (limit_W <= 0 || limit_W >= least_W) continue;
    std::snprintf(text.data(), text.size(),
                  "the %s limit of %.4f W is below what one motor draws; at least %.4f W "
                  "are needed",
                  name, limit_W, least_W);
    return Fail(ErrorCode::kRefused, text.data());
  }
  const double least_s = PowerBoundS(service, options.power, &ledger);
  if (least_s <= kOffsetMaxS) return {};
  std::snprintf(text.data(), text.size(),
                "the limits of power need %.0f s at least, a start can be put off for %.0f s; "
                "limits must be at least %.3f times as high",
                least_s, kOffsetMaxS, least_s / kOffsetMaxS);
  return Fail(ErrorCode::kRefused, text.data());
}

}  // namespace focalfleet
