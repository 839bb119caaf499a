// The command retarget UNIT X_MM Y_MM gives another target to one unit of the configuration that is
// under way.

#include <fmt/format.h>

#include "daemon/cli/client.h"
#include "daemon/cli/command_line.h"
#include "daemon/cli/each_unit.h"
#include "daemon/control/id_ranges.h"

namespace focalfleet::cli {
namespace {

struct RetargetOptions {
  std::string units;  // as 7,20-25
  double first = 0;
  double second = 0;
  bool angles = false;
};

ExitCode RunRetarget(const Context& context, const RetargetOptions& options) {
  const auto units = ParseRanges(options.units);
  if (!units) return Report(context, units.error(), ExitCode::kUsage);
  if (units->size() > 1 && !options.angles)
    return Report(context,
                  {ErrorCode::kInvalid,
                   "retarget: a place belongs to one unit; several units share --angles alone"},
                  ExitCode::kUsage);
  const auto tell = [&context](std::uint32_t id, Json* answer) {
    const std::string text = TextIn(*answer, "text");
    if (answer->value("goes", false)) {
      Say(context, text);
      return true;
    }
    // The unit was stopped for the new target, so the failure is no refusal that changed nothing.
    Complain(fmt::format("focalfleet: unit {} does not go: {}\n", id, text));
    return false;
  };
  // The answer comes when the unit starts: it may have to stop first, and waits for other units
  // that stop.
  return AskForEach(context, *units,
                    {.verb = "retarget",
                     .args = {{options.angles ? "theta_deg" : "x_mm", options.first},
                              {options.angles ? "phi_deg" : "y_mm", options.second}},
                     .long_lasting = true,
                     .tell = tell});
}

}  // namespace

void AddRetargetCommand(CommandLine* line) {
  CLI::App* command = AddCommand(
      &line->app, "retarget", "Give one unit another target while the others move",
      "  focalfleet retarget 4711 103.25 -41.5\n  focalfleet retarget 4711 35 120 --angles");
  auto options = std::make_shared<RetargetOptions>();
  command->add_option("UNIT", options->units, "Its unit_id; with --angles also 7,20-25")
      ->required();
  command->add_option("X_MM", options->first, "Place in the focal plane")
      ->required()
      ->check(NumberBetween(-1e6, 1e6));
  command->add_option("Y_MM", options->second, "Place in the focal plane")
      ->required()
      ->check(NumberBetween(-1e6, 1e6));
  command->add_flag("--angles", options->angles, "The two are theta_deg and phi_deg instead");
  OnChosen(line, command, options, RunRetarget);
}

}  // namespace focalfleet::cli
