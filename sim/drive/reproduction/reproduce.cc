#include "sim/drive/reproduction/reproduce.h"

#include <cmath>

#include "protocol/base/check.h"
#include "sim/drive/reproduction/parts.h"

namespace focalfleet::sim {

const char* Name(ClaimStatus status) {
  switch (status) {
    case ClaimStatus::kReproduced:
      return "reproduced";
    case ClaimStatus::kOrdering:
      return "ordering";
    case ClaimStatus::kFitted:
      return "fitted";
    case ClaimStatus::kDisagrees:
      return "disagrees";
    case ClaimStatus::kNotTestable:
      return "not testable";
  }
  return "";
}

namespace reproduction {

Drive::Setting PaperSetting(const ReproduceOptions& options, std::string_view set, double v_bus_V) {
  const auto motor = FindParameterSet(set);
  FOCALFLEET_CHECK(motor.has_value());
  Drive::Setting setting{*motor, {}, {.v_bus_V = v_bus_V}};
  setting.motor.resistance_ohm *= options.resistance_factor;
  return setting;
}

Drive::Setting Ideal(Drive::Setting setting) {
  setting.bridge = {.v_bus_V = setting.bridge.v_bus_V, .rise_s = 0, .fall_s = 0, .dead_time_s = 0};
  return setting;
}

ClaimStatus Within(const Claim& claim, double tolerance) {
  bool all = claim.paper.size() == claim.simulated.size();
  for (std::size_t k = 0; all && k < claim.paper.size(); ++k)
    all = std::abs(claim.simulated[k] - claim.paper[k]) <= tolerance * std::abs(claim.paper[k]);
  return all ? ClaimStatus::kReproduced : ClaimStatus::kDisagrees;
}

ClaimStatus InOrder(const std::vector<double>& numbers, Order order) {
  for (std::size_t k = 0; k + 1 < numbers.size(); ++k) {
    const double rise = numbers[k + 1] - numbers[k];
    if (!(order == Order::kRises ? rise > 0 : rise < 0)) return ClaimStatus::kDisagrees;
  }
  return ClaimStatus::kOrdering;
}

}  // namespace reproduction

Reproduction Reproduce(const ReproduceOptions& options, const ReproduceProgress& progress) {
  Reproduction out;
  progress(0, "times and currents");
  reproduction::AddTimes(options, &out);
  progress(0.03, "waves");
  reproduction::AddWaves(options, &out);
  progress(0.2, "starts");
  reproduction::AddStarts(options, progress, &out);
  progress(0.95, "positions");
  reproduction::AddPositions(options, &out);
  for (Claim& claim : out.claims)
    if (claim.status == ClaimStatus::kReproduced || claim.status == ClaimStatus::kOrdering)
      claim.reason.clear();
  progress(1, "done");
  return out;
}

}  // namespace focalfleet::sim
