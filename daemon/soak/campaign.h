// A campaign of nights: seeds one after the other, what each showed, and the table over all of
// them. Tasks on several machines each write one line of JSON a seed; the lines of all of them make
// the table that one run would have made. A task may be killed within a line: such a line counts
// for nothing, and the next task begins a line of its own. A seed that ran twice has two lines, and
// its newest one counts. The two are the same run where program and fleet are the same.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "daemon/control/messages.h"
#include "daemon/soak/night.h"
#include "protocol/base/result.h"

namespace focalfleet::soak {

struct SeedRange {
  std::uint64_t first = 1;
  std::uint64_t last = 1;
};
/// "7" or "1..200". Errors: kInvalid.
Result<SeedRange> ParseSeeds(const std::string& text);

/// The line of a seed: its result and which sites were armed.
Json JsonOf(const NightResult& result, const Draws& draws);

class Summary {
 public:
  /// Lines of seeds outside of `counted` count for nothing.
  explicit Summary(const SeedRange& counted = {0, UINT64_MAX}) : counted_(counted) {}

  /// The line takes the place of an earlier one of its seed. Errors: kInvalid: no line of a seed.
  Status Take(const Json& line);
  [[nodiscard]] std::size_t seeds() const { return seeds_.size(); }
  [[nodiscard]] bool has(std::uint64_t seed) const { return seeds_.contains(seed); }
  /// Seeds that broke a rule, with the first of its reasons.
  [[nodiscard]] std::map<std::uint64_t, std::string> Failed() const;
  /// Seeds with lines of several digests. True: of one commit of the program and one fleet, where a
  /// seed must be one run.
  [[nodiscard]] const std::map<std::uint64_t, bool>& differing() const { return differing_; }
  /// Sites that were armed often enough and never reached.
  [[nodiscard]] std::vector<std::string> NeverReached() const;
  /// No seed broke a rule or was two runs, and every site was reached.
  [[nodiscard]] bool Good() const;
  /// The table, for people.
  [[nodiscard]] std::string Table() const;

 private:
  static constexpr std::size_t kSums = 8;
  struct Seed {
    std::string program;
    std::string digest;
    std::uint64_t units = 0;
    std::string broken;  // the first reason
    bool ok = true;
    std::map<std::string, std::uint64_t> reached;
    std::vector<std::string> armed;
    std::array<double, kSums> sums{};
  };
  static const std::array<const char*, kSums> kSumNames;
  static Seed Read(const Json& line);
  [[nodiscard]] std::map<std::string, std::uint64_t> Reached() const;
  [[nodiscard]] std::map<std::string, std::uint64_t> Armed() const;

  SeedRange counted_;
  std::map<std::uint64_t, Seed> seeds_;
  std::map<std::uint64_t, bool> differing_;
};

struct CampaignOptions {
  SeedRange seeds;
  std::optional<double> minutes;  // of real time; then it ends after the seed under way
  std::optional<std::uint32_t> units;
  std::string json_folder;  // empty: none is written
  bool twice = false;       // each seed must be the same run again
  bool replay = false;      // each step must be decided again as it was
  bool tell = false;        // a line for each change of state
  std::function<void(const std::string&)> print;
};
/// Runs the seeds. Errors: the folder cannot be written.
Result<Summary> RunCampaign(const CampaignOptions& options);

/// The lines of these seeds in all files of the folder, in order of the files' last changes.
/// Errors: a file that is no list of seeds.
Result<Summary> MergeFolder(const std::string& folder, const SeedRange& seeds);

}  // namespace focalfleet::soak
