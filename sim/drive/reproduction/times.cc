// Times and counts with their consequences, and the circuit without a rotor that turns.

#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

#include "protocol/base/units.h"
#include "sim/drive/reproduction/parts.h"
#include "sim/drive/steady.h"

namespace focalfleet::sim::reproduction {
namespace {

// The duration of an output turn by the drive's own clock: an electrical turn is simulated and
// geared down.
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

// The phase current of a blocked rotor `after_s` after vector 100 is applied for good.
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
  // Two points of an exponential that begins at 0 give (1 - x^2) / (1 - x) = 1 + x.
  const double step_s = 2e-6;
  const double ratio = StepResponse_A(setting, 2 * step_s) / StepResponse_A(setting, step_s) - 1;
  return -step_s / std::log(ratio);
}

// The highest current of a blocked motor under vector 100 for a share of every carrier period. The
// result is relative to the current that the motor reaches when the vector stays. All of it repeats
// by then.
double PulseTrainPeak(const Drive::Setting& setting, int on_counts) {
  const Modulation modulation{};
  const double period = modulation.counter1;
  const Pattern pulses{{{period - on_counts, period}, {period, period}, {period, period}}};
  Drive drive(Blocked(Ideal(setting)));
  drive.Place(0, 0);
  for (int k = 0; k < 40; ++k) drive.RunCarrier(pulses, modulation);
  drive.ResetPeak();
  drive.RunCarrier(pulses, modulation);
  return drive.peak_A() / (2 * setting.bridge.v_bus_V / (3 * setting.motor.resistance_ohm));
}

// The rotor's speed in steady rotation. Its swing within a vector dies out over four turns.
double RotorSpeed_rpm(Drive::Setting setting, const Modulation& modulation, double load_Nm) {
  setting.motor.load_Nm = load_Nm;
  setting.motor.load_variation = 0;
  const auto state = FindSteadyState(setting, modulation, load_Nm);
  if (!state) return std::nan("");
  Drive drive = InSteadyRotation(setting, modulation, *state);
  const std::vector<Pattern> table = VectorTable(modulation);
  const std::int64_t vectors = std::int64_t{4} * modulation.subdivision;
  RunVectors(&drive, modulation, table, 0, vectors);
  const double begin_rad = drive.shaft().angle_rad();
  const double begin_s = drive.t_s();
  RunVectors(&drive, modulation, table, 0, vectors);
  return (drive.shaft().angle_rad() - begin_rad) / kTurnRad / (drive.t_s() - begin_s) * 60;
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
    const std::complex<double> rate(0, -kTurnRad * field_Hz);
    component += (interval.moments[0] + rate * interval.moments[1]) *
                 std::polar(1.0, -kTurnRad * field_Hz * (interval.t_s - begin_s));
  });
  RunVectors(&drive, modulation, table, 0, 96);
  return std::abs(component) * field_Hz;
}

