#include "tests/hidden/score/score.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace focalfleet::hidden {

namespace {

struct Bin {
  const char* id;
  double from;
  double to;
};
constexpr std::array<Bin, 6> kBins = {{{"15", 15, 30},
                                       {"30", 30, 50},
                                       {"50", 50, 100},
                                       {"100", 100, 250},
                                       {"250", 250, 1000},
                                       {"1000", 1000, 1e30}}};

// Shares and means are counted where they occur, and become figures at the end.
class Tally {
 public:
  void Share(const std::string& id, bool hit) {
    auto& [hits, trials] = shares_[id];
    hits += hit ? 1 : 0;
    ++trials;
  }
  void Value(const std::string& id, double value) { values_[id].push_back(value); }
  void Ratio(const std::string& id, double above, double below) {
    ratios_[id].first += above;
    ratios_[id].second += below;
    ++ratio_trials_[id];
  }

  [[nodiscard]] Figure ShareFigure(const std::string& id, std::string text,
                                   std::string target) const {
    const auto at = shares_.find(id);
    Figure figure{.id = id, .text = std::move(text), .target = std::move(target)};
    if (at == shares_.end()) return figure;
    figure.hits = at->second.first;
    figure.trials = at->second.second;
    figure.value = static_cast<double>(figure.hits) / figure.trials;
    return figure;
  }
  [[nodiscard]] Figure MeanFigure(const std::string& id, std::string text,
                                  std::string target) const {
    Figure figure{
        .id = id, .text = std::move(text), .is_share = false, .target = std::move(target)};
    const auto at = values_.find(id);
    if (at == values_.end()) return figure;
    figure.trials = static_cast<int>(at->second.size());
    for (const double value : at->second) figure.value += value / figure.trials;
    return figure;
  }
  [[nodiscard]] Figure MedianFigure(const std::string& id, std::string text,
                                    std::string target) const {
    Figure figure = MeanFigure(id, std::move(text), std::move(target));
    if (figure.trials == 0) return figure;
    auto values = values_.at(id);
    std::sort(values.begin(), values.end());
    figure.value = (values[(values.size() - 1) / 2] + values[values.size() / 2]) / 2;
    return figure;
  }
  [[nodiscard]] Figure RatioFigure(const std::string& id, std::string text,
                                   std::string target) const {
    Figure figure{
        .id = id, .text = std::move(text), .is_share = false, .target = std::move(target)};
    const auto at = ratios_.find(id);
    if (at == ratios_.end() || at->second.second <= 0) return figure;
    figure.trials = ratio_trials_.at(id);
    figure.value = at->second.first / at->second.second;
    return figure;
  }

