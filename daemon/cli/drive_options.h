// Options of the commands that simulate a motor on its bridge: which motor, which load, which
// voltage and timer counts. What no drive can be is refused with a reason before anything runs.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>

#include "daemon/control/messages.h"
#include "protocol/base/result.h"
#include "sim/drive/drive.h"
#include "sim/drive/svpwm.h"

namespace focalfleet::cli {

/// The bridge's switches bear no more.
inline constexpr double kBridgeMax_V = 12;

struct DriveOptions {
  // The set with which paper 1's waves are reproduced; on starts at 1.8 V all sets agree.
  std::string set = "9";
  std::string load = "bare";  // or `fleet`, or uNm
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

/// --set, --load and what replaces single parameters of the set.
void AddMotorOptions(CLI::App* command, DriveOptions* options);
/// --v-bus, the bridge's times and --counter1, --subdivision, --mode.
void AddBridgeOptions(CLI::App* command, DriveOptions* options);
void AddRepeatOption(CLI::App* command, DriveOptions* options);

/// A number above 0; `why` ends the sentence about one that is too high.
CLI::Validator PositiveNumberUpTo(double high, const std::string& why = "");

WaveMode ModeOf(const std::string& word);
const char* WordOf(WaveMode mode);
/// All words that --mode takes.
std::vector<std::string> ModeWords();

struct DriveChoice {
  sim::Drive::Setting setting;
  sim::Modulation modulation;
};
/// Errors: kInvalid: values that do not go together, a load that is no load.
Result<DriveChoice> ChoiceOf(const DriveOptions& options);

/// Every number of the choice, with units.
Json SettingsJson(const DriveOptions& options, const DriveChoice& choice);

}  // namespace focalfleet::cli
