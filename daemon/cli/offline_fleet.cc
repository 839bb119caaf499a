#include "daemon/cli/offline_fleet.h"

#include <fmt/format.h>

#include "daemon/cli/command_line.h"
#include "daemon/cli/text_file.h"
#include "fleet/files/layout_file.h"
#include "fleet/files/obstacles_file.h"
#include "fleet/files/state_file.h"

namespace focalfleet::cli {

void AddFleetFiles(CLI::App* command, FleetFiles* files) {
  AddFile(command, "--units", &files->units, "units.csv: the focal plane")->required();
  AddFile(command, "--obstacles", &files->obstacles,
          "obstacles.csv: what stands still on the plate");
  command
      ->add_option("--clearance-mm", files->clearance_mm,
                   "Distance to keep between arms (default: 0.012 of the pitch)")
      ->check(NumberBetween(0, 1000));
}

Result<OfflineFleet> LoadFleet(const Context& context, const FleetFiles& files) {
  FOCALFLEET_TRY_ASSIGN(const std::string text, ReadTextFile(files.units));
  Layout::Options options{.clearance_mm = files.clearance_mm};
  if (!files.obstacles.empty()) {
    FOCALFLEET_TRY_ASSIGN(const std::string obstacles, ReadTextFile(files.obstacles));
    FOCALFLEET_TRY_ASSIGN(options.obstacles, ReadObstacles(obstacles, files.obstacles));
  }
  // A misspelt column is one that nobody reads: it must not pass in silence.
  FOCALFLEET_TRY_ASSIGN(const UnitsFile units, ReadUnits(text, files.units));
  TellPassedOver(context, files.units, units.ignored_columns);
  FOCALFLEET_TRY_ASSIGN(Layout layout, ReadLayout(text, files.units, std::move(options)));
  std::vector<UnitDrive> drives(layout.size());
  return OfflineFleet{std::move(layout), std::move(drives)};
}

Result<std::vector<std::optional<Pose>>> LoadState(const std::string& path,
                                                   const OfflineFleet& fleet) {
  FOCALFLEET_TRY_ASSIGN(const std::string text, ReadTextFile(path));
  return ReadState(text, path, fleet.layout, fleet.drives);
}

}  // namespace focalfleet::cli
