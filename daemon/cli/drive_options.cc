#include "daemon/cli/drive_options.h"

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <cmath>

#include "daemon/cli/command_line.h"

namespace focalfleet::cli {
namespace {

struct ModeWord {
  WaveMode mode;
  const char* word;
};
constexpr double kTimeConstantMax_s = 1e-3;
constexpr double kInertiaMin_kg_m2 = 1e-12;
constexpr std::array<ModeWord, 3> kModeWords = {{{WaveMode::kAsymmetric, "asymmetric"},
                                                 {WaveMode::kFiveSegment, "five-segment"},
                                                 {WaveMode::kSevenSegment, "seven-segment"}}};

constexpr double kLoadMax_uNm = 1000;  // a hundred times the motor's torque at 9 V

std::optional<double> NumberOfText(const std::string& text) {
  double value = 0;
  const char* end = text.data() + text.size();
  const auto [rest, error] = std::from_chars(text.data(), end, value);
  if (error != std::errc() || rest != end || !std::isfinite(value)) return std::nullopt;
  return value;
}

CLI::Validator Subdivision() {
  const auto check = [](const std::string& text) -> std::string {
    const auto value = NumberOfText(text);
    if (value && *value >= 6 && *value <= kSubdivisionMax && std::fmod(*value, 6) == 0) return "";
    return fmt::format(
        "{} is not a multiple of 6 from 6 to {}: the six sectors have the same vectors", text,
        kSubdivisionMax);
  };
  return {check, fmt::format("multiple of 6 up to {}", kSubdivisionMax), "subdivision"};
}

Result<sim::MotorParameters> MotorOf(const DriveOptions& options) {
  const auto set = sim::FindParameterSet(options.set);
  if (!set) return Fail(ErrorCode::kInvalid, fmt::format("--set: no set '{}'", options.set));
  sim::MotorParameters motor = *set;
  motor.resistance_ohm = options.resistance_ohm.value_or(motor.resistance_ohm);
  if (options.inductance_uH) motor.inductance_H = *options.inductance_uH * 1e-6;
  if (options.flux_mWb) motor.flux_linkage_Wb = *options.flux_mWb * 1e-3;
  if (options.inertia_gcm2) motor.inertia_kg_m2 = *options.inertia_gcm2 * 1e-7;
  if (options.viscous_nNms) motor.viscous_Nms = *options.viscous_nNms * 1e-9;
  if (options.load == "fleet") return motor;
  // Only the fleet's gearhead has a load that changes over a turn.
  motor.load_variation = 0;
  if (options.load == "bare") {
    motor.load_Nm = sim::kBareLoad_Nm;
    return motor;
  }
  const auto load_uNm = NumberOfText(options.load);
  if (!load_uNm || *load_uNm < 0 || *load_uNm > kLoadMax_uNm) {
    return Fail(ErrorCode::kInvalid,
                fmt::format("--load {}: `bare`, `fleet` or a torque at the motor shaft, 0 to {:g} "
                            "uNm",
                            options.load, kLoadMax_uNm));
  }
  motor.load_Nm = *load_uNm * 1e-6;
  return motor;
}

}  // namespace

CLI::Validator PositiveNumberUpTo(double high, const std::string& why) {
  const auto check = [high, why](const std::string& text) -> std::string {
    const auto value = NumberOfText(text);
    if (value && *value > 0 && *value <= high) return "";
    return fmt::format("{} is not a number above 0 and up to {:g}{}", text, high, why);
  };
  return {check, fmt::format("above 0 up to {:.12g}", high), "number"};
}

WaveMode ModeOf(const std::string& word) {
  for (const ModeWord& mode : kModeWords)
    if (word == mode.word) return mode.mode;
  return WaveMode::kAsymmetric;  // the parser accepts no other word
}

const char* WordOf(WaveMode mode) { return kModeWords[static_cast<std::size_t>(mode)].word; }

std::vector<std::string> ModeWords() {
  std::vector<std::string> words;
  for (const ModeWord& mode : kModeWords) words.emplace_back(mode.word);
  return words;
}

void AddMotorOptions(CLI::App* command, DriveOptions* options) {
  std::vector<std::string> sets;
  for (const sim::ParameterSet& set : sim::kParameterSets) sets.emplace_back(set.name);
  OneOf(command->add_option("--set", options->set,
                            "What the paper leaves open about the motor, a consistent choice"),
        sets)
      ->capture_default_str();
  command
      ->add_option("--load", options->load,
                   "bare: no gearhead; fleet: as the set has it; or a torque at the motor shaft, "
                   "uNm")
      ->type_name("bare|fleet|uNm")
      ->capture_default_str();
  command->add_option("--resistance-ohm", options->resistance_ohm, "Of a phase, instead of the set")
      ->check(PositiveNumberUpTo(1e4));
  command->add_option("--inductance-uH", options->inductance_uH, "Of a phase, instead of the set")
      ->check(PositiveNumberUpTo(1e5));
  command->add_option("--flux-mWb", options->flux_mWb, "Flux linkage, instead of the set")
      ->check(PositiveNumberUpTo(10));
  command->add_option("--inertia-gcm2", options->inertia_gcm2, "Of the rotor, instead of the set")
      ->check(PositiveNumberUpTo(10));
  command->add_option("--viscous-nNms", options->viscous_nNms, "Drag, instead of the set")
      ->check(NumberBetween(0, 1e5));
}

void AddBridgeOptions(CLI::App* command, DriveOptions* options) {
  command->add_option("--v-bus", options->v_bus_V, "Bus voltage, V")
      ->check(PositiveNumberUpTo(kBridgeMax_V, " V, which the bridge bears"))
      ->capture_default_str();
  command
      ->add_option("--counter1", options->modulation.counter1,
                   "Timer counts of a carrier period, V_counter1")
      ->check(CLI::Range(1, 65'535))
      ->capture_default_str();
  command
      ->add_option("--subdivision", options->modulation.subdivision,
                   "Vectors of an electrical turn, a multiple of 6")
      ->check(Subdivision())
      ->capture_default_str();
  OneOf(command->add_option("--mode", options->mode, "Where the pulses lie in a carrier period"),
        ModeWords())
      ->capture_default_str();
  const auto time = NumberBetween(0, 1e6);
  command
      ->add_option("--dead-time-ns", options->dead_time_ns,
                   "From one switch's end to the other's begin")
      ->check(time)
      ->capture_default_str();
  command->add_option("--rise-ns", options->rise_ns, "Of a leg's voltage")
      ->check(time)
      ->capture_default_str();
  command->add_option("--fall-ns", options->fall_ns, "Of a leg's voltage")
      ->check(time)
      ->capture_default_str();
}

void AddRepeatOption(CLI::App* command, DriveOptions* options) {
  command
      ->add_option("--repeat", options->modulation.repeat,
                   "Carrier periods that a vector is shown, n")
      ->check(CLI::Range(1, 255))
      ->capture_default_str();
}

Result<DriveChoice> ChoiceOf(const DriveOptions& options) {
  DriveChoice choice;
  FOCALFLEET_TRY_ASSIGN(choice.setting.motor, MotorOf(options));
  choice.modulation = options.modulation;
  choice.modulation.mode = ModeOf(options.mode);
  choice.setting.bridge = {.v_bus_V = options.v_bus_V,
                           .rise_s = options.rise_ns * 1e-9,
                           .fall_s = options.fall_ns * 1e-9,
                           .dead_time_s = options.dead_time_ns * 1e-9};
  // Beyond these limits the drive's model does not hold: currents settle slower than vectors
  // change, or the rotor reverses between two switching edges.
  const sim::MotorParameters& motor = choice.setting.motor;
  if (const double tau_s = motor.inductance_H / motor.resistance_ohm; tau_s > kTimeConstantMax_s)
    return Fail(ErrorCode::kInvalid,
                fmt::format("L/r of a phase is {:g} ms; the drive is simulated up to {:g} ms",
                            tau_s * 1e3, kTimeConstantMax_s * 1e3));
  if (motor.inertia_kg_m2 < kInertiaMin_kg_m2)
    return Fail(ErrorCode::kInvalid,
                fmt::format("an inertia of {:g} gcm2; the drive is simulated from {:g} gcm2",
                            motor.inertia_kg_m2 * 1e7, kInertiaMin_kg_m2 * 1e7));
  const double carrier_ns = choice.modulation.carrier_s() * 1e9;
  struct Time {
    const char* name;
    double ns;
  };
  for (const Time& time :
       {Time{"--dead-time-ns", options.dead_time_ns}, Time{"--rise-ns", options.rise_ns},
        Time{"--fall-ns", options.fall_ns}}) {
    if (time.ns < carrier_ns) continue;
    return Fail(ErrorCode::kInvalid,
                fmt::format("{} {:g}: as long as the carrier period of {:g} ns (--counter1 {}), so "
                            "that no pulse is left",
                            time.name, time.ns, carrier_ns, choice.modulation.counter1));
  }
  return choice;
}

Json SettingsJson(const DriveOptions& options, const DriveChoice& choice) {
  const sim::MotorParameters& motor = choice.setting.motor;
  const sim::Modulation& modulation = choice.modulation;
  return {{"set", options.set},
          {"load", options.load},
          {"load_uNm", motor.load_Nm * 1e6},
          {"load_variation", motor.load_variation},
          {"resistance_ohm", motor.resistance_ohm},
          {"inductance_uH", motor.inductance_H * 1e6},
          {"flux_mWb", motor.flux_linkage_Wb * 1e3},
          {"inertia_gcm2", motor.inertia_kg_m2 * 1e7},
          {"viscous_nNms", motor.viscous_Nms * 1e9},
          {"v_bus_V", options.v_bus_V},
          {"counter1", modulation.counter1},
          {"repeat", modulation.repeat},
          {"subdivision", modulation.subdivision},
          {"mode", WordOf(modulation.mode)},
          {"clock_Hz", modulation.clock_Hz},
          {"carrier_Hz", modulation.clock_Hz / modulation.counter1},
          {"dead_time_ns", options.dead_time_ns},
          {"rise_ns", options.rise_ns},
          {"fall_ns", options.fall_ns}};
}

}  // namespace focalfleet::cli
