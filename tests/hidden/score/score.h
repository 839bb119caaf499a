// The figures by which the diagnosis is judged, over all campaigns of a suite. Each has a name by
// which a caller may require it, the count it stands on, an interval, and its target.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "tests/hidden/score/intervals.h"
#include "tests/hidden/score/verdicts.h"

namespace focalfleet::hidden {

struct Figure {
  std::string id;
  std::string text;
  double value = 0;
  int hits = 0;
  int trials = 0;        // of a share, or campaigns behind a mean
  bool is_share = true;  // else a mean without an interval
  std::string target;    // ">=0.97", "<=0.01", or empty
  [[nodiscard]] Interval exact() const { return ClopperPearson(hits, trials); }
  [[nodiscard]] Interval wilson() const { return Wilson(hits, trials); }
};

/// true cause -> what was said first -> how often; single effects of the library with lambda >= 50.
using Confusion = std::map<std::string, std::map<std::string, int>>;

struct Score {
  std::vector<Figure> figures;
  Confusion confusion;
  std::vector<std::string> worst;  // campaigns that were named wrongly and surely, and how
};

Score ScoreCases(const std::vector<Case>& cases);

/// Of one class, as causes.md of the project groups what ordinary campaigns cannot tell apart.
bool SameClass(const std::string& a, const std::string& b);

struct Requirement {
  std::string id;
  bool at_least = true;
  double bound = 0;
};

/// "exact_100>=0.97" or "null_clean<=0.01". Errors: anything else.
Result<Requirement> ParseRequirement(const std::string& text);

/// Whether a figure meets a bound; `by_interval`: only when even the near end of its exact interval
/// misses the bound it is not met. A figure without trials is not met.
bool Meets(const Figure& figure, const Requirement& requirement, bool by_interval);

std::string TablesOf(const Score& score);
std::string JsonOf(const Score& score);

}  // namespace focalfleet::hidden
