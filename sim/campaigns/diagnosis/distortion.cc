#include "sim/campaigns/diagnosis/distortion.h"

#include <algorithm>
#include <cmath>

#include "sim/campaigns/diagnosis/families.h"

namespace focalfleet::sim {
namespace {

constexpr double kStrong = 100;     // chi-square: a tenth of it could pass the gate
constexpr double kWeakShare = 0.5;  // of the strong term's chi-square
constexpr double kSpread = 0.3;     // of the cause: a prior that keeps the fit determined

PoseErrors DoneBy(const ModelTerm& term, const Fit& fit, std::size_t unit) {
  const UnitTrack track = TrackOf(fit.model, *fit.facts, unit);
  PoseErrors errors;
  errors.Reset(track.moves);
  const std::span<const double> amplitude = term.AmplitudeOf(unit);
  if (!amplitude.empty()) AddErrors(track, term.form, amplitude, &errors);
  return errors;
}

// A distortion's error as a multiple of the error `e` of a channel with this rms. The columns are
// the unit's own amplitude, two bends, and another dependence on the drive.
double Factor(std::size_t column, double e, double rms, double drive) {
  const double size = std::abs(e) / rms;
  if (column == 0) return 1;
  if (column == 1) return size;
  if (column == 2) return size * size;
  return 1 / std::max(drive, 0.05) - 1;
}

double RmsOf(const std::vector<double>& error) {
  double square = 0;
  for (const double e : error) square += e * e;
  return std::sqrt(square / static_cast<double>(std::max<std::size_t>(error.size(), 1)));
}

// The term's own errors, distorted.
ErrorTable DistortionsOf(const ModelTerm& term, const Fit& fit) {
  const Campaign& campaign = *fit.facts->campaign;
  const FilledColumn* drive = fit.facts->Find("drive_amplitude");
  ErrorTable table;
  table.columns.resize(drive == nullptr ? 3 : 4);
  for (PoseErrors& column : table.columns) column.Reset(campaign.rows());
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit) {
    const PoseErrors done = DoneBy(term, fit, unit);
    const std::size_t begin = campaign.first_row[unit];
    for (std::size_t channel = 0; channel < done.channels().size(); ++channel) {
      const std::vector<double>& error = *done.channels()[channel];
      const double rms = RmsOf(error);
      if (!(rms > 0)) continue;
      for (std::size_t c = 0; c < table.columns.size(); ++c)
        for (std::size_t i = 0; i < error.size(); ++i)
          (*table.columns[c].channels()[channel])[begin + i] =
              error[i] * Factor(c, error[i], rms, drive == nullptr ? 1 : drive->values[begin + i]);
    }
  }
  return table;
}

void ListNothing(const CampaignFacts&, Templates*) {}

const Effect& Distortion() {
  static const Effect effect = {.cause = "distortion",
                                .amplitude_unit = "of the cause",
                                .prior_size = kSpread,
                                .owner = Owner::kUnit,
                                .needs = {},
                                .paragraph = "",
                                .list = ListNothing,
                                .apply = ApplyTable};
  return effect;
}

// The fit with each unit's own distortions of the term beside it.
Fit WithDistortions(const Fit& fit, std::size_t strong, const ErrorTable& table) {
  Fit free = fit;
  ModelTerm term;
  term.form = {.effect = &Distortion(), .columns = table.columns.size(), .table = &table};
  term.sharing = Sharing::kUnit;
  term.spread = kSpread;
  const std::size_t units = fit.model.units.size();
  for (std::size_t unit = 0; unit < units; ++unit)
    term.group_of_unit.push_back(fit.model.terms[strong].group_of_unit[unit] == kNoGroup
                                     ? kNoGroup
                                     : static_cast<std::uint32_t>(unit));
  term.amplitude.assign(units * term.form.columns, 0);
  term.sigma = term.amplitude;
  free.model.terms.push_back(std::move(term));
  StepFit(&free);
  SettleFit(&free, 2);
  return free;
}

}  // namespace

std::vector<Undistorted> BesideDistortions(const Fit& fit, const std::vector<Accepted>& accepted) {
  const std::vector<ModelTerm>& terms = fit.model.terms;
  std::vector<Undistorted> out(terms.size());
  const FleetGroups groups = GroupsOf(*fit.facts);
  for (std::size_t strong = 0; strong < terms.size(); ++strong) {
    const double most = accepted[strong].evidence.chi_square;
    std::vector<std::size_t> weak;
    for (std::size_t t = 0; t < terms.size(); ++t)
      if (accepted[t].evidence.chi_square < kWeakShare * most &&
          terms[t].form.effect != terms[strong].form.effect &&
          AxesMeet(Name(terms[t].form.axis), Name(terms[strong].form.axis)))
        weak.push_back(t);
    if (most < kStrong || weak.empty()) continue;
    const ErrorTable table = DistortionsOf(terms[strong], fit);
    const Fit free = WithDistortions(fit, strong, table);
    for (const std::size_t t : weak) {
      const Templates own = {terms[t].form};
      const ScorePass pass = ScoreTemplates(free, own, t);
      const double kept = Assess(pass.scores[0], own[0], groups).chi_square /
                          std::max(accepted[t].evidence.chi_square, 1e-300);
      if (kept < out[t].kept) out[t] = {kept, strong};
    }
  }
  return out;
}

}  // namespace focalfleet::sim
