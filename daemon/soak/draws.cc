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

bool IsOfUnitOrBus(FaultSite site) {
  return (site >= FaultSite::kBusNoise && site <= FaultSite::kUnitMarkLost) ||
         site == FaultSite::kOldAnswers;
}

/// A late move of one unit is planned without a limit.
void DrawPower(Draws* draws) {
  Rng rng = Rng::Stream(draws->seed, "soak power");
  if (rng.Below(4) > 0 || draws->is(FaultSite::kOperatorRetarget)) return;
  const double motors = 2 * std::min<double>(draws->units, 2 * draws->units_per_bus);
  draws->rail_motors = 0.5 + std::floor(motors * rng.Uniform(0.4, 0.8));
}

void DrawClocks(Draws* draws) {
  Rng rng = Rng::Stream(draws->seed, "soak clocks");
  draws->kernel_stamps = rng.Below(2) == 0;
  if (rng.Below(2) == 0) draws->clock_error_max = LogUniform(&rng, 50e-6, 0.004);
}

/// In a quarter of the seeds only the host fails, and often.
void DrawHostAlone(Draws* draws) {
  Rng rng = Rng::Stream(draws->seed, "soak host alone");
  draws->host_alone = rng.Below(4) == 0;
  if (!draws->host_alone) return;
  for (std::size_t n = 0; n < kFaultSites; ++n) {
    const auto site = static_cast<FaultSite>(n);
    if (IsOfUnitOrBus(site)) draws->armed[n] = false;
    if (site <= FaultSite::kHostFreeze) draws->armed[n] = draws->armed[n] || rng.Below(3) == 0;
  }
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
  if (limits.kinds < DrawKinds::kPower) draws.armed[Index(FaultSite::kOldAnswers)] = false;
  if (limits.kinds < DrawKinds::kAll) draws.armed[Index(FaultSite::kOperatorModel)] = false;
  if (limits.kinds >= DrawKinds::kPower) DrawPower(&draws);
  if (limits.kinds < DrawKinds::kAll) return draws;
  DrawClocks(&draws);
  if (limits.faults) DrawHostAlone(&draws);
  return draws;
}

std::string Describe(const Draws& draws) {
  std::string text = fmt::format(
      "seed {}: {} units, {} a bus, {:.0f} s, commit {:.1f} ms, plan {:.0f} ms, turn {:.2f} ms, "
      "requests every {:.1f} s{}; armed:",
      draws.seed, draws.units, draws.units_per_bus, 1e-9 * static_cast<double>(draws.safety.ns),
      1e-6 * static_cast<double>(draws.commit.ns), 1e-6 * static_cast<double>(draws.plan.ns),
      1e-6 * static_cast<double>(draws.turn.ns), 1e-9 * static_cast<double>(draws.idle.ns),
      std::string(draws.camera ? ", camera" : "") +
          (draws.rail_motors > 0 ? fmt::format(", {} motors a rail", draws.rail_motors) : "") +
          (draws.kernel_stamps ? "" : ", stamps of the reading") +
          fmt::format(", clocks off by up to {:.2f} %", 100 * draws.clock_error_max) +
          (draws.host_alone ? ", the host alone fails" : ""));
  bool any = false;
  for (std::size_t site = 0; site < kFaultSites; ++site) {
    if (!draws.armed[site]) continue;
    text += fmt::format(" {}", kFaultSiteNames[site]);
    any = true;
  }
  return any ? text : text + " none";
}

}  // namespace focalfleet::soak
