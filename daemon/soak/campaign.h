// A campaign of nights: seeds one after the other, what each showed, and the table over all of
// them. Tasks on several machines each write one line of JSON a seed; the lines of all of them make
// the table that one run would have made.
#pragma once

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
  /// Errors: kInvalid: no line of a seed.
  Status Take(const Json& line);
  [[nodiscard]] std::size_t seeds() const { return seeds_.size(); }
  [[nodiscard]] bool has(std::uint64_t seed) const { return seeds_.contains(seed); }
  /// Seeds that broke a rule, with the first of its reasons.
  [[nodiscard]] const std::map<std::uint64_t, std::string>& failed() const { return failed_; }
  /// Sites that were armed often enough and never reached.
  [[nodiscard]] std::vector<std::string> NeverReached() const;
  /// The table, for people.
  [[nodiscard]] std::string Table() const;

 private:
  std::map<std::uint64_t, std::string> seeds_;  // with their digests
  std::map<std::uint64_t, std::string> failed_;
  std::map<std::string, std::uint64_t> reached_;
  std::map<std::string, std::uint64_t> armed_;
  std::map<std::string, double> sums_;
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

/// All lines of all files of the folder. Errors: a file that is no list of seeds.
Result<Summary> MergeFolder(const std::string& folder);

}  // namespace focalfleet::soak
