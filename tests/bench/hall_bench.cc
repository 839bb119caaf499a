// Orientations a CPU second, one core: least squares over eight sensors from a start 0.5 deg off
// (what following a moving joint needs), for each model; and from nothing, over the atlas.
//   hall_bench [--estimates 200000] [--rows 500]
#include <cstdio>
#include <ctime>
#include <vector>

#include "sim/hall/field_fit.h"
#include "sim/hall/magnet_array.h"
#include "sim/hall/orient.h"
#include "tests/bench/options.h"

namespace {

using namespace focalfleet;  // NOLINT(google-build-using-namespace): the whole file is one bench

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

}  // namespace

int main(int argc, char** argv) {
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
  std::printf("%-10s %22s %8s %18s\n", "model", "followed, 1/CPU s", "steps",
              "from nothing, 1/CPU s");
  bool good = true;
  for (const sim::FieldKind kind : sim::kFieldKinds) {
    const auto fit = sim::FitField(map, kind);
    if (!fit) return 1;
    sim::HallRig rig;
    rig.electronics.clips = false;
    const sim::OrientationSolver solver(rig, sim::MakeField(fit->parameters));
    const Load load = MakeLoad(solver);
    double begin = CpuSeconds();
    long steps = 0;
    for (int k = 0; k < estimates; ++k) {
      const auto at = static_cast<std::size_t>(k) % load.readings.size();
      const sim::OrientationFit found = solver.Refine(load.readings[at], load.starts[at]);
      steps += found.steps;
      good = good && found.converged;
    }
    const double followed = estimates / (CpuSeconds() - begin);
    begin = CpuSeconds();
    for (int k = 0; k < rows; ++k)
      good = !solver.Solve(load.readings[static_cast<std::size_t>(k) % 1024]).empty() && good;
    const double found = rows / (CpuSeconds() - begin);
    std::printf("%-10s %22.0f %8.2f %18.0f\n", std::string(sim::Name(kind)).c_str(), followed,
                static_cast<double>(steps) / estimates, found);
  }
  return good ? 0 : 1;
}
