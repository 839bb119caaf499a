// Options and the two ways of the command tune: a single motor for the terminal, or both axes of
// every unit of a fleet for a table and the store.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "daemon/cli/context.h"
#include "daemon/cli/drive_options.h"
#include "daemon/cli/exit_code.h"
#include "sim/drive/tuning/tuning.h"

namespace focalfleet::cli {

struct TuneOptions {
  DriveOptions drive;
  sim::TuningRule rule;
  double ramp_stage_ms = 10;
  std::string minimise;         // empty: nothing is chosen
  std::vector<double> rails_V;  // empty: --v-bus
  std::string units;
  std::string loads;
  double load_spread = 0;
  std::uint64_t seed = 1;
  bool full = false;
  std::string store;
  std::string out;
};

/// The choices among which --minimise decides: each rail voltage with each mode. Without --minimise
/// the given choice alone.
std::vector<DriveChoice> ChoicesOf(const TuneOptions& options, const DriveChoice& given);

/// Why no n was chosen; empty: one was.
std::string Because(sim::TuningOutcome outcome, double peak_share, double share_max);

ExitCode TuneOne(const Context& context, const TuneOptions& options, const DriveChoice& given);
ExitCode TuneFleet(const Context& context, const TuneOptions& options, const DriveChoice& choice);

}  // namespace focalfleet::cli
