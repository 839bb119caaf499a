// OfflineFleet is shared by the commands that work on files: the focal plane as units.csv and
// obstacles.csv give it. Drives are nominal, or as tuned in the daemon's store.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "daemon/campaign/compensation.h"
#include "daemon/cli/context.h"
#include "fleet/drive.h"
#include "fleet/files/state_file.h"
#include "fleet/layout.h"
#include "fleet/plan/planner.h"
#include "fleet/records.h"
#include "protocol/base/result.h"

namespace CLI {
class App;
}

namespace focalfleet::cli {

struct FleetFiles {
  std::string units;
  std::string obstacles;    // empty: none
  double clearance_mm = 0;  // 0: derived from the pitch
};

/// Adds --units, --obstacles, --clearance-mm.
void AddFleetFiles(CLI::App* command, FleetFiles* files);

/// Adds --store.
void AddTunedStore(CLI::App* command, std::string* store);

struct OfflineFleet {
  Layout layout;
  std::vector<UnitDrive> drives;  // Shape: (n)
  /// The results of tunings, by unit and axis. Shape: (n), or empty where no store was read.
  std::vector<std::array<std::optional<TuningRow>, kAxisCount>> tunings = {};

  [[nodiscard]] std::optional<TuningRow> TuningOf(PositionerIndex i, Axis axis) const {
    return tunings.empty() ? std::nullopt : tunings[i.value][Index(axis)];
  }
};

/// Takes over the drives and tunings of the units that are bound in the store; an empty path
/// changes nothing. The store is only read: a daemon may have it open.
/// Errors: as StoreReader's.
Status TakeTuned(const std::string& store, OfflineFleet* fleet);

/// The fleet in the files. Reports on stderr which columns of units.csv were ignored.
/// Errors: kUnavailable, kInvalid with file:line.
Result<OfflineFleet> LoadFleet(const Context& context, const FleetFiles& files);

using StatePoses = std::vector<std::optional<Pose>>;  // Shape: (n)

/// The poses of the units that `required` selects, and of others that the file names.
/// Errors: as LoadFleet; also a selected unit that the file does not name.
Result<StatePoses> LoadState(const std::string& path, const OfflineFleet& fleet,
                             WhoseState required);

struct PlanFiles {
  std::string targets;
  std::string from;  // for messages: the source of `state`
  PlanOptions plan = {};
  std::uint32_t sectors = 1;
  const Compensation* compensation = nullptr;  // null: units receive their targets unchanged
};
struct OfflinePlan {
  Plan plan;
  StatePoses targets;
  std::size_t targeted = 0;
  std::uint32_t sectors = 1;    // fewer than asked for where some had to be merged
  std::size_t compensated = 0;  // units whose commands are the model's for their target
  std::vector<PositionerIndex> beyond_range = {};  // out of their axes' range: they stay
  [[nodiscard]] std::size_t served() const {
    return targeted - plan.unserved.size() - beyond_range.size();
  }
};
/// The plan from `state`, by each unit's count, to the targets; disabled units stand. With a
/// compensation, positions differ from counts as in the daemon: by the model's correction for each
/// unit's target.
/// Errors: as LoadFleet, and those of ResolveTargets and MakePlan.
Result<OfflinePlan> PlanOffline(const Context& context, const OfflineFleet& fleet,
                                const StatePoses& state, const PlanFiles& files);

/// The member `unserved` of the JSON summaries, and the lines for human readers, each after a line
/// break.
Json UnservedJson(const Plan& plan, const Layout& layout);
std::string DescribeUnserved(const Json& unserved);

}  // namespace focalfleet::cli
