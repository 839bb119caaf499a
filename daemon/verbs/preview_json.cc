#include "daemon/verbs/preview_json.h"

#include <map>
#include <string>
#include <utility>

namespace focalfleet {

Json PreviewJson(const Layout& layout, const PlanDone& done, std::uint32_t targeted,
                 std::span<const Preview::Refused> refused) {
  const Plan& plan = *done.plan;
  const auto id = [&](PositionerIndex i) { return layout.unit(i).id.value; };
  std::map<std::uint32_t, std::string> reasons;
  for (const auto& [unit, reason] : refused) reasons[id(unit)] = reason;
  for (const Unserved& unserved : plan.unserved)
    reasons[id(unserved.unit)] =
        std::string(Name(unserved.why)) +
        (unserved.by ? " by unit " + std::to_string(id(*unserved.by)) : std::string());
  Json rows = Json::array();
  for (auto& [unit_id, reason] : reasons)
    rows.push_back({{"unit_id", unit_id}, {"outcome", "refused"}, {"reason", std::move(reason)}});
  return {{"dry_run", true},
          {"plan", done.job},
          {"targeted", targeted},
          {"served", targeted - reasons.size()},
          {"moving", plan.moves.size()},
          {"makespan_s", done.predicted.makespan_s},
          {"bound_s", plan.bound_s},
          {"energy_J", done.predicted.energy_J},
          {"peak_power_W", done.predicted.peak_power_W},
          {"unserved", std::move(rows)}};
}

}  // namespace focalfleet
