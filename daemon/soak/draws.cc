#include "daemon/soak/draws.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "protocol/base/rng.h"

namespace focalfleet::soak {
namespace {

double LogUniform(Rng* rng, double low, double high) {
  return low * std::exp(rng->Uniform() * std::log(high / low));
}

DurationNs SecondsOf(double seconds) {
  return DurationNs{static_cast<std::int64_t>(1e9 * seconds)};
}

}  // namespace

Draws DrawSeed(std::uint64_t seed, const DrawLimits& limits) {
  Rng rng = Rng::Stream(seed, "soak draws");
  Draws draws{.seed = seed};
  draws.units = 10 + static_cast<std::uint32_t>(rng.Below(51));
  draws.units_per_bus = 4 + static_cast<std::uint32_t>(rng.Below(17));
  draws.safety = SecondsOf(rng.Uniform(60, 200));
  draws.commit = SecondsOf(LogUniform(&rng, 0.0005, 0.05));
  draws.plan = SecondsOf(LogUniform(&rng, 0.005, 1));
  draws.turn = SecondsOf(LogUniform(&rng, 0.0001, 0.002));
  draws.idle = SecondsOf(LogUniform(&rng, 1, 20));
  draws.camera = rng.Below(4) == 0;
  draws.real_spread = false;
  // A third of the seeds has few faults, so that configurations end and late states are reached.
  const double share = rng.Below(3) == 0 ? 0.08 : rng.Uniform(0.15, 0.5);
  for (std::size_t site = 0; site < kFaultSites; ++site) {
    Rng own = Rng::Stream(seed, "soak site", site);
    const bool exists = draws.camera || site < Index(FaultSite::kCameraDead) ||
                        site > Index(FaultSite::kCameraOtherField);
    draws.armed[site] = limits.faults && own.Uniform() < share && exists;
    draws.period[site] = SecondsOf(LogUniform(&own, 5, 80));
    draws.chance[site] = LogUniform(&own, 1e-5, 1e-2);
  }
  if (limits.units) {
    draws.units = *limits.units;
    if (draws.units > 200) draws.units_per_bus = 100;
  }
  // A late move of one unit is planned without a limit.
  Rng power = Rng::Stream(seed, "soak power");
  if (power.Below(4) == 0 && !draws.is(FaultSite::kOperatorRetarget)) {
    const double motors = 2 * std::min<double>(draws.units, 2 * draws.units_per_bus);
    draws.rail_motors = 0.5 + std::floor(motors * power.Uniform(0.4, 0.8));
  }
  return draws;
}

std::string Describe(const Draws& draws) {
  std::string text = fmt::format(
      "seed {}: {} units, {} a bus, {:.0f} s, commit {:.1f} ms, plan {:.0f} ms, turn {:.2f} ms, "
      "requests every {:.1f} s{}; armed:",
      draws.seed, draws.units, draws.units_per_bus, 1e-9 * static_cast<double>(draws.safety.ns),
      1e-6 * static_cast<double>(draws.commit.ns), 1e-6 * static_cast<double>(draws.plan.ns),
      1e-6 * static_cast<double>(draws.turn.ns), 1e-9 * static_cast<double>(draws.idle.ns),
      (draws.camera ? ", camera" : "") +
          (draws.rail_motors > 0 ? fmt::format(", {} motors a rail", draws.rail_motors) : ""));
  bool any = false;
  for (std::size_t site = 0; site < kFaultSites; ++site) {
    if (!draws.armed[site]) continue;
    text += fmt::format(" {}", kFaultSiteNames[site]);
    any = true;
  }
  return any ? text : text + " none";
}

}  // namespace focalfleet::soak