 private:
  std::map<std::string, std::pair<int, int>> shares_;
  std::map<std::string, std::vector<double>> values_;
  std::map<std::string, std::pair<double, double>> ratios_;
  std::map<std::string, int> ratio_trials_;
};

// Named causes that are claims about what was planted: neither geometry nor a true nuisance.
std::vector<NamedCause> Claims(const Case& c) {
  std::vector<NamedCause> claims;
  for (const NamedCause& named : c.named)
    if (!IsStatic(named.cause) && c.also_true.count(named.cause) == 0) claims.push_back(named);
  // A nuisance may also be what was planted.
  for (const NamedCause& named : c.named)
    for (const TrueEffect& effect : c.effects)
      if (named.cause == effect.cause && c.also_true.count(named.cause) != 0)
        claims.push_back(named);
  return claims;
}

bool Detected(const Case& c) { return c.says_unknown || !Claims(c).empty(); }

bool Related(const TrueEffect& effect, const std::string& cause) {
  return SameClass(effect.cause, cause) || effect.equivalent.count(cause) != 0 ||
         effect.inseparable.count(cause) != 0;
}

bool SurelyWrong(const Case& c, std::string* how) {
  for (const NamedCause& claim : Claims(c))
    if (claim.Sure() && !c.IsTrue(claim.cause)) {
      if (how != nullptr) *how = claim.cause;
      return true;
    }
  return false;
}

void CountNull(const Case& c, Tally* tally) {
  tally->Share(c.dirty ? "null_dirty" : "null_clean", !Claims(c).empty());
  tally->Share("null_unknown", c.says_unknown);
  if (c.static_planted) return;
  tally->Share("static_false", std::any_of(c.named.begin(), c.named.end(), [](const auto& named) {
                 return IsStatic(named.cause);
               }));
}

void CountGain(const Case& c, const std::string& id, Tally* tally) {
  const double oracle = 1 - std::pow(c.oracle_after_um / c.oracle_before_um, 2);
  if (!(oracle > 0.02) || c.before_um <= 0) return;  // below it both are chance
  const double gained = 1 - std::pow(c.after_um / c.before_um, 2);
  tally->Ratio(id, gained, oracle);
  tally->Value(id + "_median", gained / oracle);
  tally->Share("gain_negative", gained < 0);
}

void CountFound(const TrueEffect& effect, const NamedCause& claim, Tally* tally) {
  tally->Share("scope", effect.scopes.count(claim.scope) != 0);
  if (effect.axis == "theta" || effect.axis == "phi")
    tally->Share("axis", claim.axis == effect.axis || claim.axis == "both");
  if (effect.rms_um <= 0 || effect.rms_left_um <= 0 || claim.rms_um <= 0) return;
  tally->Value("size_ratio", claim.rms_um / effect.rms_um);
  tally->Value("size_ratio_left", claim.rms_um / effect.rms_left_um);
}

void CountSet(const std::vector<NamedCause>& claims, const TrueEffect& effect, Tally* tally) {
  if (effect.lambda < 50 || claims.empty()) return;
  const NamedCause* holder = &claims.front();
  bool covered = false;
  for (const NamedCause& claim : claims)
    if (!covered && claim.candidates.count(effect.cause) != 0) covered = true, holder = &claim;
  tally->Share("coverage_50", covered);
  tally->Value("set_size_50", static_cast<double>(holder->candidates.size()));
  if (!effect.equivalent.empty() && covered) tally->Share("equivalent_told", !holder->Sure());
}

void CountSingle(const Case& c, Tally* tally, Confusion* confusion) {
  const TrueEffect& effect = c.effects.front();
  const auto claims = Claims(c);
  if (!effect.missing_columns.empty()) {
    tally->Share("not_testable", c.not_testable.count(effect.cause) != 0);
    return;
  }
  const bool exact = claims.size() == 1 && claims[0].Sure() && claims[0].cause == effect.cause;
  for (const Bin& bin : kBins) {
    if (effect.lambda < bin.from || effect.lambda >= bin.to) continue;
    tally->Share(std::string("detected_bin_") + bin.id, Detected(c));
    if (effect.Identifiable()) tally->Share(std::string("exact_bin_") + bin.id, exact);
  }
  if (effect.lambda >= 50) {
    ++(*confusion)[effect.cause][!claims.empty()  ? claims[0].cause
                                 : c.says_unknown ? "(unknown)"
                                                  : "(nothing)"];
    CountSet(claims, effect, tally);
  }
  if (effect.lambda < 100) return;
  if (effect.Identifiable()) {
    tally->Share("exact_100", exact);
    tally->Share("first_100", !claims.empty() && claims[0].cause == effect.cause);
  }
  tally->Share("class_100", claims.size() == 1 && Related(effect, claims[0].cause));
  CountGain(c, "gain_single", tally);
  for (const NamedCause& claim : claims)
    if (claim.cause == effect.cause) {
      CountFound(effect, claim, tally);
      break;
    }
}

void CountComposite(const Case& c, Tally* tally) {
  const auto claims = Claims(c);
  const bool counts = std::all_of(c.effects.begin(), c.effects.end(), [](const TrueEffect& e) {
    return e.lambda >= 100 && e.missing_columns.empty() && e.survival >= 0.05;
  });
  if (!counts) return;
  bool all = true;
  for (const TrueEffect& effect : c.effects) {
    const bool found = std::any_of(claims.begin(), claims.end(), [&](const NamedCause& claim) {
      return Related(effect, claim.cause);
    });
    tally->Share("composite_recall", found);
    all = all && found;
  }
  for (const NamedCause& claim : claims) {
    const bool right =
        std::any_of(c.effects.begin(), c.effects.end(),
                    [&](const TrueEffect& effect) { return Related(effect, claim.cause); });
    tally->Share("composite_precision", right);
    all = all && right;
  }
  tally->Share("composite_" + std::to_string(std::min<std::size_t>(4, c.effects.size())), all);
  CountGain(c, "gain_composite", tally);
}

void CountForeign(const Case& c, Tally* tally) {
  const TrueEffect& effect = c.effects.front();
  const bool degenerate = !effect.equivalent.empty();  // a cause of the library explains it as well
  const bool sure = SurelyWrong(c, nullptr);
  if (degenerate) {
    tally->Share("foreign_degenerate_sure", sure);
    return;
  }
  const char* strength = effect.lambda >= 250 ? "_250" : "_weak";
  tally->Share(std::string("unknown_flagged") + strength, c.says_unknown);
  tally->Share(std::string("unknown_misnamed") + strength, sure && !c.says_unknown);
  tally->Share(std::string("unknown_named_beside") + strength, sure);
  if (!c.says_unknown || effect.lambda < 250) return;
  const bool right = std::any_of(
      c.unknown_covariates.begin(), c.unknown_covariates.end(), [&](const std::string& reported) {
        return std::any_of(
            effect.covariates.begin(), effect.covariates.end(),
            [&](const std::string& name) { return reported.find(name) != std::string::npos; });
      });
  tally->Share("unknown_covariate", right);
}

void AddBins(const Tally& tally, std::vector<Figure>* out) {
  static constexpr std::array<const char*, 6> kDetect = {">=0.85", ">=0.92", ">=0.99",
                                                         ">=0.99", ">=0.99", ">=0.99"};
  const auto range = [](const Bin& bin) {
    return bin.to > 1e9 ? std::string("from ") + bin.id
                        : std::string(bin.id) + " to " + std::to_string(std::lround(bin.to));
  };
  for (std::size_t b = 0; b < kBins.size(); ++b)
    out->push_back(tally.ShareFigure(std::string("detected_bin_") + kBins[b].id,
                                     "detected, lambda " + range(kBins[b]), kDetect[b]));
  for (const Bin& bin : kBins)
    out->push_back(tally.ShareFigure(std::string("exact_bin_") + bin.id,
                                     "exact name, lambda " + range(bin),
                                     bin.from >= 100 ? ">=0.97" : ""));
}

std::vector<Figure> Figures(const Tally& t) {
  std::vector<Figure> out = {
      t.ShareFigure("reports", "campaigns with a report", ">=1"),
      t.ShareFigure("null_clean", "nothing planted, clean: a cause is named", "<=0.01"),
      t.ShareFigure("null_dirty", "nothing planted, dirty: a cause is named", "<=0.02"),
      t.ShareFigure("null_unknown", "nothing planted: called unknown", "<=0.02"),
      t.ShareFigure("static_false", "exact geometry: an error of it is named", "<=0.01"),
      t.ShareFigure("static_found", "errors of geometry with lambda >= 100: named", ">=0.97")};
  AddBins(t, &out);
  const std::vector<Figure> rest = {
      t.ShareFigure("exact_100", "exact name, lambda >= 100, identifiable", ">=0.97"),
      t.ShareFigure("first_100", "first name is the cause, same campaigns", ">=0.97"),
      t.ShareFigure("class_100", "one name and of its class, lambda >= 100", ">=0.99"),
      t.ShareFigure("wrong_and_sure", "a single name that is wrong", "<=0.005"),
      t.ShareFigure("coverage_50", "cause among the candidates, lambda >= 50", ">=0.99"),
      t.MeanFigure("set_size_50", "candidates, mean, lambda >= 50", "<=1.5"),
      t.ShareFigure("equivalent_told", "equivalent causes: told as candidates", ">=0.99"),
      t.ShareFigure("not_testable", "its column is missing: told", ">=0.99"),
      t.ShareFigure("composite_2", "2 causes, exact by class, lambda >= 100 each", ">=0.95"),
      t.ShareFigure("composite_3", "3 causes", ">=0.92"),
      t.ShareFigure("composite_4", "4 causes", ">=0.9"),
      t.ShareFigure("composite_recall", "composites: causes found, by class", ">=0.96"),
      t.ShareFigure("composite_precision", "composites: names that are right", ">=0.98"),
      t.ShareFigure("unknown_flagged_250", "outside the library, lambda >= 250: flagged", ">=0.9"),
      t.ShareFigure("unknown_misnamed_250", "outside: named surely and not flagged", "<=0.05"),
      t.ShareFigure("unknown_named_beside_250", "outside: some sure name", ""),
      t.ShareFigure("unknown_covariate", "outside and flagged: the right covariate", ">=0.8"),
      t.ShareFigure("unknown_flagged_weak", "outside, lambda < 250: flagged", ""),
      t.ShareFigure("unknown_misnamed_weak", "outside, lambda < 250: misnamed", ""),
      t.ShareFigure("foreign_degenerate_sure", "outside, a cause looks the same: sure", ""),
      t.MeanFigure("calibration_error", "stated probabilities to shares that are right", "<=0.05"),
      t.RatioFigure("gain_single", "held-out gain to the oracle's, one cause", ">=0.95"),
      t.MedianFigure("gain_single_median", "the same, median of campaigns", ""),
      t.RatioFigure("gain_composite", "held-out gain to the oracle's, composites", ">=0.9"),
      t.MedianFigure("gain_composite_median", "the same, median of campaigns", ""),
      t.ShareFigure("gain_negative", "the extended model predicts worse", "<=0.01"),
      t.ShareFigure("scope", "scope right, of causes rightly named", ">=0.98"),
      t.ShareFigure("axis", "axis right, of causes rightly named", ">=0.98"),
      t.MedianFigure("size_ratio", "size told to true size, median", ""),
      t.MedianFigure("size_ratio_left", "the same to what the static fit leaves", "")};
  out.insert(out.end(), rest.begin(), rest.end());
  return out;
}

}  // namespace

