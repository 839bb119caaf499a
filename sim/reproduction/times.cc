// Times, counts and what follows from them, and what the circuit does without a rotor that turns.

#include <cmath>
#include <complex>
#include <numbers>

#include "sim/drive/steady.h"
#include "sim/reproduction/parts.h"

namespace focalfleet::sim::reproduction {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;

// An output turn, from the drive's own clock: an electrical turn is simulated and geared down.
double OutputTurn_s(const ReproduceOptions& options, int repeat) {
  const auto setting = PaperSetting(options, options.wave_set, 1.8);
  const Modulation modulation{.repeat = repeat};
  Drive drive(setting);
  RunVectors(&drive, modulation, VectorTable(modulation), 0, modulation.subdivision);
  return drive.t_s() * setting.gearhead.ratio;
}

Drive::Setting Blocked(Drive::Setting setting) {
  setting.motor.load_Nm = 1;
  setting.motor.load_variation = 0;
  return setting;
}

// Phase current of a blocked rotor under vector 100 for good, after `after_s`.
double StepResponse_A(const Drive::Setting& setting, double after_s) {
  const int counts = 10;
  const Pattern whole{{{0, counts}, {counts, counts}, {counts, counts}}};
  const Modulation modulation{.clock_Hz = counts / after_s, .counter1 = counts};
  Drive drive(Blocked(Ideal(setting)));
  drive.Place(0, 0);
  drive.RunCarrier(whole, modulation);
  return drive.current_A().real();
}

double TimeConstant_s(const Drive::Setting& setting) {
  // Two points of an exponential that begins at 0: (1 - x^2) / (1 - x) = 1 + x.
  const double step_s = 2e-6;
  const double ratio = StepResponse_A(setting, 2 * step_s) / StepResponse_A(setting, step_s) - 1;
  return -step_s / std::log(ratio);
}

double BlockedFundamental_A(const Drive::Setting& setting) {
  // A fine carrier leaves only the fundamental of a table of vectors.
  const Modulation modulation{.counter1 = 120, .repeat = 4};
  Drive drive(Blocked(Ideal(setting)));
  drive.Place(0, 0);
  const auto table = VectorTable(modulation);
  RunVectors(&drive, modulation, table, 0, 96);
  const double begin_s = drive.t_s();
  const double field_Hz = modulation.field_Hz();
  std::complex<double> component;
  drive.Listen([&](const DriveInterval& interval) {
    const std::complex<double> rate(0, -kTurn * field_Hz);
    component += (interval.moments[0] + rate * interval.moments[1]) *
                 std::polar(1.0, -kTurn * field_Hz * (interval.t_s - begin_s));
  });
  RunVectors(&drive, modulation, table, 0, 96);
  return std::abs(component) * field_Hz;
}

// Eq. 12's first term is printed as 3 P / L |flux_s| flux_f sin(delta): over the torque simulated.
double PrintedTorqueFactor(const Drive::Setting& setting) {
  const Modulation modulation{.repeat = 37};
  const auto state = FindSteadyState(setting, modulation, setting.motor.load_Nm);
  if (!state) return std::nan("");
  Drive drive = InSteadyRotation(setting, modulation, *state);
  const std::complex<double> rotor = std::polar(1.0, drive.shaft().angle_rad());
  const MotorParameters& motor = setting.motor;
  const std::complex<double> stator_Wb =
      motor.inductance_H * drive.current_A() + motor.flux_linkage_Wb * rotor;
  const double sine = (stator_Wb * std::conj(rotor)).imag();
  return 3 / motor.inductance_H * motor.flux_linkage_Wb * sine / drive.torque_Nm();
}

}  // namespace

