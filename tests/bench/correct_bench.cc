// correct_bench prints how far fibres are from their targets before and after each correction, in a
// simulated fleet with the spread of units in service. The first configuration finds where units
// stand at all (zero angles); the second is reported.
//   correct_bench [--units N] [--seed S] [--noise-um U] [--corrections C] [--tolerance-um T]
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <string>
#include <vector>

#include "daemon/ports/simulated_port.h"
#include "fleet/kinematics.h"
#include "fleet/plan/planner.h"
#include "fleet/targets.h"
#include "protocol/base/check.h"
#include "sim/world/spread.h"
#include "tests/scenario/in_process_fleet.h"

namespace focalfleet {
namespace {

using test::InProcessFleet;

struct BenchOptions {
  std::uint32_t units = 1000;
  std::uint64_t seed = 1;
  double noise_um = 2;
  std::uint8_t corrections = 2;
  double tolerance_um = 10;
};

/// The units that are neither dead nor slipping nor off scale, by the traits that the simulation
/// drew.
std::vector<bool> HealthyUnits(const Layout& layout, std::uint64_t seed) {
  std::vector<bool> healthy;
  const auto described = DescribeUnits(layout);
  for (std::size_t n = 0; n < layout.size(); ++n) {
    const sim::UnitTraits traits =
        sim::DrawTraits(described[n], {.seed = seed, .spread = sim::Spread::kReal});
    bool good = true;
    for (const Axis axis : kAxes) {
      const sim::AxisTraits& drawn = traits.axis[Index(axis)];
      const double scale = drawn.gear / layout.units()[n].axis[Index(axis)].gear;
      good &= drawn.grip == 1 && std::abs(scale - 1) < 0.015;
    }
    healthy.push_back(good);
  }
  return healthy;
}

double TrueErrorUm(InProcessFleet* fleet, std::uint32_t n) {
  const UnitView& view = fleet->coordinator().unit({n});
  const PointFp wanted = FibreAt(fleet->layout().units()[n], UnitDrive{}, *view.target);
  const sim::UnitTruth truth = fleet->world().Truth(n);
  return 1e3 * std::hypot(truth.x_mm - wanted.x_mm, truth.y_mm - wanted.y_mm);
}

void Print(const char* when, std::vector<double> errors_um) {
  if (errors_um.empty()) return;
  std::sort(errors_um.begin(), errors_um.end());
  double sum = 0;
  double within = 0;
  double beyond = 0;
  for (const double um : errors_um) {
    sum += um * um;
    within += um <= 10 ? 1 : 0;
    beyond += um > 200 ? 1 : 0;
  }
  const auto count = static_cast<double>(errors_um.size());
  const auto at = [&](double share) {
    return errors_um[static_cast<std::size_t>(share * (count - 1))];
  };
  std::printf(
      "%-28s %5.0f units: rms %7.2f um, median %6.2f, 95 %% %7.2f, 99.5 %% %8.2f, worst %8.1f; "
      "within 10 um %6.2f %%, beyond 200 um %5.2f %%\n",
      when, count, std::sqrt(sum / count), at(0.5), at(0.95), at(0.995), errors_um.back(),
      100 * within / count, 100 * beyond / count);
}

// No operator assigns a fibre to the very rim of what its unit reaches by its description. With the
// arms of a fleet in service (57 um each) one in two units would not get there.
constexpr double kRimMm = 0.25;
constexpr double kRangeMarginDeg = 3;  // that the next exposure may take from the range of phi
constexpr double kGoneMm = 1;  // a unit farther off after a correction is taken out of service

bool IsGone(const UnitView& view) { return !view.error_um || *view.error_um > 1e3 * kGoneMm; }

/// True where the unit's own count, which differs from its position, allows the pose; theta has
/// another turn.
bool HoldsInRange(const UnitView& view, const Unit& unit, const Pose& pose) {
  const std::int32_t margin = NearestVectors(kRangeMarginDeg, unit.phi(), AxisDrive{});
  const VectorRange range = RangeOf(unit.phi(), AxisDrive{});
  const std::int32_t count = pose[1] - view.offset[1];
  return count >= range.low + margin && count <= range.high - margin &&
         InRange(unit, UnitDrive{}, {pose[0] - view.offset[0], count});
}

/// Drops targets without a way, by a plan made beforehand. False: every target has a way.
bool DropThoseWithoutWay(InProcessFleet& fleet, std::vector<std::optional<Pose>>* targets) {
  std::vector<UnitKnowledge> start;
  std::vector<Pose> offsets;
  std::vector<std::uint8_t> frozen;
  std::vector<std::optional<Pose>> asked = *targets;
  for (std::uint32_t n = 0; n < targets->size(); ++n) {
    const UnitView& view = fleet.coordinator().unit({n});
    start.push_back(view.knowledge);
    offsets.push_back(view.offset);
    frozen.push_back(IsGone(view) ? 1 : 0);
    if (frozen[n] != 0) asked[n].reset();
  }
  const auto plan = MakePlan({.layout = &fleet.layout(),
                              .drives = fleet.coordinator().drives(),
                              .start = start,
                              .targets = asked,
                              .frozen = frozen,
                              .offsets = offsets},
                             {.lead_apart = true});
  if (!plan) std::fprintf(stderr, "%s\n", plan.error().text.c_str());
  FOCALFLEET_CHECK(plan.has_value());
  for (const Unserved& unserved : plan->unserved) (*targets)[unserved.unit.value].reset();
  return !plan->unserved.empty();
}

/// Targets as an operator would choose them: not at the rim, and none without a way in a plan made
/// beforehand. Units that the configuration before has shown to be out of order are disabled, and
/// the targets keep clear of them.
std::vector<std::optional<Pose>> OperatorsTargets(InProcessFleet* fleet, std::uint64_t seed) {
  const Layout& layout = fleet->layout();
  const std::vector<UnitDrive> drives(layout.size());
  std::vector<std::optional<Pose>> gone(layout.size());
  EnableCommand disable{.units = {}, .enabled = false, .reason = "does not follow"};
  for (std::uint32_t n = 0; n < layout.size(); ++n) {
    const UnitView& view = fleet->coordinator().unit({n});
    if (!IsGone(view)) continue;
    gone[n] = PlaceOf(view.knowledge);
    disable.units.push_back({n});
  }
  std::printf("%zu units are out of order\n", disable.units.size());
  fleet->Send({0, std::move(disable)});
  std::vector<std::optional<Pose>> targets = gone;
  for (std::uint64_t k = 0; k < 60; ++k) {
    const auto drawn = DrawConfiguration(layout, drives, targets, Rng::Stream(seed, "targets", k));
    FOCALFLEET_CHECK(drawn.has_value());
    bool again = false;
    for (std::uint32_t n = 0; n < layout.size(); ++n) {
      if (targets[n]) continue;
      const Unit& unit = layout.units()[n];
      const PatrolLimits patrol = PatrolOf(unit);
      const double r = DistanceMm(unit.base_fp, FibreAt(unit, drives[n], (*drawn)[n]));
      const bool at_rim = r > patrol.max_mm - kRimMm || r < patrol.min_mm + kRimMm;
      if (!at_rim && HoldsInRange(fleet->coordinator().unit({n}), unit, (*drawn)[n]))
        targets[n] = (*drawn)[n];
      again |= !targets[n];
    }
    if (!again && !DropThoseWithoutWay(*fleet, &targets)) break;
  }
  for (std::uint32_t n = 0; n < layout.size(); ++n)
    if (gone[n]) targets[n].reset();
  return targets;
}

/// The reason why a unit is not at its target, without its own numbers.
std::string ReasonOf(const UnitView& view) {
  const std::size_t colon = view.outcome_reason.find(": ");
  if (view.outcome == TargetOutcome::kArrived) return "arrived, beyond it by the centroid's error";
  if (view.outcome_reason.find("from its target") == std::string::npos ||
      colon != std::string::npos)
    return view.outcome_reason.substr(colon == std::string::npos ? 0 : colon + 2);
  return "not converged";
}

void PrintReasons(InProcessFleet* fleet, const std::vector<bool>& healthy,
                  const std::vector<std::vector<double>>& history) {
  std::map<std::string, int> reasons;
  for (std::uint32_t n = 0; n < fleet->layout().size(); ++n) {
    const UnitView& view = fleet->coordinator().unit({n});
    if (!healthy[n] || !view.target || TrueErrorUm(fleet, n) <= 10) continue;
    const std::string reason = ReasonOf(view);
    ++reasons[reason];
    std::printf("  unit %u, phi %.1f deg:", fleet->layout().units()[n].id.value,
                AnglesOf(fleet->layout().units()[n], UnitDrive{}, *view.target).phi_deg);
    for (const double um : history[n]) std::printf(" %.1f um", um);
    std::printf(": %s\n", reason.c_str());
  }
  for (const auto& [reason, count] : reasons)
    std::printf("healthy and beyond 10 um: %d %s\n", count, reason.c_str());
}

int Run(const BenchOptions& options) {
  CoordinatorConfig config;
  config.has_camera = true;
  InProcessFleet fleet({.count = options.units,
                        .units_per_bus = 100,
                        .seed = options.seed,
                        .config = config,
                        .spread = sim::Spread::kReal,
                        .centroid_sigma_um = options.noise_um});
  const std::vector<bool> healthy = HealthyUnits(fleet.layout(), options.seed);
  const ApplyCommand::Measure measure{.corrections = options.corrections,
                                      .tolerance_um = options.tolerance_um};
  fleet.ApplyRandomMeasured(options.seed, {.corrections = 1, .tolerance_um = options.tolerance_um});
  if (!fleet.RunUntilIdle()) return 1;
  std::printf("%u units, seed %llu, centroids of %.1f um\n", options.units,
              static_cast<unsigned long long>(options.seed), options.noise_um);
  int exposure = 0;
  std::vector<std::vector<double>> history(options.units);
  std::size_t alarms = fleet.store().alarms.size();
  HostInstant since = fleet.now();
  fleet.camera.fault = [&](ExposureDone*) {
    for (; alarms < fleet.store().alarms.size(); ++alarms)
      if (!fleet.store().alarms[alarms].unit)
        std::printf("  %s\n", fleet.store().alarms[alarms].text.c_str());
    std::printf("after %.0f s\n", (fleet.now() - since).seconds());
    std::vector<double> all;
    std::vector<double> good;
    for (std::uint32_t n = 0; n < fleet.layout().size(); ++n) {
      if (!fleet.coordinator().unit({n}).target) continue;
      all.push_back(TrueErrorUm(&fleet, n));
      history[n].push_back(all.back());
      if (healthy[n]) good.push_back(all.back());
    }
    char when[64];
    std::snprintf(when, sizeof when, exposure == 0 ? "blind" : "after correction %d", exposure);
    ++exposure;
    Print(when, all);
    Print("  healthy ones", good);
  };
  fleet.ApplyMeasured(OperatorsTargets(&fleet, options.seed + 1000), measure);
  if (!fleet.RunUntilIdle()) return 1;
  PrintReasons(&fleet, healthy, history);
  return 0;
}

}  // namespace
}  // namespace focalfleet

int main(int count, char** arguments) {
  focalfleet::BenchOptions options;
  for (int i = 1; i + 1 < count; i += 2) {
    const char* value = arguments[i + 1];
    if (std::strcmp(arguments[i], "--units") == 0) {
      options.units = static_cast<std::uint32_t>(std::atoi(value));
    } else if (std::strcmp(arguments[i], "--seed") == 0) {
      options.seed = static_cast<std::uint64_t>(std::atoll(value));
    } else if (std::strcmp(arguments[i], "--noise-um") == 0) {
      options.noise_um = std::atof(value);
    } else if (std::strcmp(arguments[i], "--tolerance-um") == 0) {
      options.tolerance_um = std::atof(value);
    } else if (std::strcmp(arguments[i], "--corrections") == 0) {
      options.corrections = static_cast<std::uint8_t>(std::atoi(value));
    } else {
      std::fprintf(stderr, "correct_bench: unknown option %s\n", arguments[i]);
      return 2;
    }
  }
  return focalfleet::Run(options);
}
