// correct_bench: how far fibres are from their targets when they come blind, and after each
// correction, in a simulated fleet with the spread of units in service. The first configuration
// tells where units stand at all (zero angles); the second is what is reported.
//   correct_bench [--units N] [--seed S] [--noise-um U] [--corrections C]
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "daemon/ports/simulated_port.h"
#include "fleet/kinematics.h"
#include "sim/spread.h"
#include "tests/scenario/in_process_fleet.h"

namespace focalfleet::testing {
namespace {

struct BenchOptions {
  std::uint32_t units = 1000;
  std::uint64_t seed = 1;
  double noise_um = 2;
  std::uint8_t corrections = 2;
};

/// Neither dead nor slipping nor off scale, by the traits that the simulation drew.
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
  const ApplyCommand::Measure measure{.corrections = options.corrections, .tolerance_um = 4};
  fleet.ApplyRandomMeasured(options.seed, {.corrections = 1, .tolerance_um = 4});
  if (!fleet.RunUntilIdle()) return 1;
  std::printf("%u units, seed %llu, centroids of %.1f um\n", options.units,
              static_cast<unsigned long long>(options.seed), options.noise_um);
  int exposure = 0;
  fleet.camera_fault = [&](ExposureDone*) {
    std::vector<double> all;
    std::vector<double> good;
    for (std::uint32_t n = 0; n < fleet.layout().size(); ++n) {
      if (!fleet.coordinator().unit({n}).target) continue;
      all.push_back(TrueErrorUm(&fleet, n));
      if (healthy[n]) good.push_back(all.back());
    }
    char when[64];
    std::snprintf(when, sizeof when, exposure == 0 ? "blind" : "after correction %d", exposure);
    ++exposure;
    Print(when, all);
    Print("  healthy ones", good);
  };
  fleet.ApplyRandomMeasured(options.seed + 1000, measure);
  if (!fleet.RunUntilIdle()) return 1;
  for (std::uint32_t n = 0; n < fleet.layout().size(); ++n) {
    const UnitView& view = fleet.coordinator().unit({n});
    if (healthy[n] && view.target && TrueErrorUm(&fleet, n) > 10)
      std::printf("  unit %u: %.1f um: %s\n", fleet.layout().units()[n].id.value,
                  TrueErrorUm(&fleet, n), view.outcome_reason.c_str());
  }
  return 0;
}

}  // namespace
}  // namespace focalfleet::testing

int main(int count, char** arguments) {
  focalfleet::testing::BenchOptions options;
  for (int i = 1; i + 1 < count; i += 2) {
    const char* value = arguments[i + 1];
    if (std::strcmp(arguments[i], "--units") == 0) {
      options.units = static_cast<std::uint32_t>(std::atoi(value));
    } else if (std::strcmp(arguments[i], "--seed") == 0) {
      options.seed = static_cast<std::uint64_t>(std::atoll(value));
    } else if (std::strcmp(arguments[i], "--noise-um") == 0) {
      options.noise_um = std::atof(value);
    } else if (std::strcmp(arguments[i], "--corrections") == 0) {
      options.corrections = static_cast<std::uint8_t>(std::atoi(value));
    } else {
      std::fprintf(stderr, "correct_bench: unknown option %s\n", arguments[i]);
      return 2;
    }
  }
  return focalfleet::testing::Run(options);
}
