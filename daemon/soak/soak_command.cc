#include "daemon/soak/soak_command.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <cstdio>

#include "daemon/cli/context.h"
#include "daemon/cli/exit_code.h"
#include "daemon/soak/campaign.h"

namespace focalfleet::soak {
namespace {

using cli::ExitCode;

int ComplainOf(const Error& error, ExitCode code) {
  std::fprintf(stderr, "focalfleet-sim: %s\n", error.text.c_str());
  return static_cast<int>(code);
}

/// Seeds of the range that no file has.
std::vector<std::uint64_t> NeverRan(const Summary& summary, const SeedRange& range) {
  std::vector<std::uint64_t> missing;
  for (std::uint64_t seed = range.first; seed <= range.last; ++seed)
    if (!summary.has(seed)) missing.push_back(seed);
  return missing;
}

std::string RangesOf(const std::vector<std::uint64_t>& seeds) {
  std::string text;
  for (std::size_t n = 0; n < seeds.size();) {
    std::size_t end = n;
    while (end + 1 < seeds.size() && seeds[end + 1] == seeds[end] + 1) ++end;
    text += (text.empty() ? "" : ",") + std::to_string(seeds[n]);
    if (end > n) text += ".." + std::to_string(seeds[end]);
    n = end + 1;
  }
  return text;
}

int Report(const Summary& summary, const std::vector<std::uint64_t>& missing) {
  std::string text = summary.Table();
  if (!missing.empty()) text += fmt::format("never ran: {}\n", RangesOf(missing));
  cli::PrintText(text);
  return static_cast<int>(summary.Good() && missing.empty() ? ExitCode::kOk : ExitCode::kRefused);
}

int RunWeek(std::uint64_t seed, const SoakOptions& options) {
  constexpr std::uint32_t kKeepDays = 3;  // so that pruning shows within the week
  const auto print = [](const std::string& line) {
    std::fprintf(stdout, "%s\n", line.c_str());
    std::fflush(stdout);
  };
  DrawLimits limits{.units = {}, .faults = false};
  if (options.units > 0) limits.units = options.units;
  print(WeekColumns());
  const NightResult result = Night(DrawSeed(seed, limits), {.keep_days = kKeepDays})
                                 .RunWeek({.configurations = options.week},
                                          [&](const WeekSizes& sizes) { print(WeekLine(sizes)); });
  for (const std::string& broken : result.broken)
    std::fprintf(stderr, "focalfleet-sim: seed %llu %s\n", static_cast<unsigned long long>(seed),
                 broken.c_str());
  return static_cast<int>(result.ok() ? ExitCode::kOk : ExitCode::kRefused);
}

}  // namespace

CLI::App* AddSoak(CLI::App* app, SoakOptions* options) {
  CLI::App* soak = app->add_subcommand(
      "soak", "Live through nights of the whole system, with kills and faults drawn from seeds");
  soak->footer(
      "  focalfleet-sim soak --seeds 1..200\n"
      "  focalfleet-sim soak --seeds 17 --tell\n"
      "  focalfleet-sim soak --seeds 1 --week 1000 --units 5000 > week.csv\n"
      "  focalfleet-sim soak --seeds 1..200 --merge results");
  soak->add_option("--seeds", options->seeds, "FIRST..LAST, or one seed")
      ->required()
      ->type_name("RANGE");
  soak->add_option("--minutes", options->minutes, "No seed begins after so many minutes")
      ->check(CLI::Range(0.01, 1e6));
  soak->add_option("--units", options->units, "Every fleet has so many units (otherwise drawn)")
      ->check(CLI::Range(2, 5000));
  soak->add_option("--json", options->json_folder,
                   "Folder to which one line of JSON a seed is appended")
      ->type_name("DIR");
  soak->add_option("--week", options->week,
                   "A week of nights without faults instead: so many configurations over seven "
                   "lives, and a line of CSV with the sizes of memory and disk after each")
      ->check(CLI::Range(1, 1'000'000))
      ->excludes("--minutes")
      ->excludes("--json")
      ->type_name("CONFIGURATIONS");
  soak->add_option("--merge", options->merge_folder,
                   "Run nothing: make the table of the lines in this folder, and name seeds of the "
                   "range that never ran")
      ->type_name("DIR");
  soak->add_flag("--twice", options->twice, "Run each seed again: it must be the same run");
  soak->add_flag("--replay", options->replay,
                 "Take each step again from its record: it must be decided the same");
  soak->add_flag("--tell", options->tell,
                 "A line for each change of state, and the log of the daemon");
  return soak;
}

int RunSoak(const SoakOptions& options) {
  const auto seeds = ParseSeeds(options.seeds);
  if (!seeds) return ComplainOf(seeds.error(), ExitCode::kUsage);
  if (!options.merge_folder.empty()) {
    const auto merged = MergeFolder(options.merge_folder, *seeds);
    if (!merged) return ComplainOf(merged.error(), ExitCode::kRefused);
    return Report(*merged, NeverRan(*merged, *seeds));
  }
  spdlog::set_level(spdlog::level::off);
  if (options.week > 0 && (seeds->first != seeds->last || options.twice || options.replay))
    return ComplainOf({ErrorCode::kInvalid, "--week takes one seed, and runs it once"},
                      ExitCode::kUsage);
  if (options.week > 0) return RunWeek(seeds->first, options);
  CampaignOptions campaign{.seeds = *seeds,
                           .minutes = {},
                           .units = {},
                           .json_folder = options.json_folder,
                           .twice = options.twice,
                           .replay = options.replay,
                           .tell = options.tell};
  if (options.minutes > 0) campaign.minutes = options.minutes;
  if (options.units > 0) campaign.units = options.units;
  campaign.print = [](const std::string& line) {
    std::fprintf(stdout, "%s\n", line.c_str());
    std::fflush(stdout);
  };
  const auto summary = RunCampaign(campaign);
  if (!summary) return ComplainOf(summary.error(), ExitCode::kRefused);
  return Report(*summary, {});
}

}  // namespace focalfleet::soak
