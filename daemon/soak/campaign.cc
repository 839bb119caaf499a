#include "daemon/soak/campaign.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <system_error>

#include "daemon/clock/process_time.h"
#include "daemon/usage/build_version.h"

namespace focalfleet::soak {
namespace {

/// A site that was armed in fewer seeds may have been missed by chance.
constexpr std::uint64_t kArmedEnough = 20;

bool ParseNumber(std::string_view text, std::uint64_t* out) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), *out);
  return error == std::errc() && end == text.data() + text.size();
}

/// Builds of changed trees have one version and may be different programs.
bool NamesOneProgram(const std::string& version) {
  return version.find("+g") != std::string::npos && !version.ends_with("-changed");
}

/// A task that was killed left a line without an end.
bool EndsInMidLine(const std::string& path) {
  std::ifstream in(path, std::ios::binary | std::ios::ate);
  if (!in || in.tellg() <= 0) return false;
  in.seekg(-1, std::ios::end);
  return in.get() != '\n';
}

Result<std::ofstream> OpenLines(const CampaignOptions& options) {
  std::error_code failed;
  std::filesystem::create_directories(options.json_folder, failed);
  const std::string path = fmt::format("{}/seeds-{}-{}.jsonl", options.json_folder,
                                       options.seeds.first, options.seeds.last);
  const bool cut = EndsInMidLine(path);
  std::ofstream out(path, std::ios::app);
  if (!out) return Fail(ErrorCode::kUnavailable, "cannot write " + path);
  if (cut) out << '\n' << std::flush;
  return out;
}

/// Files by their last changes; those of one instant by name.
Result<std::vector<std::string>> FilesOf(const std::string& folder) {
  std::vector<std::pair<std::filesystem::file_time_type, std::string>> files;
  std::error_code failed;
  for (const auto& entry : std::filesystem::directory_iterator(folder, failed))
    if (entry.path().extension() == ".jsonl")
      files.emplace_back(entry.last_write_time(failed), entry.path().string());
  if (failed) return Fail(ErrorCode::kUnavailable, folder + ": " + failed.message());
  std::ranges::sort(files);
  std::vector<std::string> paths;
  for (auto& [changed, path] : files) paths.push_back(std::move(path));
  return paths;
}

}  // namespace

constexpr std::array<const char*, Summary::kSums> Summary::kSumNames{
    "virtual_s", "lives", "steps", "commits", "commits_failed", "frames", "answers", "units_begun"};

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
          {"program", BuildVersion()},
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

Summary::Seed Summary::Read(const Json& line) {
  Seed seed{.program = line.value("program", ""),
            .digest = line.at("digest").get<std::string>(),
            .units = line.at("units").get<std::uint64_t>(),
            .broken = {},
            .ok = line.at("ok").get<bool>(),
            .reached = line.at("reached").get<std::map<std::string, std::uint64_t>>(),
            .armed = line.at("armed").get<std::vector<std::string>>()};
  if (!line.at("broken").empty()) seed.broken = line.at("broken")[0].get<std::string>();
  for (std::size_t n = 0; n < kSums; ++n) seed.sums[n] = line.at(kSumNames[n]).get<double>();
  return seed;
}

Status Summary::Take(const Json& line) {
  const auto wrong = [] { return Fail(ErrorCode::kInvalid, "this is no line of a seed"); };
  if (!line.is_object() || !line.contains("seed") || !line["seed"].is_number_unsigned())
    return wrong();
  const auto number = line["seed"].get<std::uint64_t>();
  try {
    Seed seed = Read(line);
    if (number < counted_.first || number > counted_.last) return {};
    const auto [before, fresh] = seeds_.try_emplace(number, seed);
    if (fresh) return {};
    if (before->second.digest != seed.digest) {
      const bool same = before->second.program == seed.program && NamesOneProgram(seed.program) &&
                        before->second.units == seed.units;
      bool& must_not = differing_[number];
      must_not = must_not || same;
    }
    before->second = std::move(seed);
  } catch (const Json::exception&) {
    return wrong();
  }
  return {};
}

std::map<std::uint64_t, std::string> Summary::Failed() const {
  std::map<std::uint64_t, std::string> failed;
  for (const auto& [number, seed] : seeds_)
    if (!seed.ok) failed[number] = seed.broken;
  return failed;
}

std::map<std::string, std::uint64_t> Summary::Reached() const {
  std::map<std::string, std::uint64_t> reached;
  for (const auto& [number, seed] : seeds_)
    for (const auto& [site, count] : seed.reached) reached[site] += count;
  return reached;
}

std::map<std::string, std::uint64_t> Summary::Armed() const {
  std::map<std::string, std::uint64_t> armed;
  for (const auto& [number, seed] : seeds_)
    for (const std::string& site : seed.armed) ++armed[site];
  return armed;
}

std::vector<std::string> Summary::NeverReached() const {
  std::vector<std::string> never;
  const auto reached = Reached();
  for (const auto& [site, seeds] : Armed())
    if (seeds >= kArmedEnough && !reached.contains(site)) never.push_back(site);
  return never;
}

bool Summary::Good() const {
  return std::ranges::all_of(seeds_, [](const auto& seed) { return seed.second.ok; }) &&
         std::ranges::none_of(differing_, [](const auto& seed) { return seed.second; }) &&
         NeverReached().empty();
}

std::string Summary::Table() const {
  std::string table = fmt::format("{:<22} {:>8} {:>10}\n", "site", "seeds", "reached");
  const auto reached = Reached(), armed = Armed();
  for (const char* site : kFaultSiteNames) {
    const auto count = reached.find(site);
    const auto seeds = armed.find(site);
    table += fmt::format("{:<22} {:>8} {:>10}\n", site, seeds == armed.end() ? 0 : seeds->second,
                         count == reached.end() ? 0 : count->second);
  }
  std::map<std::string, double> sums;
  for (const auto& [number, seed] : seeds_)
    for (std::size_t n = 0; n < kSums; ++n) sums[kSumNames[n]] += seed.sums[n];
  for (const auto& [sum, value] : sums) table += fmt::format("{:<22} {:>19.0f}\n", sum, value);
  const auto failed = Failed();
  table += fmt::format("{} seeds, {} of them broke a rule\n", seeds_.size(), failed.size());
  for (const auto& [seed, why] : failed) table += fmt::format("seed {}: {}\n", seed, why);
  for (const auto& [seed, wrong] : differing_)
    table += fmt::format("seed {}: its lines differ{}; the newest counts\n", seed,
                         wrong ? ", though one program wrote them" : "");
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
    FOCALFLEET_TRY_ASSIGN(out, OpenLines(options));
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

Result<Summary> MergeFolder(const std::string& folder, const SeedRange& seeds) {
  FOCALFLEET_TRY_ASSIGN(const std::vector<std::string> paths, FilesOf(folder));
  Summary summary(seeds);
  for (const std::string& path : paths) {
    std::ifstream in(path);
    std::string line;
    for (int number = 1; std::getline(in, line); ++number) {
      const Json json = Json::parse(line, nullptr, false);
      // The line of a task that was killed is cut short: its seed did not run.
      if (json.is_discarded() && line.starts_with('{')) continue;
      const Status taken = summary.Take(json);
      if (!taken)
        return Fail(ErrorCode::kInvalid,
                    fmt::format("{}:{}: {}", path, number, taken.error().text));
    }
  }
  return summary;
}

}  // namespace focalfleet::soak