void AddTimes(const ReproduceOptions& options, Reproduction* out) {
  const auto add = [out](Claim claim) { out->claims.push_back(std::move(claim)); };
  const auto within = [&](Claim claim, double tolerance) {
    claim.status = Within(claim, tolerance);
    add(std::move(claim));
  };
  within({.id = "turn_time_n37",
          .text = "time for 360 degrees with the critical n",
          .paper = {11},
          .simulated = {OutputTurn_s(options, 37)},
          .unit = "s",
          .conditions = "V_counter1 500, n 37, 96 vectors, gears 337 and 45/17"},
         0.005);
  within({.id = "turn_time_n108",
          .text = "time for 360 degrees with the final n",
          .paper = {32.1},
          .simulated = {OutputTurn_s(options, 108)},
          .unit = "s",
          .conditions = "V_counter1 500, n 108, 96 vectors, gears 337 and 45/17"},
         0.005);
  {
    Claim claim{.id = "turn_time_window",
                .text = "a whole turn takes 10 to 40 s",
                .paper = {10, 40},
                .simulated = {OutputTurn_s(options, 37), OutputTurn_s(options, 108)},
                .unit = "s",
                .conditions = "n 37 and n 108"};
    const bool inside = claim.simulated.front() > 10 && claim.simulated.back() < 40;
    claim.status = inside ? ClaimStatus::kReproduced : ClaimStatus::kDisagrees;
    add(std::move(claim));
  }
  const int counters[] = {2000, 1000, 500, 250};
  Claim carrier{.id = "carrier",
                .text = "carrier frequency",
                .paper = {72, 144, 288, 576},
                .unit = "kHz",
                .conditions = "144 MHz over V_counter1 2000, 1000, 500, 250"};
  Claim equal{.id = "speed_equal",
              .text = "speed is equal in all tests of the carrier",
              .unit = "rpm",
              .conditions = "V_counter1 2000, 1000, 500, 250 with n 2, 4, 8, 16; 96 vectors"};
  for (const int counter1 : counters) {
    const Modulation modulation{.counter1 = counter1, .repeat = 4000 / counter1};
    carrier.simulated.push_back(1e-3 / modulation.carrier_s());
    equal.simulated.push_back(60 * modulation.field_Hz());
  }
  within(std::move(carrier), 1e-9);
  equal.paper.assign(4, 22'500);  // follows from V_counter2 = 4000
  within(std::move(equal), 1e-9);

  const auto nine_V = PaperSetting(options, options.wave_set, 9);
  const auto low_V = PaperSetting(options, options.wave_set, 1.8);
  const double tau_s = TimeConstant_s(nine_V);
  within({.id = "time_constant",
          .text = "electrical time constant of a phase",
          .paper = {2.49158},
          .simulated = {1e6 * tau_s},
          .unit = "us",
          .conditions = "from the step response of a blocked motor"},
         0.005);
  within({.id = "counts_to_0632",
          .text = "timer counts until 0.632 of the steady current",
          .paper = {359},
          .simulated = {tau_s * 144e6},
          .unit = "counts",
          .conditions = "one pulse from zero, 144 MHz"},
         0.005);
  within({.id = "timer_base",
          .text = "base cycle of the timer",
          .paper = {6.94},
          .simulated = {1e9 / Modulation{}.clock_Hz},
          .unit = "ns",
          .conditions = "144 MHz"},
         0.005);
  const Bridge bridge;
  const double lost_s = bridge.rise_s + bridge.fall_s + bridge.dead_time_s;
  within({.id = "dead_counts",
          .text = "rise, fall and dead time in counts and as a share of V_counter1 250 and 500",
          .paper = {10, 4, 2},
          .simulated = {lost_s * 144e6, 100 * lost_s * 144e6 / 250, 100 * lost_s * 144e6 / 500},
          .unit = "counts, %, %",
          .conditions = "10 + 10 + 50 ns"},
         0.02);

  // The paper's "steady" currents are fundamentals; what a phase can reach is 15.5 % more.
  const double reached_9V = 1e3 * StepResponse_A(nine_V, 40 * tau_s);
  const double reached_1V8 = 1e3 * StepResponse_A(low_V, 40 * tau_s);
  const auto steady = [&](const char* id, double printed_mA, const Drive::Setting& setting,
                          double reached_mA) {
    Claim claim{.id = id,
                .text = "no phase current exceeds V_bus / (sqrt3 r)",
                .paper = {printed_mA},
                .simulated = {1e3 * BlockedFundamental_A(setting), reached_mA},
                .unit = "mA",
                .conditions = "blocked motor: largest fundamental; vector 100 held"};
    const bool bound = reached_mA <= printed_mA * 1.005;
    claim.status = bound ? ClaimStatus::kReproduced : ClaimStatus::kDisagrees;
    if (!bound)
      claim.reason =
          "the printed value is the largest fundamental of linear modulation; with a floating star "
          "a phase sees 2/3 V_bus, so its current can reach 2 V_bus / (3 r). That limit is "
          "resistance, not saturation: the winding has no iron";
    add(std::move(claim));
  };
  steady("steady_current_9V", 349.91, nine_V, reached_9V);
  steady("steady_current_1V8", 69.98, low_V, reached_1V8);
  within({.id = "torque_equation",
          .text = "eq. 12 and 13: torque is 3 P / L |flux_s| flux_f sin(delta)",
          .paper = {1},
          .simulated = {PrintedTorqueFactor(low_V)},
          .unit = "printed over simulated",
          .conditions = "1.8 V, n 37, in steady rotation; eq. 9 makes it so for any current",
          .reason = "eqs. 9 to 11 give 3 p / (2 L): as printed the torque is twice too big"},
         0.005);
  {
    // Eq. 4 in all sectors: volt-seconds of every vector against its angle.
    double worst = 0;
    const Modulation modulation{.counter1 = 6000};
    for (int k = 0; k < modulation.subdivision; ++k) {
      const Pattern pattern = PatternOf(modulation, k);
      std::complex<double> sum;
      for (std::size_t leg = 0; leg < kLegCount; ++leg)
        if (!pattern[leg].none())
          sum += 2.0 / 3 * (pattern[leg].off - pattern[leg].on) / modulation.counter1 *
                 std::polar(1.0, kTurn / 3 * static_cast<double>(leg));
      worst = std::max(worst, std::abs(sum - std::polar(1 / std::numbers::sqrt3,
                                                        kTurn * k / modulation.subdivision)));
    }
    add({.id = "eq4",
         .text = "eq. 4 gives the occupation times of the basic vectors",
         .paper = {0},
         .simulated = {worst},
         .unit = "of V_bus",
         .conditions = "largest error of the mean vector over 96 vectors in six sectors",
         .status = worst < 1e-3 ? ClaimStatus::kReproduced : ClaimStatus::kDisagrees});
  }
  Claim fundamental{.id = "fundamental_frequency",
                    .text = "the PWM fundamental frequency is 1 / t_base",
                    .paper = {144},
                    .simulated = {1e-6 / Modulation{}.carrier_s()},
                    .unit = "MHz",
                    .conditions = "V_counter1 500",
                    .reason =
                        "t_base is the timer's count; the carrier that the paper means "
                        "elsewhere is 1 / (V_counter1 t_base)"};
  within(std::move(fundamental), 0.005);
  add({.id = "permeability",
       .text = "the magnet's permeability equals 0, the same as air",
       .unit = "",
       .conditions = "must be mu_r = 1; the model has Ld = Lq",
       .status = ClaimStatus::kNotTestable});
  add({.id = "measuring_accuracy",
       .text = "the microscope measures to 1 um",
       .paper = {1},
       .unit = "um",
       .conditions = "an input",
       .status = ClaimStatus::kNotTestable});
}

}  // namespace focalfleet::sim::reproduction
