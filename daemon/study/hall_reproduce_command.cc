// The command hall reproduce compares the claims of the paper behind the Hall sensors with its
// simulation.

#include <fmt/format.h>

#include <algorithm>

#include "daemon/study/claims_report.h"
#include "daemon/study/hall_options.h"
#include "sim/hall/reproduction/hall_reproduce.h"

namespace focalfleet::cli {
namespace {

struct HallReproduceCommandOptions {
  std::string out;
  std::uint64_t seed = 1;
};

report::Axis AxisX(const std::string& figure) {
  if (figure.starts_with("figure 6") || figure.find("along theta") != std::string::npos)
    return {.label = "theta", .unit = "deg"};
  if (figure.find("obliquely") != std::string::npos)
    return {.label = "phi + theta / 2", .unit = "deg"};
  if (figure.starts_with("figure 8")) return {.label = "phi", .unit = "deg"};
  return {.label = "actual", .unit = "deg"};
}

report::Axis AxisY(const std::string& figure) {
  if (figure.starts_with("figure 6"))
    return {.label = "slope of the radial field", .unit = "mT/deg"};
  if (figure.find("obliquely") != std::string::npos)
    return {.label = "radial field + 1 mT a deg of theta", .unit = "mT"};
  if (figure.starts_with("figure 8")) return {.label = "radial field", .unit = "mT"};
  return {.label = "found", .unit = "deg"};
}

std::string PageOf(const sim::Reproduction& reproduction) {
  report::Page page("What the paper on Hall sensors claims, and what its simulation says");
  page.Paragraph(
      "Scientific Reports 2014, srep06756: orientation of a spherical rotor from Hall sensors "
      "around a 2D and a 3D magnet array. The fields are computed from magnetised pieces. "
      "Statuses: reproduced without tuning on it; ordering: only the order comes out; fitted: the "
      "named parameter was set so that it comes out; disagrees: both numbers and the likely "
      "reason; not testable.");
  AddStatusTable(reproduction.claims, &page);
  page.Heading("Curves");
  std::vector<std::string> figures;
  for (const sim::ClaimCurve& curve : reproduction.curves)
    if (std::find(figures.begin(), figures.end(), curve.figure) == figures.end())
      figures.push_back(curve.figure);
  std::sort(figures.begin(), figures.end());
  for (const std::string& figure : figures) {
    report::LinePlot plot{.title = figure, .x = AxisX(figure), .y = AxisY(figure)};
    for (const sim::ClaimCurve& curve : reproduction.curves)
      if (curve.figure == figure)
        plot.series.push_back({.name = curve.name, .x = curve.x, .y = curve.y});
    if (figure.starts_with("figure 6")) plot.vertical = {{75.1508, "75.15"}, {73.0294, "73.03"}};
    page.Plot(report::DrawLines(plot));
  }
  AddClaimTable(reproduction.claims, &page);
  return page.Html();
}

ExitCode RunHallReproduce(const Context& context, const HallReproduceCommandOptions& options) {
  if (const auto made = MakeClaimsFolder(options.out); !made) return Report(context, made.error());
  const sim::Reproduction reproduction = sim::ReproduceHall({.seed = options.seed});
  return DeliverClaims(context, reproduction.claims, PageOf(reproduction), options.out);
}

}  // namespace

void AddHallReproduce(CommandLine* line, CLI::App* hall) {
  CLI::App* command =
      AddCommand(hall, "reproduce", "Simulate what the Hall sensors' paper claims, claim by claim",
                 "  focalfleet hall reproduce --out claims");
  auto options = std::make_shared<HallReproduceCommandOptions>();
  command
      ->add_option("--out", options->out, "Folder for claims.json and report.html; made if missing")
      ->required()
      ->type_name("DIR");
  command->add_option("--seed", options->seed, "Of poses and noise")->capture_default_str();
  OnChosen(line, command, options, RunHallReproduce);
}

}  // namespace focalfleet::cli
