// The signals on the paper's scope: currents, their spectrum, ripple and power over carrier,
// subdivision and wave mode. The motor turns steadily at the worst load of an output turn; its
// start is left out.

#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include "sim/drive/reduced_drive.h"
#include "sim/drive/reproduction/parts.h"
#include "sim/drive/steady.h"

namespace focalfleet::sim::reproduction {
namespace {

constexpr WaveMode kModes[] = {WaveMode::kAsymmetric, WaveMode::kFiveSegment,
                               WaveMode::kSevenSegment};
constexpr int kFleetMotors = 10'000;

double WorstLoad(const Drive::Setting& setting) {
  return setting.motor.load_Nm * (1 + setting.motor.load_variation);
}

// The figures are not a number where the motor cannot turn at this load.
WaveFigures Measure(const Drive::Setting& setting, const Modulation& modulation, double load_Nm) {
  const auto state = FindSteadyState(setting, modulation, load_Nm);
  if (state) return MeasureSteadyWave(setting, modulation, *state);
  WaveFigures none;
  none.peak_A = none.rms_A = none.fundamental_A = none.snr_dB = none.torque_ripple_rms =
      none.torque_ripple_peak_to_peak = none.edges_per_carrier = none.power.supply_W =
          none.power.copper_W = none.power.switching_W = std::nan("");
  return none;
}

double Lag_deg(const Drive::Setting& setting, int repeat, double load_Nm) {
  const auto state = FindSteadyState(setting, {.repeat = repeat}, load_Nm);
  return state ? state->lag_rad * 180 / std::numbers::pi : std::nan("");
}

void AddCarrierStudy(const ReproduceOptions& options, Reproduction* out) {
  const auto setting = PaperSetting(options, options.wave_set, 9);
  const auto add = [out](Claim claim) { out->claims.push_back(std::move(claim)); };
  const int counters[] = {250, 500, 1000, 2000};
  Claim peaks{.id = "peak_over_on_time",
              .text = "the peak current grows with the time a pulse is high",
              .unit = "mA",
              .conditions = "9 V, V_counter1 250, 500, 1000, 2000 at one speed, set " +
                            std::string(options.wave_set)};
  Claim snr{.id = "snr_over_carrier",
            .text = "SNR rises with the carrier frequency",
            .unit = "dB",
            .conditions = "9 V, V_counter1 2000, 1000, 500, 250 at one speed"};
  ClaimCurve curve{.figure = "SNR over carrier", .name = "simulated", .x = {}, .y = {}};
  for (const int counter1 : counters) {
    const WaveFigures figures =
        Measure(setting, {.counter1 = counter1, .repeat = 4000 / counter1}, WorstLoad(setting));
    peaks.simulated.push_back(1e3 * figures.peak_A);
    snr.simulated.insert(snr.simulated.begin(), figures.snr_dB);
    curve.x.push_back(144e3 / counter1);
    curve.y.push_back(figures.snr_dB);
  }
  peaks.status = InOrder(peaks.simulated, Order::kRises) == ClaimStatus::kOrdering
                     ? ClaimStatus::kReproduced
                     : ClaimStatus::kDisagrees;
  snr.status = InOrder(snr.simulated, Order::kRises);
  const double peak_2000_mA = peaks.simulated.back();
  // The SNR is measured with the rotor blocked and an ideal bridge, so that only winding and
  // carrier count.
  Drive::Setting blocked = setting;
  blocked.motor.flux_linkage_Wb = 0;
  blocked.motor.viscous_Nms = 0;
  Claim blocked_peaks{
      .id = "peak_over_on_time_blocked",
      .text = peaks.text,
      .unit = peaks.unit,
      .conditions = "9 V, V_counter1 250, 500, 1000, 2000 at one speed, no back-EMF"};
  Claim blocked_snr{.id = "snr_over_carrier_blocked",
                    .text = snr.text,
                    .unit = snr.unit,
                    .conditions =
                        "9 V, V_counter1 2000, 1000, 500, 250 at one speed, no back-EMF, "
                        "ideal bridge"};
  for (const int counter1 : counters) {
    const Modulation modulation{.counter1 = counter1, .repeat = 4000 / counter1};
    const SteadyState held{.speed_rad_per_s = 2 * std::numbers::pi * modulation.field_Hz()};
    blocked_peaks.simulated.push_back(1e3 * MeasureSteadyWave(blocked, modulation, held).peak_A);
    blocked_snr.simulated.insert(blocked_snr.simulated.begin(),
                                 MeasureSteadyWave(Ideal(blocked), modulation, held).snr_dB);
  }
  blocked_peaks.status = InOrder(blocked_peaks.simulated, Order::kRises) == ClaimStatus::kOrdering
                             ? ClaimStatus::kReproduced
                             : ClaimStatus::kDisagrees;
  blocked_snr.status = InOrder(blocked_snr.simulated, Order::kRises);
  add(std::move(blocked_peaks));
  add(std::move(blocked_snr));
  add(std::move(peaks));
  add(std::move(snr));
  out->curves.push_back(std::move(curve));

  Claim peak{.id = "peak_9V",
             .text = "peak current at 72 kHz",
             .paper = {288},
             .simulated = {peak_2000_mA},
             .unit = "mA",
             .conditions = "9 V, V_counter1 2000, n 2"};
  peak.status = Within(peak, 0.02);
  if (peak.status == ClaimStatus::kDisagrees)
    peak.reason =
        "a pulse of 13.9 us is 5.6 time constants long, so the current all but reaches "
        "2 V_bus / (3 r); a probe of little bandwidth reads the fundamental, and a hot winding "
        "lowers it";
  add(std::move(peak));

  // The factor by which the winding would have to be hotter for a fundamental of 288 mA.
  const Modulation slow{.counter1 = 2000, .repeat = 2};
  double cold = 1;
  double hot = 1.6;
  for (int k = 0; k < 20; ++k) {
    Drive::Setting warm = setting;
    const double factor = (cold + hot) / 2;
    warm.motor.resistance_ohm *= factor;
    const WaveFigures figures = Measure(warm, slow, WorstLoad(setting));
    (figures.fundamental_A > 0.288 ? cold : hot) = factor;
  }
  add({.id = "peak_9V_fundamental",
       .text = "the same read as the fundamental of a hot winding",
       .paper = {288},
       .simulated = {100 * (hot - 1), (hot - 1) / 0.00393},
       .unit = "% of r, K",
       .conditions = "r raised until the fundamental is 288 mA; copper 0.393 % a kelvin",
       .status = ClaimStatus::kFitted,
       .reason = "parameter: winding temperature"});
}

void AddSubdivisionStudy(const ReproduceOptions& options, Reproduction* out) {
  const auto setting = PaperSetting(options, options.wave_set, 9);
  Claim snr{.id = "snr_over_subdivision",
            .text = "more subdivision makes the current more sinusoidal",
            .unit = "dB",
            .conditions = "9 V, V_counter1 500, subdivision 6, 12, 24, 48, 96 at one speed"};
  Claim ripple{.id = "ripple_over_subdivision",
               .text = "more subdivision makes the torque smoother",
               .unit = "% rms",
               .conditions = snr.conditions};
  Claim six{.id = "six_steps",
            .text = "with six vectors the torque goes in six steps",
            .unit = "% peak to peak",
            .conditions = "9 V, V_counter1 500, subdivision 6; running mean over a carrier period"};
  ClaimCurve curve{
      .figure = "torque ripple over subdivision", .name = "simulated", .x = {}, .y = {}};
  for (const int subdivision : {6, 12, 24, 48, 96}) {
    const WaveFigures figures = Measure(
        setting, {.repeat = 8 * 96 / subdivision, .subdivision = subdivision}, WorstLoad(setting));
    snr.simulated.push_back(figures.snr_dB);
    ripple.simulated.push_back(100 * figures.torque_ripple_rms);
    if (subdivision == 6) six.simulated = {100 * figures.torque_ripple_peak_to_peak};
    curve.x.push_back(subdivision);
    curve.y.push_back(100 * figures.torque_ripple_rms);
  }
  snr.status = InOrder(snr.simulated, Order::kRises);
  ripple.status = InOrder(ripple.simulated, Order::kFalls);
  six.status = six.simulated.front() > 50 ? ClaimStatus::kReproduced : ClaimStatus::kDisagrees;
  out->claims.push_back(std::move(snr));
  out->claims.push_back(std::move(ripple));
  out->claims.push_back(std::move(six));
  out->curves.push_back(std::move(curve));
}

void AddModeStudy(const ReproduceOptions& options, Reproduction* out) {
  const auto add = [out](Claim claim) { out->claims.push_back(std::move(claim)); };
  struct AtVoltage {
    double v_bus_V;
    int repeat;
    std::array<WaveFigures, 3> modes;
  };
  std::array<AtVoltage, 2> rails = {{{9, 8, {}}, {1.8, 108, {}}}};
  for (AtVoltage& rail : rails) {
    const auto setting = PaperSetting(options, options.wave_set, rail.v_bus_V);
    for (std::size_t k = 0; k < 3; ++k)
      rail.modes[k] =
          Measure(setting, {.repeat = rail.repeat, .mode = kModes[k]}, WorstLoad(setting));
  }
  const auto of_modes = [](const AtVoltage& rail, auto figure) {
    std::vector<double> numbers;
    for (const WaveFigures& figures : rail.modes) numbers.push_back(figure(figures));
    return numbers;
  };
  const AtVoltage& nine = rails[0];
  const AtVoltage& low = rails[1];
  const std::string at_9V = "9 V, V_counter1 500, n 8; asymmetric, five-, seven-segment";

  Claim edges{.id = "edges_per_carrier",
              .text = "switch changes in a carrier period",
              .paper = {2, 4, 6},
              .simulated = of_modes(nine, [](const WaveFigures& f) { return f.edges_per_carrier; }),
              .unit = "",
              .conditions = at_9V};
  edges.status = Within(edges, 0.05);
  edges.reason =
      "two legs switch in asymmetric and in five-segment modulation, each up and down: as many "
      "edges; pulses of no length make some periods shorter of edges";
  add(std::move(edges));

  const auto rms_mA = of_modes(nine, [](const WaveFigures& f) { return 1e3 * f.rms_A; });
  Claim rms{.id = "rms_of_modes",
            .text = "asymmetric modulation has at least 1.37 mA less current (AC RMS)",
            .paper = {-1.37, -1.37},
            .simulated = {rms_mA[0] - rms_mA[1], rms_mA[0] - rms_mA[2]},
            .unit = "mA",
            .conditions = at_9V + ", at one carrier frequency"};
  rms.status = rms.simulated[0] <= -1.37 && rms.simulated[1] <= -1.37 ? ClaimStatus::kReproduced
                                                                      : ClaimStatus::kDisagrees;
  rms.reason =
      "at one carrier frequency the modes differ by what dead time takes, and the symmetric ones "
      "lose more; see rms_of_modes_half_carrier";
  add(std::move(rms));

  // A warmer winding changes the same current.
  {
    constexpr double kCopper_per_K = 0.00393;
    constexpr double kWarmer_K = 10;
    Drive::Setting warm = PaperSetting(options, options.wave_set, 9);
    const double load_Nm = WorstLoad(warm);
    warm.motor.resistance_ohm *= 1 + kCopper_per_K * kWarmer_K;
    const double mA_per_K =
        (rms_mA[0] - 1e3 * Measure(warm, {.repeat = 8}, load_Nm).rms_A) / kWarmer_K;
    add({.id = "rms_in_kelvin",
         .text = "1.37 mA less current (AC RMS) tells the modes apart",
         .paper = {1.37},
         .simulated = {100 * 1.37 / rms_mA[0], 1.37 / mA_per_K},
         .unit = "% of the RMS, K",
         .conditions = "9 V, n 8, asymmetric; copper 0.393 % a kelvin",
         .status = ClaimStatus::kFitted,
         .reason = "parameter: winding temperature; a winding so much warmer has the same effect, "
                   "and at this point it warms by far more"});
  }

  // A centre-aligned timer counts up and down: with the same period register its carrier frequency
  // is half.
  const auto nine_V = PaperSetting(options, options.wave_set, 9);
  std::vector<double> half_rms;
  std::vector<double> half_snr;
  for (const WaveMode mode : {WaveMode::kFiveSegment, WaveMode::kSevenSegment}) {
    const WaveFigures figures =
        Measure(nine_V, {.counter1 = 1000, .repeat = 4, .mode = mode}, WorstLoad(nine_V));
    half_rms.push_back(rms_mA[0] - 1e3 * figures.rms_A);
    half_snr.push_back(figures.snr_dB - nine.modes[0].snr_dB);
  }
  add({.id = "rms_of_modes_half_carrier",
       .text = "the same if the symmetric modes ran on a centre-aligned timer",
       .paper = {-1.37, -1.37},
       .simulated = half_rms,
       .unit = "mA",
       .conditions = "symmetric modes at 144 kHz; then their SNR is " +
                     std::to_string(half_snr[0]) + " and " + std::to_string(half_snr[1]) +
                     " dB off asymmetric's",
       .status = ClaimStatus::kFitted,
       .reason = "parameter: carrier of the symmetric modes; the paper's SNR would have shown it"});

  const auto snr = of_modes(nine, [](const WaveFigures& f) { return f.snr_dB; });
  Claim harmonics{.id = "harmonics_of_modes",
                  .text = "the modes differ little in harmonics",
                  .simulated = {snr[1] - snr[0], snr[2] - snr[0]},
                  .unit = "dB over asymmetric",
                  .conditions = at_9V};
  harmonics.status = std::abs(harmonics.simulated[0]) < 1 && std::abs(harmonics.simulated[1]) < 1
                         ? ClaimStatus::kReproduced
                         : ClaimStatus::kDisagrees;
  add(std::move(harmonics));

  for (const AtVoltage& rail : {nine, low}) {
    const auto supply_W = of_modes(rail, [](const WaveFigures& f) { return f.power.supply_W; });
    const auto lost_W = of_modes(rail, [](const WaveFigures& f) { return f.power.switching_W; });
    const std::string at = rail.v_bus_V > 5 ? "9V" : "1V8";
    const std::string conditions = (rail.v_bus_V > 5 ? "9 V, n 8" : "1.8 V, n 108") +
                                   std::string("; five- and seven-segment less asymmetric");
    const auto saving = [&](std::string id, std::string text, double paper, double scale) {
      Claim claim{.id = std::move(id),
                  .text = std::move(text),
                  .paper = {paper, paper},
                  .simulated = {scale * (lost_W[1] - lost_W[0]), scale * (lost_W[2] - lost_W[0])},
                  .unit = "",
                  .conditions = conditions};
      claim.status = Within(claim, 0.1);
      claim.simulated.push_back(scale * (supply_W[1] - supply_W[0]));
      claim.simulated.push_back(scale * (supply_W[2] - supply_W[0]));
      return claim;
    };
    Claim motor = saving("saving_per_motor_" + at, "asymmetric modulation saves 12.33 mW a motor",
                         12.33, 1e3);
    motor.unit = "mW: switching five, seven; supply five, seven";
    motor.reason =
        "a difference of phase RMS times the bus voltage is not power; what the mode changes is "
        "switching loss, and dead time takes voltage from the modes with more edges, so that they "
        "draw less and pull less";
    add(std::move(motor));
    Claim fleet =
        saving("saving_fleet_" + at, "10,000 motors make it considerable", 123.3, kFleetMotors);
    fleet.unit = "W: switching five, seven; supply five, seven";
    fleet.conditions += ", 5000 units";
    fleet.reason = "as saving_per_motor; the paper's product is arithmetic";
    add(std::move(fleet));
  }

  // Modes with more edges lose more voltage to dead time: at one bus voltage their field is weaker.
  // At equal field, and so at equal torque margin, the remaining difference is the cost of the
  // edges.
  for (const AtVoltage& rail : {nine, low}) {
    const auto setting = PaperSetting(options, options.wave_set, rail.v_bus_V);
    const double field_Nm = ReducedDrive(setting, {.repeat = rail.repeat}).stall_Nm();
    Claim equal{.id = rail.v_bus_V > 5 ? "saving_equal_field_9V" : "saving_equal_field_1V8",
                .text = "what asymmetric modulation saves at equal torque margin",
                .paper = {12.33, 12.33},
                .simulated = {},
                .unit = "mW of supply: five, seven",
                .conditions = "V_bus of the others raised until their field equals asymmetric's",
                .reason =
                    "five segments save, seven cost a third of it at 9 V and next to nothing at "
                    "1.8 V; diodes without a forward voltage make dead time cheap"};
    constexpr double kForward_V = 0.7;
    Claim diodes = equal;
    diodes.id = rail.v_bus_V > 5 ? "saving_with_diodes_9V" : "saving_with_diodes_1V8";
    diodes.conditions += "; diodes of 0.7 V during dead time, to first order";
    diodes.reason =
        "most of what asymmetric modulation saves is what diodes take while both "
        "switches of a leg are open; it is no product of RMS and bus voltage";
    for (const WaveMode mode : {WaveMode::kFiveSegment, WaveMode::kSevenSegment}) {
      const Modulation modulation{.repeat = rail.repeat, .mode = mode};
      Drive::Setting raised = setting;
      for (int k = 0; k < 3; ++k)  // the share of dead time hardly depends on the voltage
        raised.bridge.v_bus_V *= field_Nm / ReducedDrive(raised, modulation).stall_Nm();
      const WaveFigures figures = Measure(raised, modulation, WorstLoad(setting));
      const double more_W = figures.power.supply_W - rail.modes[0].power.supply_W;
      equal.simulated.push_back(1e3 * more_W);
      diodes.simulated.push_back(1e3 *
                                 (more_W + kForward_V * (figures.diode_A - rail.modes[0].diode_A)));
    }
    equal.status = Within(equal, 0.1);
    diodes.status = Within(diodes, 0.1);
    add(std::move(equal));
    add(std::move(diodes));
  }

  const auto low_V = PaperSetting(options, options.wave_set, 1.8);
  const WaveFigures critical = Measure(low_V, {.repeat = 37}, low_V.motor.load_Nm);
  const WaveFigures final = Measure(low_V, {.repeat = 108}, low_V.motor.load_Nm);
  Claim peak{.id = "peak_1V8",
             .text = "peak current with the final parameters",
             .paper = {66},
             .simulated = {1e3 * final.peak_A, 1e3 * final.fundamental_A, 1e3 * critical.peak_A},
             .unit = "mA: peak n 108, fundamental n 108, peak n 37",
             .conditions = "1.8 V, V_counter1 500, mean load"};
  peak.status = std::abs(peak.simulated[0] - 66) < 0.02 * 66 ? ClaimStatus::kReproduced
                                                             : ClaimStatus::kDisagrees;
  peak.reason =
      "the fundamental and the peak at n 37 are within 3 %; ripple adds to the peak at "
      "n 108 what a probe of little bandwidth does not show";
  add(std::move(peak));
  Claim heat{.id = "heat_in_motor",
             .text = "the bench point at 9 V and the final one at 1.8 V: power in the winding",
             .simulated = {nine.modes[0].power.copper_W, low.modes[0].power.copper_W},
             .unit = "W",
             .conditions = "9 V n 8; 1.8 V n 108",
             .status = ClaimStatus::kNotTestable,
             .reason = "the paper does not print it; a 4 mm motor at the former is hot"};
  add(std::move(heat));

  // The rotor against its vector: the paper sets the torque angle to the width of a vector.
  Claim lag{.id = "torque_angle",
            .text = "the torque angle is about 360 / subdivision",
            .paper = {},
            .simulated = {},
            .unit = "deg: n 108 by set, n 37 by set",
            .conditions = "1.8 V, mean load",
            .status = ClaimStatus::kDisagrees,
            .reason =
                "the lag is what the load needs: sin(lag) is about the load's share of what "
                "the field can pull"};
  for (const int repeat : {108, 37})
    for (const std::string_view set : options.start_sets) {
      const auto at = PaperSetting(options, set, 1.8);
      lag.simulated.push_back(Lag_deg(at, repeat, at.motor.load_Nm));
      lag.paper.push_back(360.0 / Modulation{}.subdivision);
    }
  if (Within(lag, 0.1) == ClaimStatus::kReproduced) lag.status = ClaimStatus::kReproduced;
  add(std::move(lag));
}

}  // namespace

void AddWaves(const ReproduceOptions& options, Reproduction* out) {
  AddCarrierStudy(options, out);
  AddSubdivisionStudy(options, out);
  AddModeStudy(options, out);
}

}  // namespace focalfleet::sim::reproduction
