// The command targets makes a random configuration without collisions, for load tests and for a
// first state.

#include <fmt/format.h>

#include "daemon/cli/command_line.h"
#include "daemon/cli/offline_fleet.h"
#include "daemon/files/text_file.h"
#include "fleet/files/state_file.h"
#include "fleet/files/targets_file.h"
#include "fleet/kinematics.h"
#include "fleet/targets.h"

namespace focalfleet::cli {
namespace {

struct TargetsOptions {
  FleetFiles files;
  std::uint64_t seed = 0;
  std::string from;
  std::string as = "targets";
  bool angles = false;
  std::string out;
};

using Poses = std::vector<std::optional<Pose>>;

// Disabled units stand at their poses of the state; without a state they are drawn, too.
Result<Poses> FixedPoses(const TargetsOptions& options, const OfflineFleet& fleet) {
  Poses fixed(fleet.layout.size());
  if (options.from.empty()) return fixed;
  FOCALFLEET_TRY_ASSIGN(const Poses state, LoadState(options.from, fleet, WhoseState::kDisabled));
  for (std::uint32_t i = 0; i < fixed.size(); ++i)
    if (!fleet.layout.unit({i}).enabled) fixed[i] = state[i];
  return fixed;
}

std::string TargetsText(const OfflineFleet& fleet, const Poses& enabled, bool angles) {
  Targets targets = TargetsOf(fleet.layout, fleet.drives, enabled);
  if (angles) return WriteTargets(targets);
  for (TargetRow& row : targets.rows) {
    const auto i = *fleet.layout.Find(row.unit);
    row.place = FibreAt(fleet.layout.unit(i), fleet.drives[i.value], *enabled[i.value]);
  }
  return WriteTargets(targets);
}

ExitCode RunTargets(const Context& context, const TargetsOptions& options) {
  const auto fleet = LoadFleet(context, options.files);
  if (!fleet) return Report(context, fleet.error());
  const auto fixed = FixedPoses(options, *fleet);
  if (!fixed) return Report(context, fixed.error());
  const auto drawn = DrawConfiguration(fleet->layout, fleet->drives, *fixed, Rng(options.seed));
  if (!drawn) return Report(context, drawn.error());

  const bool whole = options.as == "state";
  Poses poses(fleet->layout.size());
  std::size_t rows = 0;
  for (std::uint32_t i = 0; i < poses.size(); ++i) {
    if (!whole && !fleet->layout.unit({i}).enabled) continue;
    poses[i] = (*drawn)[i];
    ++rows;
  }
  const std::string text = whole ? WriteState(fleet->layout, fleet->drives, poses)
                                 : TargetsText(*fleet, poses, options.angles);
  if (const auto written = WriteFileAtomically(options.out, text); !written) {
    return Report(context, written.error());
  }
  if (context.json) {
    PrintJson({{"units", fleet->layout.size()},
               {"rows", rows},
               {"as", options.as},
               {"seed", options.seed},
               {"out", options.out}});
  }
  Say(context, fmt::format("{}: {} of {}", options.out, whole ? "state" : "targets",
                           Count(rows, "unit", "units")));
  return ExitCode::kOk;
}

}  // namespace

void AddTargetsCommand(CommandLine* line) {
  CLI::App* command = AddCommand(
      &line->app, "targets", "Draw a random configuration that is reachable and free of collisions",
      "  focalfleet targets --units units.csv --seed 1 --as state --out state.csv\n"
      "  focalfleet targets --units units.csv --seed 2 --from state.csv --out targets.csv");
  auto options = std::make_shared<TargetsOptions>();
  AddFleetFiles(command, &options->files);
  command->add_option("--seed", options->seed, "Same seed, same configuration")->required();
  AddFile(command, "--from", &options->from, "state.csv: disabled units stand there");
  OneOf(
      command->add_option("--as", options->as, "Targets of the enabled units, or where all stand"),
      {"targets", "state"})
      ->capture_default_str();
  command->add_flag("--angles", options->angles,
                    "Targets as theta_deg, phi_deg instead of x_mm, y_mm");
  AddFile(command, "--out", &options->out, "File to write")->required();
  OnChosen(line, command, options, RunTargets);
}

}  // namespace focalfleet::cli
