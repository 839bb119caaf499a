// Figures judge the diagnosis over all campaigns of a suite. Each has a name by which a caller may
// require it, its count, an interval, and its target.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "tests/hidden/score/intervals.h"
#include "tests/hidden/score/reliability.h"
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

/// true cause -> first named cause -> count; single effects of the library with lambda >= 50.
using Confusion = std::map<std::string, std::map<std::string, int>>;

struct Score {
  std::vector<Figure> figures;
  Confusion confusion;
  Reliability reliability{};
  std::vector<std::string> worst;  // campaigns with wrong and unambiguous names
};

Score ScoreCases(const std::vector<Case>& cases);

/// Whether the two causes are of one class: ordinary campaigns cannot separate them.
bool SameClass(const std::string& a, const std::string& b);

struct Requirement {
  std::string id;
  bool at_least = true;
  double bound = 0;
};

/// Parses "exact_100>=0.97" or "null_clean<=0.01".
/// Errors: anything else.
Result<Requirement> ParseRequirement(const std::string& text);

/// Whether a figure meets a bound. With `by_interval` it misses the bound only when the near end of
/// its exact interval does. A figure without trials does not meet it.
bool Meets(const Figure& figure, const Requirement& requirement, bool by_interval);

std::string TablesOf(const Score& score);
std::string JsonOf(const Score& score);

}  // namespace focalfleet::hidden
