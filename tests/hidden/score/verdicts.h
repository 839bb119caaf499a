// A case is one campaign's truth and the verdict on it, read from a key and a report. A report that
// is missing, or is none, is an empty verdict: it counts as such everywhere.
#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "protocol/base/result.h"

namespace focalfleet::hidden {

struct TrueEffect {
  std::string cause;
  bool foreign = false;
  std::string axis;
  std::set<std::string> scopes;  // all that are right
  std::set<int> units;           // empty: all
  double lambda = 0;             // chi-square per freedom, see the key
  double survival = 1;
  double rms_um = 0;
  double rms_left_um = 0;
  std::set<std::string> equivalent;
  std::set<std::string> inseparable;
  std::vector<std::string> missing_columns;
  std::vector<std::string> covariates;
  /// Whether these data can name it: nothing is missing, and no other cause looks the same.
  [[nodiscard]] bool Identifiable() const {
    return equivalent.empty() && inseparable.empty() && missing_columns.empty() && survival >= 0.05;
  }
};

struct NamedCause {
  std::string cause;
  std::set<std::string> candidates;  // `cause` among them
  std::map<std::string, double> posterior;
  std::string axis;
  std::string scope;
  std::set<int> units;  // empty: all
  double rms_um = 0;
  [[nodiscard]] bool Sure() const { return candidates.size() <= 1; }
};

struct Case {
  std::string name;
  std::string kind;  // null, single, composite, unknown
  bool dirty = false;
  std::string design;
  std::vector<TrueEffect> effects;
  std::set<std::string> also_true;
  bool static_planted = false;
  std::vector<std::pair<std::string, double>> static_lambda;
  double oracle_before_um = 0;
  double oracle_after_um = 0;

  bool has_report = false;
  std::string verdict;
  std::vector<NamedCause> named;  // strongest first
  std::vector<std::string> unknown_covariates;
  bool says_unknown = false;
  std::set<std::string> not_testable;
  double before_um = 0;
  double after_um = 0;

  /// Whether the cause was planted, or looks the same as one that was.
  [[nodiscard]] bool IsTrue(const std::string& cause) const;
};

bool IsStatic(const std::string& cause);

/// The case of a key and a report. `report` may be any text.
/// Errors: a key that is none.
Result<Case> ReadCase(const std::string& name, const std::string& key, const std::string& report);

}  // namespace focalfleet::hidden
