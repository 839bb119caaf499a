#include "fleet/drive_choice.h"

#include <algorithm>
#include <map>
#include <set>
#include <tuple>
#include <utility>

namespace focalfleet {
namespace {

struct Cost {
  int refused = 0;  // axes
  double cost = 0;  // J, or s of the slower axis
  bool operator<(const Cost& other) const {
    return std::tie(refused, cost) < std::tie(other.refused, other.cost);
  }
};

Cost CostOf(const DriveCandidate& candidate, std::size_t unit, Minimise minimise) {
  Cost sum;
  for (std::size_t k = unit * kAxisCount; k < (unit + 1) * kAxisCount; ++k) {
    const AxisCost& axis = candidate.axes[k];
    if (!axis.tuned) {
      ++sum.refused;
      continue;
    }
    sum.cost =
        minimise == Minimise::kEnergy ? sum.cost + axis.move_J : std::max(sum.cost, axis.move_s);
  }
  return sum;
}

/// The first of the best candidates of one voltage. Pre: there is one.
std::size_t BestAt(double v_bus_V, std::span<const DriveCandidate> candidates, std::size_t unit,
                   Minimise minimise) {
  std::size_t best = candidates.size();
  for (std::size_t c = 0; c < candidates.size(); ++c) {
    if (candidates[c].v_bus_V != v_bus_V) continue;
    if (best == candidates.size() ||
        CostOf(candidates[c], unit, minimise) < CostOf(candidates[best], unit, minimise))
      best = c;
  }
  return best;
}

}  // namespace

std::vector<std::size_t> ChooseDrives(std::span<const RailId> rails,
                                      std::span<const DriveCandidate> candidates,
                                      Minimise minimise) {
  std::set<double> voltages;
  for (const DriveCandidate& candidate : candidates) voltages.insert(candidate.v_bus_V);
  std::map<std::pair<RailId, double>, Cost> sums;
  for (std::size_t unit = 0; unit < rails.size(); ++unit)
    for (const double v_bus_V : voltages) {
      const std::size_t best = BestAt(v_bus_V, candidates, unit, minimise);
      const Cost cost = CostOf(candidates[best], unit, minimise);
      Cost& sum = sums[{rails[unit], v_bus_V}];
      sum.refused += cost.refused;
      sum.cost += cost.cost;
    }
  std::map<RailId, double> chosen_V;
  for (const auto& [key, cost] : sums) {
    const auto& [rail, v_bus_V] = key;
    const auto known = chosen_V.find(rail);
    if (known == chosen_V.end() || cost < sums[{rail, known->second}]) chosen_V[rail] = v_bus_V;
  }
  std::vector<std::size_t> chosen;
  chosen.reserve(rails.size());
  for (std::size_t unit = 0; unit < rails.size(); ++unit)
    chosen.push_back(BestAt(chosen_V[rails[unit]], candidates, unit, minimise));
  return chosen;
}

}  // namespace focalfleet