// The first term of eq. 12 is printed as 3 P / L |flux_s| flux_f sin(delta); the factor is over the
// simulated torque.
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

  // Table 2 is known only by its rule, "same speed": V_counter2 = n V_counter1 doubles as the
  // vectors halve.
  Claim vectors{.id = "speed_equal_subdivision",
                .text = "speed is equal in all tests of the subdivision",
                .unit = "rpm",
                .conditions = "96, 48, 24, 12, 6 vectors with V_counter2 4000 to 64000"};
  for (const int subdivision : {96, 48, 24, 12, 6})
    vectors.simulated.push_back(
        60 * Modulation{.repeat = 8 * 96 / subdivision, .subdivision = subdivision}.field_Hz());
  vectors.paper.assign(5, 22'500);
  within(std::move(vectors), 1e-9);

  const auto nine_V = PaperSetting(options, options.wave_set, 9);
  const auto low_V = PaperSetting(options, options.wave_set, 1.8);
  const double motor_turns = low_V.gearhead.ratio;
  within({.id = "motor_speed",
          .text = "the motor turns as the times of 360 degrees and V_counter2 4000 say",
          .paper = {60 * motor_turns / 11, 60 * motor_turns / 32.1, 22'500},
          .simulated = {RotorSpeed_rpm(low_V, {.repeat = 37}, low_V.motor.load_Nm),
                        RotorSpeed_rpm(low_V, {.repeat = 108}, low_V.motor.load_Nm),
                        RotorSpeed_rpm(nine_V, {.repeat = 8}, kBareLoad_Nm)},
          .unit = "rpm",
          .conditions = "the rotor in steady rotation: 1.8 V, n 37 and n 108, mean load; 9 V, n 8, "
                        "bare motor"},
         0.005);
  add({.id = "pole_pairs",
       .text = "96 vectors are a turn of the motor",
       .paper = {1},
       .simulated = {11 / OutputTurn_s(options, 37)},
       .unit = "electrical turns a motor turn",
       .conditions = "from the time of 360 degrees with n 37",
       .status = ClaimStatus::kFitted,
       .reason = "parameter: pole pairs, which the paper does not print; its times leave one"});
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
  {
    constexpr int kOn = 359;
    const double period_s = Modulation{}.carrier_s();
    const double on_s = kOn / Modulation{}.clock_Hz;
    Claim claim{.id = "pulse_train",
                .text = "a pulse of 359 counts reaches 0.632 of the steady current",
                .paper = {0.632},
                .simulated = {PulseTrainPeak(nine_V, kOn),
                              (1 - std::exp(-on_s / tau_s)) / (1 - std::exp(-period_s / tau_s))},
                .unit = "of 2 V_bus / (3 r): in a train of pulses, by its formula",
                .conditions = "blocked motor, V_counter1 500, high for 359 counts of each period"};
    const bool holds = std::abs(claim.simulated[0] - 0.632) < 0.005 * 0.632;
    claim.status = holds ? ClaimStatus::kReproduced : ClaimStatus::kDisagrees;
    claim.reason =
        "0.632 holds for one pulse from zero; in a train each begins at what the last one left: "
        "i_pk = i_inf (1 - exp(-t_on / tau)) / (1 - exp(-T / tau))";
    add(std::move(claim));
  }
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

  // The paper's "steady" currents are fundamentals; a phase can reach 15.5 % more.
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
  within(
      {.id = "steady_current_1V8_as_printed",
       .text = "1.8 V sqrt3 / 14.85 ohm is 69.98 mA",
       .paper = {69.98},
       .simulated = {1e3 * low_V.bridge.v_bus_V * std::numbers::sqrt3 / low_V.motor.resistance_ohm},
       .unit = "mA",
       .conditions = "the formula as printed",
       .reason = "a misprint: 69.98 is 1.8 V / (sqrt3 r), a third of it"},
      0.005);
  within({.id = "torque_equation",
          .text = "eq. 12 and 13: torque is 3 P / L |flux_s| flux_f sin(delta)",
          .paper = {1},
          .simulated = {PrintedTorqueFactor(low_V)},
          .unit = "printed over simulated",
          .conditions = "1.8 V, n 37, in steady rotation; eq. 9 makes it so for any current",
          .reason = "eqs. 9 to 11 give 3 p / (2 L): as printed the torque is twice too big"},
         0.005);
  add({.id = "torque_equation_second_term",
       .text = "eq. 12, second term: its factor has no number of pole pairs",
       .unit = "",
       .conditions = "eqs. 9 to 11 give 3 p (Ld - Lq) / (4 Ld Lq)",
       .status = ClaimStatus::kNotTestable,
       .reason = "p is missing; here p = 1, and the term is 0 as Ld = Lq. Eq. 13 inherits it"});
  {
    // Eq. 4 in all sectors: the volt-seconds of every vector against its angle.
    double worst = 0;
    const Modulation modulation{.counter1 = 6000};
    for (int k = 0; k < modulation.subdivision; ++k) {
      const Pattern pattern = PatternOf(modulation, k);
      std::complex<double> sum;
      for (std::size_t leg = 0; leg < kLegCount; ++leg)
        if (!pattern[leg].none())
          sum += 2.0 / 3 * (pattern[leg].off - pattern[leg].on) / modulation.counter1 *
                 std::polar(1.0, kTurnRad / 3 * static_cast<double>(leg));
      worst = std::max(worst, std::abs(sum - std::polar(1 / std::numbers::sqrt3,
                                                        kTurnRad * k / modulation.subdivision)));
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
  {
    // The basic vectors stand at the places of a table of six.
    const auto angle_deg = [](int k) {
      const Pattern pattern = PatternOf({.counter1 = 6000, .subdivision = 6}, k);
      std::complex<double> sum;
      for (std::size_t leg = 0; leg < kLegCount; ++leg)
        sum += (pattern[leg].none() ? 0.0 : pattern[leg].off - pattern[leg].on) *
               std::polar(1.0, kTurnRad / 3 * static_cast<double>(leg));
      return std::arg(sum) * 360 / kTurnRad;
    };
    add({.id = "sector_width",
         .text = "the basic vectors have a 60r distribution",
         .paper = {60},
         .simulated = {angle_deg(1) - angle_deg(0), angle_deg(2) - angle_deg(1)},
         .unit = "deg",
         .conditions = "angles between vectors 100, 110 and 010",
         .status = ClaimStatus::kNotTestable,
         .reason = "a misprint: 60 degrees"});
  }
  add({.id = "counter2",
       .text = "V_counter1 500 and V_counter1 4000",
       .paper = {4000},
       .simulated = {Modulation{.repeat = 8}.vector_s() * Modulation{}.clock_Hz,
                     60 * Modulation{.repeat = 8}.field_Hz(),
                     60 * Modulation{.counter1 = 4000, .repeat = 8}.field_Hz()},
       .unit = "counts of a vector; rpm with V_counter2 4000, with V_counter1 4000",
       .conditions = "n 8, 96 vectors",
       .status = ClaimStatus::kNotTestable,
       .reason = "a misprint: the second is V_counter2; as V_counter1 the motor would turn at an "
                 "eighth of the speed"});
  // Other motors give the values that the paper leaves open. J 2 r / (3 flux^2) is the mechanical
  // time constant, 9.31 and 11.07 ms in the data sheets of two motors of 10 mm.
  const MotorParameters& motor = low_V.motor;
  const auto flux_mWb = [&](double constant_s) {
    return 1e3 * std::sqrt(2 * 8.7e-11 * motor.resistance_ohm / (3 * constant_s));
  };
  add({.id = "flux_by_scaling",
       .text = "flux linkage is not printed",
       .simulated = {flux_mWb(9.31e-3), flux_mWb(11.07e-3)},
       .unit = "mWb",
       .conditions = "inertia and resistance as printed",
       .status = ClaimStatus::kFitted,
       .reason = "parameter: mechanical time constant, taken from Orbray's BMS10-1003 and "
                 "BMS10-1008"});
  {
    // Four equal stages of 46 and 14 teeth form a gearhead for 4 mm motors that is sold as 337:1.
    const double ratio = std::pow(46.0 / 14 + 1, 4);
    const double off = ratio / 337 - 1;
    add({.id = "gear_ratio",
         .text = "the gearhead's ratio is 337",
         .paper = {337},
         .simulated = {ratio, 360 * off, kTurnRad * off * 8250},
         .unit = "ratio; degrees and um at the arm that a turn is off if so",
         .conditions = "a gearhead (46/14 + 1)^4; arm of 8.25 mm (assumed)",
         .status = ClaimStatus::kNotTestable,
         .reason = "the paper does not say which gearhead it has"});
  }
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
