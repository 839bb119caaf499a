// This bench compares the currents of sim/drive with ngspice's, and the cost of a motor-second in
// both. The netlist (spice_netlist.h) takes settings and nothing that sim computed; both start with
// the same rotor and no current. A sample counts unless it lies within a rise time of the middle of
// an edge. The bench is skipped (77) where there is no ngspice.
//   spice_bench [--case -1] [--periods 20] [--vectors 0] [--rise-ns 10] [--sample-ns 100]
//               [--step-ns 40] [--keep 0] [--check 0] [--ratio-min 50]
//   --case     0 to 5: asymmetric, five- and seven-segment at 1.8 V, then at 9 V; -1: all
//   --vectors  this many vectors instead of whole electrical periods
//   --rise-ns  of a leg, and its fall; the dead time is 50 ns
//   --step-ns  ngspice's longest step; shorter than a sample's
//   --keep     1: leaves netlist and output behind
//   --check    1: exit code 1 if a current is off by over 0.1 % of the peak, or ngspice's CPU time
//              is less than --ratio-min times that of sim
#include <fcntl.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <fstream>
#include <numbers>
#include <string>
#include <vector>

#include "sim/drive/drive.h"
#include "sim/drive/steady.h"
#include "tests/bench/options.h"
#include "tests/bench/spice_netlist.h"
#include "tests/support/scratch_folder.h"

extern char** environ;

