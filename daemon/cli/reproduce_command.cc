// reproduce: what the paper behind the drive claims, and what its simulation says to each claim.

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <map>

#include "daemon/cli/command_line.h"
#include "daemon/cli/progress_bar.h"
#include "daemon/cli/table.h"
#include "daemon/files/text_file.h"
#include "daemon/report/page.h"
#include "sim/reproduction/reproduce.h"

namespace focalfleet::cli {
namespace {

using sim::Claim;
using sim::ClaimCurve;
using sim::ClaimStatus;
using sim::Reproduction;

constexpr ClaimStatus kStatuses[] = {ClaimStatus::kReproduced, ClaimStatus::kOrdering,
                                     ClaimStatus::kFitted, ClaimStatus::kDisagrees,
                                     ClaimStatus::kNotTestable};

struct ReproduceCommandOptions {
  std::string out;
  std::string wave_set = "9";
  std::vector<std::string> start_sets;
  double resistance_factor = 1;
  bool full = false;
  std::uint64_t seed = 1;
};

// One number stands alone, more are a list; what is not finite is null, as JSON has no other word.
Json Numbers(const std::vector<double>& numbers) {
  const auto one = [](double number) {
    return std::isfinite(number) ? Json(number) : Json(nullptr);
  };
  if (numbers.empty()) return nullptr;
  if (numbers.size() == 1) return one(numbers.front());
  Json list = Json::array();
  for (const double number : numbers) list.push_back(one(number));
  return list;
}

std::string Text(const std::vector<double>& numbers) {
  std::string text;
  for (const double number : numbers)
    text += fmt::format("{}{:.5g}", text.empty() ? "" : ", ", number);
  return text;
}

Json ClaimsJson(const Reproduction& reproduction) {
  Json list = Json::array();
  for (const Claim& claim : reproduction.claims)
    list.push_back({{"id", claim.id},
                    {"text", claim.text},
                    {"paper", Numbers(claim.paper)},
                    {"simulated", Numbers(claim.simulated)},
                    {"unit", claim.unit},
                    {"conditions", claim.conditions},
                    {"status", Name(claim.status)},
                    {"reason", claim.reason}});
  return list;
}

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
  std::vector<std::vector<std::string>> counts;
  for (const ClaimStatus status : kStatuses)
    counts.push_back(
        {Name(status), std::to_string(std::count_if(
                           reproduction.claims.begin(), reproduction.claims.end(),
                           [&](const Claim& claim) { return claim.status == status; }))});
  page.Table({"status", "claims"}, counts, {report::Align::kLeft, report::Align::kRight});

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

  page.Heading("Claims");
  std::vector<std::vector<std::string>> rows;
  for (const Claim& claim : reproduction.claims)
    rows.push_back(
        {claim.text, Text(claim.paper), Text(claim.simulated), claim.unit, Name(claim.status),
         claim.reason.empty() ? claim.conditions : claim.conditions + ". " + claim.reason});
  page.Table({"claim", "paper", "simulated", "unit", "status", "conditions and reason"}, rows);
  return page.Html();
}

ExitCode RunReproduce(const Context& context, const ReproduceCommandOptions& options) {
  std::error_code failed;
  std::filesystem::create_directories(options.out, failed);
  if (failed)
    return Report(context, Error{ErrorCode::kUnavailable,
                                 fmt::format("{}: {}", options.out, failed.message())});
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
  const Json claims = ClaimsJson(reproduction);
  const std::filesystem::path folder(options.out);
  const std::string claims_path = folder / "claims.json";
  const std::string page_path = folder / "report.html";
  for (const auto& [path, text] : {std::pair(claims_path, claims.dump(2) + "\n"),
                                   std::pair(page_path, PageOf(reproduction, options))})
    if (const auto written = WriteFileAtomically(path, text); !written)
      return Report(context, written.error());

  std::map<std::string, int> counts;
  for (const Claim& claim : reproduction.claims) ++counts[Name(claim.status)];
  if (context.json) {
    Json object{{"claims", claims}, {"statuses", counts}, {"out", options.out}};
    PrintJson(object);
  }
  std::vector<std::vector<std::string>> rows = {{"claim", "status", "paper", "simulated", "unit"}};
  for (const Claim& claim : reproduction.claims)
    rows.push_back(
        {claim.id, Name(claim.status), Text(claim.paper), Text(claim.simulated), claim.unit});
  Say(context, AlignColumns(rows));
  std::string summary;
  for (const ClaimStatus status : kStatuses)
    summary +=
        fmt::format("{}{} {}", summary.empty() ? "" : ", ", counts[Name(status)], Name(status));
  Say(context, fmt::format("{}: {}", page_path, summary));
  return ExitCode::kOk;
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
