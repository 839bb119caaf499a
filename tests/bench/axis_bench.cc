// This bench measures how many simulated axis-seconds fit into a second of CPU time. A single run
// covers the fleet's axes (closed form, read at a fixed rate), the reduced drive (stepped) and the
// drive at PWM level. The bench prints simulated seconds a CPU second, bytes an axis, and how both
// grow with the number.
//   axis_bench [--axes 10000] [--seconds 20] [--hz 20]
#include <malloc.h>

#include <cmath>
#include <cstdio>
#include <ctime>
#include <vector>

#include "sim/drive/reduced_drive.h"
#include "sim/drive/steady.h"
#include "sim/world/axis/axis.h"
#include "tests/bench/options.h"

namespace focalfleet {
namespace {

using bench::Option;

double CpuSeconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

struct Outcome {
  double simulated_per_cpu = 0;
  double bytes_per_axis = 0;
};

// Runs back-and-forth moves of three segments, each axis begun at another time, all read at `hz`.
Outcome RunAxes(const sim::Motor& motor, int count, int seconds, int hz) {
  const std::size_t before = mallinfo2().uordblks;
  std::vector<sim::AxisModel> axes;
  axes.reserve(static_cast<std::size_t>(count));
  sim::AxisTraits traits;
  traits.gear = 892;
  traits.backlash_deg = 1.5;
  for (int k = 0; k < count; ++k) {
    axes.emplace_back(traits, &motor, sim::AxisModel::Start{0, 96, 892});
    axes.back().Energise({0, 96});
  }
  const std::size_t after = mallinfo2().uordblks;

  const double begin = CpuSeconds();
  double sum = 0;
  std::vector<std::int32_t> at(axes.size(), 0);
  std::vector<HostInstant> free(axes.size());
  for (std::size_t k = 0; k < axes.size(); ++k)
    free[k] = {static_cast<std::int64_t>(k % 1000) * 1'000'000};
  for (int tick = 0; tick < seconds * hz; ++tick) {
    const HostInstant now{static_cast<std::int64_t>(tick) * 1'000'000'000 / hz};
    for (std::size_t k = 0; k < axes.size(); ++k) {
      if (now >= free[k]) {
        const std::int32_t way = at[k] > 0 ? -6000 : 6000;
        const Segment segments[] = {
            {0, way / 3, 108}, {8'000, way / 3, 37}, {16'000, way - 2 * (way / 3), 108}};
        const sim::FieldPath path({at[k], now, {1.0}, 500}, segments);
        axes[k].Run(path);
        at[k] = path.to();
        free[k] = path.end();
      }
      sum += axes[k].AngleDeg(now);
    }
  }
  const double cpu_s = CpuSeconds() - begin;
  if (std::isnan(sum)) std::printf("impossible\n");  // keeps the loop alive
  return {seconds / cpu_s, static_cast<double>(after - before) / count};
}

int Main(int argc, char** argv) {
  const int count = Option(argc, argv, "--axes", 10'000);
  const int seconds = Option(argc, argv, "--seconds", 20);
  const int hz = Option(argc, argv, "--hz", 20);
  const sim::Motor motor({}, {});

  std::printf("%8s %26s %12s\n", "axes", "simulated s per CPU s", "bytes/axis");
  std::vector<Outcome> outcomes;
  const int sizes[] = {count / 10, count / 4, count / 2, count, 2 * count};
  for (const int size : sizes) {
    std::vector<double> rates;
    for (int run = 0; run < 5; ++run) {
      outcomes.push_back(RunAxes(motor, size, seconds, hz));
      rates.push_back(outcomes.back().simulated_per_cpu);
      if (run < 4) outcomes.pop_back();
    }
    outcomes.back().simulated_per_cpu = focalfleet::bench::Median(rates);
    std::printf("%8d %26.1f %12.0f\n", size, outcomes.back().simulated_per_cpu,
                outcomes.back().bytes_per_axis);
  }
  // CPU time for a simulated second ~ axes^p.
  const double growth =
      std::log(outcomes.front().simulated_per_cpu / outcomes.back().simulated_per_cpu) /
      std::log(20.0);
  std::printf("CPU time grows as axes^%.2f from %d to %d, memory as axes^%.2f\n", growth, sizes[0],
              sizes[4],
              1 + std::log(outcomes.back().bytes_per_axis / outcomes.front().bytes_per_axis) /
                      std::log(20.0));

  const sim::Modulation modulation{};
  const int turns = std::max(1, seconds);
  sim::ReducedDrive reduced({}, modulation);
  reduced.Place(-0.3, 0);
  double begin = CpuSeconds();
  reduced.RunVectors(0, turns * 96);
  std::printf("one reduced drive (stepped): %.1f motor seconds per CPU second\n",
              reduced.t_s() / (CpuSeconds() - begin));
  sim::Drive drive({});
  drive.Place(-0.3, 0);
  const auto table = sim::VectorTable(modulation);
  begin = CpuSeconds();
  sim::RunVectors(&drive, modulation, table, 0, turns * 96);
  std::printf("one drive at PWM level:      %.2f motor seconds per CPU second\n",
              drive.t_s() / (CpuSeconds() - begin));
  return 0;
}

}  // namespace
}  // namespace focalfleet

int main(int argc, char** argv) { return focalfleet::Main(argc, argv); }
