// The view of a configuration is what the coordinator publishes of it: its counts of outcomes, its
// times, its starts and its exposures. Shown is the one under way, or the last one.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "fleet/coordinate/bus_view.h"
#include "fleet/records.h"
#include "protocol/base/ids.h"
#include "protocol/base/instants.h"

namespace focalfleet {

/// How far apart the units of a round began, by their own clocks; of several rounds the widest.
struct StartView {
  std::uint32_t round = 0;     // 0: none yet
  std::uint32_t begun = 0;     // units that were started
  std::uint32_t reported = 0;  // of these, units whose start is known
  double skew_s = 0;           // from the first start to the last, the likeliest
  double bound_s = 0;          // the true skew is within skew_s +- bound_s
  double least_s = 0;          // the true skew is within least_s..most_s, both included
  double most_s = 0;
  double allowed_s = 0;  // that the plan was made for
  std::optional<PositionerIndex> first = {};
  std::optional<PositionerIndex> last = {};
};

/// The findings of one exposure about the units that have targets.
struct MeasuredRound {
  std::uint64_t exposure = 0;
  std::uint32_t measured = 0;
  std::uint32_t unknown = 0;           // seen nowhere, or confused with another unit
  std::uint32_t within_tolerance = 0;  // of `measured`
  std::uint32_t by_sensors = 0;        // of `measured`: by the unit's own
  bool camera = true;                  // an exposure was taken, too
  double rms_um = 0;                   // of the distances from the targets, of `measured`
  double median_um = 0;
  double worst_um = 0;
};

/// The task that a configuration was given.
enum class ConfigurationKind : std::uint8_t { kApply, kHome, kMeasure };
constexpr const char* Name(ConfigurationKind kind) {
  constexpr const char* kNames[] = {"apply", "home", "measure"};
  return kNames[static_cast<std::size_t>(kind)];
}

struct ConfigurationView {
  std::uint64_t id = 0;
  ConfigurationKind kind = ConfigurationKind::kApply;
  std::string source;
  ConfigurationState state = ConfigurationState::kDone;
  std::uint32_t round = 0;
  OutcomeCounts counts;
  double makespan_predicted_s = 0;  // all rounds that were started
  double makespan_s = 0;            // start signals to last arrival, all rounds
  double energy_J = 0;              // predicted, of the same
  double peak_power_W = 0;          // predicted, of the same
  std::uint64_t frames = 0;         // both directions, all buses, since it began
  UploadView upload;                // bits of all buses, all rounds
  StartView starts;
  HostInstant began;
  HostInstant started;                  // start signal of this round; kNever before it
  std::string waiting_for;              // what delays it, for people; usually empty
  std::vector<MeasuredRound> measured;  // blind, then after each correction
  std::string not_measured;  // why the last exposure that was due failed; empty: none did
};

}  // namespace focalfleet
