// This bench measures orientations a CPU second on one core, for each model. The first case is
// least squares over eight sensors from a start 0.5 deg off, as when following a moving joint. The
// second has no start and searches the atlas.
//   hall_bench [--estimates 200000] [--rows 500]
#include <cstdio>
#include <ctime>
#include <vector>

#include "sim/hall/field_fit.h"
#include "sim/hall/magnet_array.h"
#include "sim/hall/orient.h"
#include "tests/bench/options.h"

namespace focalfleet {
namespace {

double CpuSeconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

struct Load {
  std::vector<sim::HallReading> readings;
  std::vector<sim::Orientation> starts;
};

Load MakeLoad(const sim::OrientationSolver& solver) {
  Load load;
  Rng rng(1);
  for (int k = 0; k < 1024; ++k) {
    sim::Orientation pose{rng.Uniform(-0.2, 0.2), rng.Uniform(-0.2, 0.2), rng.Uniform(-0.7, 0.7)};
    std::vector<double> b_T(8);
    solver.Predict(pose, b_T);
    sim::HallReading reading;
    for (std::size_t s = 0; s < 8; ++s) reading.b_T[s] = b_T[s] + 5e-4 * rng.Normal();
    reading.used = 0xff;
    load.readings.push_back(reading);
    pose.alpha_rad += 0.009 * rng.Normal();
    pose.beta_rad += 0.009 * rng.Normal();
    pose.gamma_rad += 0.009 * rng.Normal();
    load.starts.push_back(pose);
  }
  return load;
}

struct Rate {
  double per_s = 0;
  double steps = 0;
  bool good = true;
};
Rate Follow(const sim::OrientationSolver& solver, const Load& load, int estimates) {
  Rate rate;
  long steps = 0;
  const double begin = CpuSeconds();
  for (int k = 0; k < estimates; ++k) {
    const auto at = static_cast<std::size_t>(k) % load.readings.size();
    const sim::OrientationFit found = solver.Refine(load.readings[at], load.starts[at]);
    steps += found.steps;
    rate.good = rate.good && found.converged;
  }
  rate.per_s = estimates / (CpuSeconds() - begin);
  rate.steps = static_cast<double>(steps) / estimates;
  return rate;
}

int Main(int argc, char** argv) {
  const int estimates = bench::Option(argc, argv, "--estimates", 200'000);
  const int rows = bench::Option(argc, argv, "--rows", 500);
  const sim::MagnetArray magnets(sim::OneShellArray(), 8);
  sim::FieldMap map;
  for (int theta = 0; theta <= 180; theta += 6)
    for (int phi = 0; phi < 360; phi += 6) {
      const double theta_rad = theta * sim::kRadPerDeg, phi_rad = phi * sim::kRadPerDeg;
      map.push_back(
          {theta_rad, phi_rad, magnets.Radial_T(sim::DirectionAt(theta_rad, phi_rad), 59)});
    }
  std::printf("%-10s %16s %16s %8s %16s\n", "1/CPU s", "followed", "to all digits", "steps",
              "from nothing");
  bool good = true;
  for (const sim::FieldKind kind : sim::kFieldKinds) {
    const auto fit = sim::FitField(map, kind);
    if (!fit) return 1;
    sim::HallRig rig;
    rig.electronics.clips = false;
    const std::shared_ptr<const sim::FieldModel> field = sim::MakeField(fit->parameters);
    const sim::OrientationSolver solver(rig, field);
    const sim::OrientationSolver quick(rig, field, {.last_step_rad = 1e-3});
    const Load load = MakeLoad(solver);
    const Rate quickly = Follow(quick, load, estimates);
    const Rate exactly = Follow(solver, load, estimates);
    const double begin = CpuSeconds();
    for (int k = 0; k < rows; ++k)
      good = !solver.Solve(load.readings[static_cast<std::size_t>(k) % 1024]).empty() && good;
    const double found = rows / (CpuSeconds() - begin);
    good = good && quickly.good && exactly.good;
    std::printf("%-10s %16.0f %16.0f %8.2f %16.0f\n", std::string(sim::Name(kind)).c_str(),
                quickly.per_s, exactly.per_s, exactly.steps, found);
  }
  return good ? 0 : 1;
}

}  // namespace
}  // namespace focalfleet

int main(int argc, char** argv) { return focalfleet::Main(argc, argv); }
