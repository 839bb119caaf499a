// The command retarget UNIT X_MM Y_MM gives another target to one unit of the configuration that is
// under way.

#include <fmt/format.h>

#include "daemon/cli/client.h"
#include "daemon/cli/command_line.h"

namespace focalfleet::cli {
namespace {

struct RetargetOptions {
  std::uint32_t unit_id = 0;
  double first = 0;
  double second = 0;
  bool angles = false;
};

ExitCode RunRetarget(const Context& context, const RetargetOptions& options) {
  const Json args{{"unit_id", options.unit_id},
                  {options.angles ? "theta_deg" : "x_mm", options.first},
                  {options.angles ? "phi_deg" : "y_mm", options.second}};
  // The answer comes when the unit starts: it may have to stop first, and waits for other units
  // that stop.
  const auto answer = Ask(context, {.verb = "retarget", .args = args, .long_lasting = true});
  if (!answer) return Report(context, answer.error());
  const bool goes = answer->value("goes", false);
  const std::string text = answer->value("text", "");
  if (context.json) PrintJson(*answer);
  if (goes) {
    Say(context, text);
    return ExitCode::kOk;
  }
  // The unit was stopped for the new target, so the failure is no refusal that changed nothing.
  Complain(fmt::format("focalfleet: unit {} does not go: {}\n", options.unit_id, text));
  return ExitCode::kSomeUnserved;
}

}  // namespace

void AddRetargetCommand(CommandLine* line) {
  CLI::App* command = AddCommand(
      &line->app, "retarget", "Give one unit another target while the others move",
      "  focalfleet retarget 4711 103.25 -41.5\n  focalfleet retarget 4711 35 120 --angles");
  auto options = std::make_shared<RetargetOptions>();
  command->add_option("UNIT", options->unit_id, "Its unit_id")->required();
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
