// The command reproduce compares each claim of the paper behind the drive with its simulation.

#include <fmt/format.h>

#include <algorithm>

#include "daemon/cli/progress_bar.h"
#include "daemon/report/page.h"
#include "daemon/study/claims_report.h"
#include "daemon/study/study.h"
#include "sim/drive/reproduction/reproduce.h"

namespace focalfleet::cli {
namespace {

using sim::ClaimCurve;
using sim::Reproduction;

struct ReproduceCommandOptions {
  std::string out;
  std::string wave_set = "9";
  std::vector<std::string> start_sets;
  double resistance_factor = 1;
  bool full = false;
  std::uint64_t seed = 1;
};

report::Axis AxisX(std::string_view figure) {
  if (figure == "SNR over carrier") return {.label = "carrier", .unit = "kHz", .log = true};
  if (figure == "torque ripple over subdivision")
    return {.label = "vectors an electrical turn", .unit = "", .log = true};
  if (figure == "what a wrong stored vector costs")
    return {.label = "stored vector less the rotor's place", .unit = "deg electrical"};
  return {.label = "V_bus", .unit = "V"};
}

report::Axis AxisY(std::string_view figure) {
  if (figure == "SNR over carrier") return {.label = "SNR", .unit = "dB"};
  if (figure == "torque ripple over subdivision")
    return {.label = "ripple of the torque", .unit = "% rms", .log = true};
  if (figure == "what a wrong stored vector costs")
    return {.label = "believed less true", .unit = "um at the arm"};
  if (figure == "V_bus n over V_bus") return {.label = "V_bus n", .unit = "V"};
  return {.label = "critical n", .unit = ""};
}

std::string PageOf(const Reproduction& reproduction, const ReproduceCommandOptions& options) {
  report::Page page("What the paper claims, and what its simulation says");
  page.Paragraph(fmt::format(
      "Scientific Reports 2022, s41598-022-06214-7: open-loop SVPWM of a 4 mm motor. Waves: set "
      "{}; "
      "phase resistance times {:g}. Statuses: reproduced without tuning on it; ordering: only the "
      "order comes out; fitted: the named parameter was set so that it comes out; disagrees: both "
      "numbers and the likely reason; not testable.",
      options.wave_set, options.resistance_factor));
  AddStatusTable(reproduction.claims, &page);

  page.Heading("Curves");
  std::vector<std::string> figures;
  for (const ClaimCurve& curve : reproduction.curves)
    if (std::find(figures.begin(), figures.end(), curve.figure) == figures.end())
      figures.push_back(curve.figure);
  for (const std::string& figure : figures) {
    report::LinePlot plot{.title = figure, .x = AxisX(figure), .y = AxisY(figure)};
    for (const ClaimCurve& curve : reproduction.curves)
      if (curve.figure == figure)
        plot.series.push_back({.name = curve.name, .x = curve.x, .y = curve.y});
    page.Plot(report::DrawLines(plot));
  }

  AddClaimTable(reproduction.claims, &page);
  return page.Html();
}

ExitCode RunReproduce(const Context& context, const ReproduceCommandOptions& options) {
  if (const auto made = MakeClaimsFolder(options.out); !made) return Report(context, made.error());
  sim::ReproduceOptions wanted{.wave_set = options.wave_set,
                               .resistance_factor = options.resistance_factor,
                               .full = options.full,
                               .seed = options.seed};
  if (!options.start_sets.empty())
    wanted.start_sets.assign(options.start_sets.begin(), options.start_sets.end());
  Reproduction reproduction;
  {
    ProgressBar bar(context);
    reproduction = sim::Reproduce(wanted, [&](double share, std::string_view next) {
      bar.Show(share, "reproducing", std::string(next));
    });
  }
  return DeliverClaims(context, reproduction.claims, PageOf(reproduction, options), options.out);
}

}  // namespace

void AddReproduceCommand(CommandLine* line) {
  CLI::App* command =
      AddCommand(&line->app, "reproduce", "Simulate what the drive's paper claims, claim by claim",
                 "  focalfleet reproduce --out claims\n"
                 "  focalfleet reproduce --out warm --resistance-factor 1.1 --start-sets C,9");
  auto options = std::make_shared<ReproduceCommandOptions>();
  std::vector<std::string> sets;
  for (const sim::ParameterSet& set : sim::kParameterSets) sets.emplace_back(set.name);
  command
      ->add_option("--out", options->out, "Folder for claims.json and report.html; made if missing")
      ->required()
      ->type_name("DIR");
  OneOf(command->add_option("--set", options->wave_set, "Parameter set of the waves"), sets)
      ->capture_default_str();
  OneOf(command->add_option("--start-sets", options->start_sets,
                            "Parameter sets of the starts (default: all)"),
        sets)
      ->delimiter(',');
  command
      ->add_option("--resistance-factor", options->resistance_factor,
                   "Every phase resistance times this")
      ->check(NumberBetween(0.1, 10))
      ->capture_default_str();
  command->add_flag("--full", options->full,
                    "Search every critical n and make the 12 moves (with it, and one less) at PWM "
                    "level: some 20 minutes of CPU time, not seconds");
  command->add_option("--seed", options->seed, "Of what is drawn in the positioning claims")
      ->capture_default_str();
  OnChosen(line, command, options, RunReproduce);
}

}  // namespace focalfleet::cli