namespace focalfleet::sim {
namespace {

using bench::Option;
using bench::SpiceCase;
using bench::SpiceRow;

constexpr double kDifferenceMax = 1e-3;  // of the peak
constexpr int kSkipped = 77;

// The paper's motor without its gears, in step from the start. At 9 V the case is its bench point
// (set 9). At 1.8 V it is three times the speed of its critical n, so that 20 turns stay affordable
// (set C).
std::vector<SpiceCase> Cases() {
  const SpiceCase both{.clock_Hz = 144e6,
                       .counter1 = 500,
                       .subdivision = 96,
                       .dead_time_s = 50e-9,
                       .resistance_ohm = 14.85,
                       .inductance_H = 37e-6,
                       .inertia_kg_m2 = 8.7e-11,
                       .load_Nm = 1e-6};
  std::vector<SpiceCase> cases;
  for (const bool high : {false, true}) {
    for (const WaveMode mode :
         {WaveMode::kAsymmetric, WaveMode::kFiveSegment, WaveMode::kSevenSegment}) {
      SpiceCase s = both;
      s.mode = mode;
      s.v_bus_V = high ? 9 : 1.8;
      s.repeat = high ? 8 : 12;
      s.flux_Wb = high ? 0.3e-3 : 0.15e-3;
      s.viscous_Nms = high ? 2e-8 : 0;
      s.angle_rad = high ? -0.45 : -0.3;
      s.speed_rad_per_s = 2 * std::numbers::pi * s.clock_Hz / s.counter1 / s.repeat / s.subdivision;
      cases.push_back(s);
    }
  }
  return cases;
}

double Seconds(const timeval& time) {
  return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
}

/// CPU time of ngspice on `folder`/motor.cir; below 0: failed, or -kSkipped: there is no ngspice.
double RunSpice(const std::string& folder) {
  const std::string log = folder + "/motor.log";
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addchdir_np(&actions, folder.c_str());
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, log.c_str(),
                                   O_WRONLY | O_CREAT | O_TRUNC, 0644);
  posix_spawn_file_actions_adddup2(&actions, STDOUT_FILENO, STDERR_FILENO);
  std::vector<std::string> words = {"ngspice", "-b", "motor.cir"};
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  pid_t child = 0;
  const int error = posix_spawnp(&child, "ngspice", &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) {
    std::fprintf(stderr, "no ngspice: %s\n", std::strerror(error));
    return -kSkipped;
  }
  int status = 0;
  rusage usage{};
  if (wait4(child, &status, 0, &usage) != child || status != 0) {
    std::fprintf(stderr, "ngspice failed with status %d:\n", status);
    std::ifstream in(log);
    for (std::string line; std::getline(in, line);) std::fprintf(stderr, "  %s\n", line.c_str());
    return -1;
  }
  return Seconds(usage.ru_utime) + Seconds(usage.ru_stime);
}

struct Ours {
  std::vector<DriveSample> samples;
  double cpu_s = 0;
};

Ours RunOurs(const SpiceCase& s, int vectors) {
  const Drive::Setting setting{.motor = {.resistance_ohm = s.resistance_ohm,
                                         .inductance_H = s.inductance_H,
                                         .flux_linkage_Wb = s.flux_Wb,
                                         .inertia_kg_m2 = s.inertia_kg_m2,
                                         .viscous_Nms = s.viscous_Nms,
                                         .load_Nm = s.load_Nm,
                                         .load_variation = 0},
                               .gearhead = {},
                               .bridge = {.v_bus_V = s.v_bus_V,
                                          .rise_s = s.rise_s,
                                          .fall_s = s.rise_s,
                                          .dead_time_s = s.dead_time_s}};
  const Modulation modulation{.clock_Hz = s.clock_Hz,
                              .counter1 = s.counter1,
                              .repeat = s.repeat,
                              .subdivision = s.subdivision,
                              .mode = s.mode};
  Ours ours;
  ours.samples.reserve(static_cast<std::size_t>(s.duration_s / s.sample_s) + 2);
  const std::clock_t began = std::clock();
  Drive drive(setting);
  drive.Place(s.angle_rad, s.speed_rad_per_s);
  drive.Probe(s.sample_s, [&](const DriveSample& sample) { ours.samples.push_back(sample); });
  RunVectors(&drive, modulation, VectorTable(modulation), 0, vectors);
  ours.cpu_s = static_cast<double>(std::clock() - began) / CLOCKS_PER_SEC;
  return ours;
}

// True where a leg begins to change so near the sample that its value is undefined.
bool NearEdge(const SpiceCase& s, double t_s) {
  const double period_s = s.counter1 / s.clock_Hz;
  const auto carrier = static_cast<long>(t_s / period_s);
  const auto beside = [&](double edge_s) {
    return std::abs(t_s - edge_s - s.rise_s / 2) <= s.rise_s ||
           std::abs(t_s - edge_s - s.dead_time_s - s.rise_s / 2) <= s.rise_s;
  };
  for (long k = std::max(0L, carrier - 1); k <= carrier + 1; ++k) {
    const auto vector = static_cast<int>(k / s.repeat % s.subdivision);
    for (const bench::CompareValues& leg : bench::CompareValuesOf(s, vector)) {
      const double begin_s = static_cast<double>(k) * period_s;
      if (beside(begin_s + leg.on / s.clock_Hz) || beside(begin_s + leg.off / s.clock_Hz))
        return true;
    }
  }
  return false;
}

struct Difference {
  double peak_A = 0;
  double largest_A = 0;
  double largest_t_s = 0;
  std::size_t largest_phase = 0;
  double square_A2 = 0;
  double anywhere_A = 0;  // beside edges, too
  double angle_rad = 0;
  std::size_t compared = 0;
  std::size_t beside_edges = 0;
};

// Row k of both is the same instant of the motor.
Difference Compare(const SpiceCase& s, const std::vector<DriveSample>& ours,
                   const std::vector<SpiceRow>& theirs) {
  Difference d;
  const std::size_t count = std::min(ours.size(), theirs.size());
  for (std::size_t k = 0; k < count; ++k) {
    const bool beside = NearEdge(s, ours[k].t_s);
    ++(beside ? d.beside_edges : d.compared);
    for (std::size_t x = 0; x < kLegCount; ++x) {
      const double off = std::abs(ours[k].current_A[x] - theirs[k].current_A[x]);
      d.peak_A = std::max(d.peak_A, std::abs(theirs[k].current_A[x]));
      d.anywhere_A = std::max(d.anywhere_A, off);
      if (beside) continue;
      d.square_A2 += off * off;
      if (off <= d.largest_A) continue;
      d.largest_A = off;
      d.largest_t_s = ours[k].t_s;
      d.largest_phase = x;
    }
    d.angle_rad = std::max(d.angle_rad, std::abs(ours[k].angle_rad - theirs[k].angle_rad));
  }
  d.square_A2 /= static_cast<double>(kLegCount * std::max<std::size_t>(d.compared, 1));
  return d;
}

struct Load {
  int periods = 20;
  int vectors = 0;
  double sample_s = 0;
  double step_s = 0;
  double rise_s = 0;
  bool check = false;
  int ratio_min = 0;
};

/// Runs the case and returns its exit code.
int Run(SpiceCase s, const Load& load, const std::string& folder) {
  const int vectors = load.vectors > 0 ? load.vectors : load.periods * s.subdivision;
  s.duration_s = vectors * s.repeat * s.counter1 / s.clock_Hz;
  s.sample_s = load.sample_s;
  s.step_max_s = load.step_s;
  s.rise_s = load.rise_s;
  std::ofstream(folder + "/references.txt") << References(s);
  std::ofstream(folder + "/motor.cir") << Netlist(s);
  const double theirs_cpu_s = RunSpice(folder);
  if (theirs_cpu_s < 0) return theirs_cpu_s == -kSkipped ? kSkipped : 1;
  const std::vector<SpiceRow> theirs = bench::ReadRaw(folder + "/motor.raw");
  const Ours ours = RunOurs(s, vectors);
  const auto wanted = static_cast<std::size_t>(s.duration_s / s.sample_s);
  if (theirs.size() < wanted || std::abs(theirs[0].t_s / s.sample_s - 1) > 1e-6 ||
      ours.samples.size() < wanted) {
    std::fprintf(stderr, "of %zu samples ngspice gave %zu, we %zu\n", wanted, theirs.size(),
                 ours.samples.size());
    return 1;
  }
  const Difference d = Compare(s, ours.samples, theirs);
  const double carrier_s = s.counter1 / s.clock_Hz;
  const double ratio = theirs_cpu_s / ours.cpu_s;
  std::printf(
      "%s, %.1f V, n = %d, %d vectors (%.2f ms): peak %.3f mA; largest difference %.4f %% of it "
      "(phase %c, carrier %.0f, %.0f ns into it), rms %.4f %%, beside edges %.4f %%; angle %.2e "
      "rad; %zu samples and %zu beside edges; motor-seconds a CPU second: ngspice %.3e, ours "
      "%.3e, ratio %.0f\n",
      Name(s.mode), s.v_bus_V, s.repeat, vectors, 1e3 * s.duration_s, 1e3 * d.peak_A,
      100 * d.largest_A / d.peak_A, static_cast<char>('a' + d.largest_phase),
      std::floor(d.largest_t_s / carrier_s), 1e9 * std::fmod(d.largest_t_s, carrier_s),
      100 * std::sqrt(d.square_A2) / d.peak_A, 100 * d.anywhere_A / d.peak_A, d.angle_rad,
      d.compared, d.beside_edges, s.duration_s / theirs_cpu_s, s.duration_s / ours.cpu_s, ratio);
  std::fflush(stdout);
  const bool holds = d.largest_A <= kDifferenceMax * d.peak_A && ratio >= load.ratio_min;
  return load.check && !holds ? 1 : 0;
}

}  // namespace
}  // namespace focalfleet::sim

int main(int argc, char** argv) {
  using focalfleet::bench::Option;
  const int chosen = Option(argc, argv, "--case", -1);
  const focalfleet::sim::Load load{.periods = Option(argc, argv, "--periods", 20),
                                   .vectors = Option(argc, argv, "--vectors", 0),
                                   .sample_s = 1e-9 * Option(argc, argv, "--sample-ns", 100),
                                   .step_s = 1e-9 * Option(argc, argv, "--step-ns", 40),
                                   .rise_s = 1e-9 * Option(argc, argv, "--rise-ns", 10),
                                   .check = Option(argc, argv, "--check", 0) != 0,
                                   .ratio_min = Option(argc, argv, "--ratio-min", 50)};
  focalfleet::test::ScratchFolder folder;
  const std::vector<focalfleet::bench::SpiceCase> cases = focalfleet::sim::Cases();
  int code = 0;
  for (std::size_t k = 0; k < cases.size(); ++k)
    if (chosen < 0 || static_cast<std::size_t>(chosen) == k)
      code = std::max(code, focalfleet::sim::Run(cases[k], load, folder.path()));
  if (Option(argc, argv, "--keep", 0) != 0) {
    std::printf("%s\n", folder.path().c_str());
    folder.Keep();
  }
  return code;
}
