// Selection finds the effects that are in the data. The template with the most evidence among those
// that chance does not explain at the family-wise rate joins the model. Everything is then fitted
// anew, and terms are exchanged for better ones, or dropped where others have taken their place. At
// the end each term's rivals are those that would do as well in its place.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "sim/campaigns/diagnosis/score/evidence.h"

namespace focalfleet::sim {

struct Rival {
  std::string_view cause;
  double behind = 0;     // twice the difference of the log evidence
  double log_odds = 0;   // against the term's own cause, with the doubt of its shape
  double share = 0;      // of the term's own signal that the rival can take over
  bool of_pair = false;  // with a cause on each axis in place of a term of both
};

struct Accepted {
  Evidence evidence;          // with the rest of the model in place
  std::vector<Rival> rivals;  // not separable by these data
  // An empirical term's, in place of this and the other names of its axis; none: it was not tried.
  std::optional<double> log_odds_of_curve = {};
};

struct SelectionRule {
  double family_wise = 0.01;
  std::size_t terms_max = 8;
  double size_min_um = 0.05;  // a smaller misfit is not worth a name, however certain
  double rival_behind = 9;    // 2 d ln L
  // Squared cosine above which a rival is the same effect here.
  double rival_share = 0.99;
  // Above so many rows the search is on the rows of some units, so many, and all units follow: a
  // search costs as its rows do.
  std::size_t rows_many = 40'000, rows_kept = 20'000;
  std::uint64_t seed = 1;
  std::function<void(std::string_view)> progress = [](std::string_view) {};
};

struct Selection {
  std::vector<Accepted> accepted;  // Shape: (terms of the model)
  double tests = 1;                // independent tests that the library is worth
  // Share of each signature that is left beside the geometry. Shape: (templates), then those of the
  // quick look.
  std::vector<double> kept_share;
};

/// Adds terms to the fit's model.
Selection Select(const Templates& templates, const SelectionRule& rule, Fit* fit);

/// The causes that could be the term, as the fit is now.
std::vector<Rival> FindRivals(const Templates& templates, const SelectionRule& rule, const Fit& fit,
                              std::size_t term);

/// The term that the evidence calls for, with amplitudes 0.
ModelTerm MakeTerm(const Template& form, const Evidence& evidence, const FleetGroups& groups);

/// The best of the templates that chance does not explain; `at` is kNoTerm where there is none.
/// `kept_min`: share of a signature that must be left of it beside geometry and model.
struct Best {
  std::size_t at = kNoTerm;
  Evidence evidence;
  double log_p_family = 0;  // chance for the whole family of tests
};
Best FindBest(const ScorePass& pass, const Templates& templates, const FleetGroups& groups,
              const ParallelFor& parallel, double tests, double family_wise, double kept_min);

}  // namespace focalfleet::sim
