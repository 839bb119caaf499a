#include "sim/campaigns/effects/thermal_mass.h"

#include <algorithm>
#include <cmath>

namespace focalfleet::sim {

std::vector<double> Late(std::span<const double> temperature_C, std::span<const double> time_s,
                         double tau_s) {
  std::vector<double> late(temperature_C.begin(), temperature_C.end());
  for (std::size_t i = 1; i < late.size(); ++i) {
    const double elapsed = std::max(time_s[i] - time_s[i - 1], 0.0) / tau_s;
    if (elapsed < 1e-9) {
      late[i] = late[i - 1];
      continue;
    }
    // C' = (T - C) / tau with T a ramp has the solution T less the constant lag behind the ramp,
    // and a term that fades.
    const double kept = std::exp(-elapsed);
    const double ahead = (temperature_C[i] - temperature_C[i - 1]) / elapsed;
    late[i] = temperature_C[i] - ahead + (late[i - 1] - temperature_C[i - 1] + ahead) * kept;
  }
  return late;
}

}  // namespace focalfleet::sim
