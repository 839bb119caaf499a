// DriveOptions are the options of the commands that simulate a motor on its bridge: motor, load,
// voltage and timer counts. Values that are impossible for a drive are refused with a reason before
// anything runs.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>

#include "daemon/control/messages.h"
#include "protocol/base/result.h"
#include "sim/drive/drive.h"
#include "sim/drive/svpwm.h"

namespace focalfleet::cli {

/// The finest subdivision of a rotor turn that a command takes.
inline constexpr int kSubdivisionMax = 6144;

/// The highest voltage that the bridge's switches tolerate.
inline constexpr double kBridgeMax_V = 12;

struct DriveOptions {
  // This set reproduces the waves of paper 1; on starts at 1.8 V all sets agree.
  std::string set = "9";
  std::string load = "bare";  // or `fleet`, or a number of uNm
  std::optional<double> resistance_ohm;
  std::optional<double> inductance_uH;
  std::optional<double> flux_mWb;
  std::optional<double> inertia_gcm2;
  std::optional<double> viscous_nNms;
  double v_bus_V = 1.8;
  double dead_time_ns = 50;
  double rise_ns = 10;
  double fall_ns = 10;
  sim::Modulation modulation;
  std::string mode = "asymmetric";
};

/// Adds --set, --load and the options that replace single parameters of the set.
void AddMotorOptions(CLI::App* command, DriveOptions* options);
/// Adds --v-bus, the bridge's times and --counter1, --subdivision, --mode.
void AddBridgeOptions(CLI::App* command, DriveOptions* options);
void AddRepeatOption(CLI::App* command, DriveOptions* options);

/// A number above 0; `why` ends the message about a number that is too high.
CLI::Validator PositiveNumberUpTo(double high, const std::string& why = "");

WaveMode ModeOf(const std::string& word);
const char* WordOf(WaveMode mode);
/// All words that --mode accepts.
std::vector<std::string> ModeWords();

struct DriveChoice {
  sim::Drive::Setting setting;
  sim::Modulation modulation;
};
/// The drive that the options describe.
/// Errors: kInvalid: values that do not go together, or an invalid load.
Result<DriveChoice> ChoiceOf(const DriveOptions& options);

/// All numbers of the choice, with units.
Json SettingsJson(const DriveOptions& options, const DriveChoice& choice);

}  // namespace focalfleet::cli