bool SameClass(const std::string& a, const std::string& b) {
  static const std::vector<std::set<std::string>> classes = {
      {"backlash", "load_angle_lag", "relaxation", "supply_droop"},
      {"gear_scale", "eccentricity", "pinion_runout", "axis_crosstalk"},
      {"gear_scale", "wear"},
      {"axis_tilt", "camera_distortion"},
      {"camera_similarity", "plate_expansion"}};
  return a == b || std::any_of(classes.begin(), classes.end(), [&](const auto& group) {
           return group.count(a) != 0 && group.count(b) != 0;
         });
}

Score ScoreCases(const std::vector<Case>& cases) {
  Score score;
  Tally tally;
  for (const Case& c : cases) {
    tally.Share("reports", c.has_report);
    for (const auto& [cause, lambda] : c.static_lambda) {
      if (!c.static_planted || lambda < 100) continue;
      tally.Share("static_found", std::any_of(c.named.begin(), c.named.end(),
                                              [&, wanted = cause](const NamedCause& named) {
                                                return named.candidates.count(wanted) != 0;
                                              }));
    }
    std::string how;
    if (c.kind == "single" || c.kind == "composite") {
      const bool wrong = SurelyWrong(c, &how);
      tally.Share("wrong_and_sure", wrong);
      std::string line = c.name + ":";
      for (const TrueEffect& effect : c.effects) line += " " + effect.cause;
      if (wrong) score.worst.push_back(line + " called " + how);
    }
    if (c.kind == "null") CountNull(c, &tally);
    if (c.kind == "composite") CountComposite(c, &tally);
    if (c.kind == "single" && c.effects.size() == 1) CountSingle(c, &tally, &score.confusion);
    if (c.kind == "unknown" && c.effects.size() == 1) CountForeign(c, &tally);
  }
  score.reliability = ReliabilityOf(cases);
  if (const auto error = CalibrationError(score.reliability))
    tally.Value("calibration_error", *error);
  score.figures = Figures(tally);
  return score;
}

}  // namespace focalfleet::hidden
