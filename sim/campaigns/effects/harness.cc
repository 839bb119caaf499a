#include "sim/campaigns/effects/harness.h"

#include <algorithm>
#include <numeric>
#include <tuple>

namespace focalfleet::sim {
namespace {

double MotorsOf(const std::vector<double> (&step_deg)[2], std::size_t row) {
  return (step_deg[0][row] != 0 ? 1 : 0) + (step_deg[1][row] != 0 ? 1 : 0);
}

}  // namespace

HarnessLoads FindHarnessLoads(const Exposures& exposures, const std::vector<double> (&step_deg)[2],
                              const std::vector<double>& rail, const std::vector<double>& slot,
                              const std::vector<double>& movers) {
  const std::size_t rows = rail.size();
  HarnessLoads loads;
  loads.motors.resize(rows);
  if (!slot.empty()) loads.shared_motors.resize(rows);
  const double slots =
      slot.empty() ? 1 : std::max(*std::max_element(slot.begin(), slot.end()), 0.0) + 1;
  std::vector<std::size_t> order(rows);
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto key = [&](std::size_t row) {
    return std::tuple(exposures.of_row[row], rail[row], slot.empty() ? 0 : slot[row], row);
  };
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return key(a) < key(b); });
  for (std::size_t begin = 0, end = 0; begin < rows; begin = end) {
    const std::size_t first = order[begin];
    double motors = 0, seen = 0;
    for (end = begin; end < rows && rail[order[end]] == rail[first] &&
                      exposures.of_row[order[end]] == exposures.of_row[first];
         ++end) {
      const double own = MotorsOf(step_deg, order[end]);
      motors += own;
      seen += own > 0 ? 1 : 0;
    }
    // Units nearer to the supply: their motors, and motors times their own share.
    double nearer = 0, nearer_shares = 0;
    for (std::size_t k = begin; k < end; ++k) {
      const std::size_t row = order[k];
      const double all = seen > 0 ? std::max(1.0, movers[row] / seen) : 1;
      loads.motors[row] = all * motors;
      if (slot.empty()) continue;
      const double share = (slot[row] + 1) / slots;
      loads.shared_motors[row] = all * (nearer_shares + share * (motors - nearer));
      nearer += MotorsOf(step_deg, row);
      nearer_shares += share * MotorsOf(step_deg, row);
    }
  }
  return loads;
}

}  // namespace focalfleet::sim
