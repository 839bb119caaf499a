// The decision: each name gets its probability, and a verdict follows. The data share a probability
// out among the candidates that they do not separate. The rest is the doubt that none of them is
// the cause. This doubt was counted on planted campaigns, and grows with what is unknown beside the
// name. A name that is not nearly certain has "unknown" among its candidates.
#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "sim/campaigns/diagnosis/decide/diagnosis.h"

namespace focalfleet::sim {

/// The candidate of a name that may be a part of an unknown structure.
inline constexpr std::string_view kSomethingUnknown = "unknown";

/// Log odds of two candidates are the difference of their log evidence, divided by this
/// temperature: shapes and noise are not exactly those that the evidence supposes. The true
/// candidates of 371 planted campaigns are most likely at this pure number (95 %: 1.3 to 6), and so
/// are those of 614 newer ones. No candidate or verdict depends on it. In 500 of these, half of
/// it makes the mean distance of stated probabilities from the share that is right 0.060, double
/// 0.049, and 2.3 makes it 0.056: docs/diagnosis.md, Reliability.
inline constexpr double kTemperature = 2.3;

/// The probability that none of the cause's names is right, beside these unknown structures: 0 for
/// geometry, and 5 % where nothing is unknown. Beside a structure of size u a name of size n is in
/// doubt by u / (u + n) more (docs/diagnosis.md, Reliability). Where an empirical term was tried in
/// place of the name (log_odds has "unknown"), its probability is a doubt, too, and half of the
/// share of amplitudes that are as large as physics allows.
double DoubtOf(const CauseFound& cause, std::span<const UnknownFound> unknown);

/// The probability of each candidate. "unknown" has the cause's doubt, which is otherwise the rest
/// of 1. Shape: (candidates).
std::vector<double> PosteriorOf(const CauseFound& cause);

/// Adds causes that were not tested for want of a column, where a candidate is what they pass for
/// without it: another effect that turns its sign with the move by a column, or one that the
/// effect names (Effect::passes_for).
void AddUntested(const std::vector<NotTestable>& not_testable, std::vector<CauseFound>* causes);

/// Moves what eight and more causes could be into the unknown. Gives each cause its doubt, with
/// "unknown" as its last candidate from 10 % on, and the diagnosis its verdict. A name much smaller
/// than another of its axis is in doubt, too: it may be what that one's shape leaves. Nothing
/// changes either afterwards.
void Decide(Diagnosis* diagnosis);

}  // namespace focalfleet::sim
