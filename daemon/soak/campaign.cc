#include "daemon/soak/campaign.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <system_error>

#include "daemon/clock/process_time.h"

namespace focalfleet::soak {
namespace {

/// A site that was armed in fewer seeds may have been missed by chance.
constexpr std::uint64_t kArmedEnough = 20;

/// Sums that the table has.
constexpr const char* kSums[] = {"virtual_s",      "lives",  "steps",   "commits",
                                 "commits_failed", "frames", "answers", "units_begun"};

bool ParseNumber(std::string_view text, std::uint64_t* out) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), *out);
  return error == std::errc() && end == text.data() + text.size();
}

}  // namespace

Result<SeedRange> ParseSeeds(const std::string& text) {
  SeedRange range;
  const std::size_t dots = text.find("..");
  const bool good = ParseNumber(text.substr(0, dots), &range.first) &&
                    (dots == std::string::npos || ParseNumber(text.substr(dots + 2), &range.last));
  if (dots == std::string::npos) range.last = range.first;
  if (!good || range.last < range.first)
    return Fail(ErrorCode::kInvalid, "--seeds " + text + ": FIRST..LAST is expected");
  return range;
}

Json JsonOf(const NightResult& result, const Draws& draws) {
  Json reached = Json::object(), armed = Json::array();
  for (std::size_t site = 0; site < kFaultSites; ++site) {
    if (result.reached[site] > 0) reached[kFaultSiteNames[site]] = result.reached[site];
    if (draws.armed[site]) armed.push_back(kFaultSiteNames[site]);
  }
  return {{"seed", result.seed},
          {"ok", result.ok()},
          {"digest", fmt::format("{:016x}", result.digest)},
          {"broken", result.broken},
          {"units", draws.units},
          {"virtual_s", result.virtual_s},
          {"lives", result.lives},
          {"steps", result.steps},
          {"commits", result.commits},
          {"commits_failed", result.commits_failed},
          {"frames", result.frames},
          {"answers", result.answers},
          {"units_begun", result.units_begun},
          {"reached", std::move(reached)},
          {"armed", std::move(armed)}};
}

Status Summary::Take(const Json& line) {
  const auto wrong = [] { return Fail(ErrorCode::kInvalid, "this is no line of a seed"); };
  if (!line.is_object() || !line.contains("seed") || !line["seed"].is_number_unsigned())
    return wrong();
  const auto seed = line["seed"].get<std::uint64_t>();
  if (seeds_.contains(seed)) return {};  // a task that was run again
  try {
    seeds_[seed] = line.at("digest").get<std::string>();
    if (!line.at("ok").get<bool>())
      failed_[seed] = line.at("broken").empty() ? "" : line.at("broken")[0].get<std::string>();
    for (const auto& [site, count] : line.at("reached").items())
      reached_[site] += count.get<std::uint64_t>();
    for (const Json& site : line.at("armed")) ++armed_[site.get<std::string>()];
    for (const char* sum : kSums) sums_[sum] += line.at(sum).get<double>();
  } catch (const Json::exception&) {
    return wrong();
  }
  return {};
}

std::vector<std::string> Summary::NeverReached() const {
  std::vector<std::string> never;
  for (const auto& [site, seeds] : armed_)
    if (seeds >= kArmedEnough && !reached_.contains(site)) never.push_back(site);
  return never;
}

std::string Summary::Table() const {
  std::string table = fmt::format("{:<22} {:>8} {:>10}\n", "site", "seeds", "reached");
  for (const char* site : kFaultSiteNames) {
    const auto count = reached_.find(site);
    const auto armed = armed_.find(site);
    table += fmt::format("{:<22} {:>8} {:>10}\n", site, armed == armed_.end() ? 0 : armed->second,
                         count == reached_.end() ? 0 : count->second);
  }
  for (const auto& [sum, value] : sums_) table += fmt::format("{:<22} {:>19.0f}\n", sum, value);
  table += fmt::format("{} seeds, {} of them broke a rule\n", seeds_.size(), failed_.size());
  for (const auto& [seed, why] : failed_) table += fmt::format("seed {}: {}\n", seed, why);
  for (const std::string& site : NeverReached())
    table += fmt::format("{} was armed and never reached\n", site);
  return table;
}

Result<Summary> RunCampaign(const CampaignOptions& options) {
  const auto begun = std::chrono::steady_clock::now();
  const double cpu_begun_s = ProcessCpuSeconds();
  const auto minutes = [&] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count() / 60;
  };
  std::ofstream out;
  if (!options.json_folder.empty()) {
    std::error_code failed;
    std::filesystem::create_directories(options.json_folder, failed);
    const std::string path = fmt::format("{}/seeds-{}-{}.jsonl", options.json_folder,
                                         options.seeds.first, options.seeds.last);
    out.open(path, std::ios::app);
    if (!out) return Fail(ErrorCode::kUnavailable, "cannot write " + path);
  }
  Summary summary;
  for (std::uint64_t seed = options.seeds.first; seed <= options.seeds.last; ++seed) {
    if (options.minutes && minutes() >= *options.minutes) break;
    const Draws draws = DrawSeed(seed, {.units = options.units});
    options.print(Describe(draws));
    NightOptions night{.replay = options.replay};
    if (options.tell) night.tell = night.log = options.print;
    NightResult result = Night(draws, night).Run();
    if (options.twice) {
      const NightResult again = Night(draws, {}).Run();
      if (again.digest != result.digest || again.frames != result.frames)
        result.broken.push_back("the second run of this seed is another one");
    }
    for (const std::string& broken : result.broken)
      options.print(fmt::format("seed {} BROKEN {}", seed, broken));
    if (result.ok())
      options.print(fmt::format("seed {} passed: {:.0f} s, {} lives, {} commits, digest {:016x}",
                                seed, result.virtual_s, result.lives, result.commits,
                                result.digest));
    const Json line = JsonOf(result, draws);
    if (out.is_open()) out << line.dump() << '\n' << std::flush;
    FOCALFLEET_TRY(summary.Take(line));
  }
  options.print(fmt::format("{:.1f} seeds a minute, {:.2f} s of CPU a seed",
                            static_cast<double>(summary.seeds()) / std::max(minutes(), 1e-9),
                            (ProcessCpuSeconds() - cpu_begun_s) /
                                static_cast<double>(std::max<std::size_t>(summary.seeds(), 1))));
  return summary;
}

Result<Summary> MergeFolder(const std::string& folder) {
  std::error_code failed;
  std::vector<std::string> paths;
  for (const auto& entry : std::filesystem::directory_iterator(folder, failed))
    if (entry.path().extension() == ".jsonl") paths.push_back(entry.path().string());
  if (failed) return Fail(ErrorCode::kUnavailable, folder + ": " + failed.message());
  std::ranges::sort(paths);
  Summary summary;
  for (const std::string& path : paths) {
    std::ifstream in(path);
    std::string line;
    for (int number = 1; std::getline(in, line); ++number) {
      const Json json = Json::parse(line, nullptr, false);
      // The last line of a task that was killed may be cut short: its seed never ran.
      if (json.is_discarded() && in.peek() == std::ifstream::traits_type::eof()) continue;
      const Status taken = summary.Take(json);
      if (!taken)
        return Fail(ErrorCode::kInvalid,
                    fmt::format("{}:{}: {}", path, number, taken.error().text));
    }
  }
  return summary;
}

}  // namespace focalfleet::soak
