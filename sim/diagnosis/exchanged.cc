#include "sim/diagnosis/exchanged.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "sim/diagnosis/chances.h"

namespace focalfleet::sim {
namespace {

constexpr double kBadUnit_mm = 0.3;   // median miss
constexpr double kSwapBetter = 0.2;   // of the miss that is left once names are exchanged
constexpr std::size_t kRowsMin = 3;   // that both have
constexpr std::size_t kBadMost = 64;  // units: more are no exchange, but another table

double MissOf(const Fit& fit, std::size_t unit) {
  const Campaign& campaign = *fit.facts->campaign;
  std::vector<double> misses;
  for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row)
    if (fit.weight[row] > 0) misses.push_back(1e-3 * std::hypot(fit.x_um[row], fit.y_um[row]));
  return misses.empty() ? 0 : Median(std::move(misses));
}

// Rows of an exposure that both units have.
struct RowPair {
  std::uint32_t exposure = 0;
  std::size_t a = 0, b = 0;
};

std::vector<RowPair> RowsOfBoth(const CampaignFacts& facts, std::size_t a, std::size_t b) {
  const Campaign& campaign = *facts.campaign;
  std::vector<std::size_t> row_of(facts.exposures.size(), SIZE_MAX);
  for (std::size_t row = campaign.first_row[b]; row < campaign.first_row[b + 1]; ++row)
    row_of[facts.exposures.of_row[row]] = row;
  std::vector<RowPair> rows;
  for (std::size_t row = campaign.first_row[a]; row < campaign.first_row[a + 1]; ++row) {
    const std::uint32_t exposure = facts.exposures.of_row[row];
    if (row_of[exposure] != SIZE_MAX) rows.push_back({exposure, row, row_of[exposure]});
  }
  return rows;
}

// Of a measured place from a unit of the table at these angles; NaN: not seen.
double MissAt(const Campaign& campaign, std::size_t row, std::size_t unit, double theta_deg,
              double phi_deg) {
  const PlacePoint at = PlaceOf(campaign.units[unit], theta_deg, phi_deg);
  return std::hypot(campaign.x_mm[row] - at.x_mm, campaign.y_mm[row] - at.y_mm);
}

double OwnMiss(const Campaign& campaign, std::size_t row, std::size_t unit) {
  return MissAt(campaign, row, unit, campaign.cmd_deg[kTheta][row], campaign.cmd_deg[kPhi][row]);
}

// Median miss of a's measured places from b's commands with the table's geometry of b.
double CrossMiss(const Fit& fit, std::size_t a, std::size_t b) {
  const Campaign& campaign = *fit.facts->campaign;
  std::vector<double> misses;
  for (const RowPair& rows : RowsOfBoth(*fit.facts, a, b))
    if (std::isfinite(campaign.x_mm[rows.a]))
      misses.push_back(MissAt(campaign, rows.a, b, campaign.cmd_deg[kTheta][rows.b],
                              campaign.cmd_deg[kPhi][rows.b]));
  return misses.size() < kRowsMin ? std::numeric_limits<double>::infinity()
                                  : Median(std::move(misses));
}

// Units that are off at the end of the campaign, whenever that began.
std::vector<std::size_t> OffAtTheEnd(const Campaign& campaign) {
  std::vector<std::size_t> off;
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit) {
    const std::size_t begin = campaign.first_row[unit], end = campaign.first_row[unit + 1];
    std::vector<double> misses;
    for (std::size_t row = end - (end - begin) / 3; row < end; ++row)
      if (std::isfinite(campaign.x_mm[row])) misses.push_back(OwnMiss(campaign, row, unit));
    if (misses.size() >= kRowsMin && Median(std::move(misses)) > kBadUnit_mm) off.push_back(unit);
  }
  return off;
}

// The pair of rows from which on the units are off: the change that most rows agree with.
std::size_t SinceWhen(const Campaign& campaign, const std::vector<RowPair>& rows, std::size_t a,
                      std::size_t b) {
  std::ptrdiff_t score = 0, most = 0;
  std::size_t since = rows.size();
  for (std::size_t k = rows.size(); k-- > 0;) {
    // A place that was not seen votes for neither.
    const double miss = OwnMiss(campaign, rows[k].a, a) + OwnMiss(campaign, rows[k].b, b);
    if (std::isfinite(miss)) score += miss > kBadUnit_mm ? 1 : -1;
    if (score >= most && std::isfinite(miss)) most = score, since = k;
  }
  return since;
}

// What the other's commands are off by, for each pair of rows: the units stood elsewhere when they
// began to make each other's moves, and stand elsewhere where both are homed.
std::array<std::vector<double>, 2> Offsets(const CampaignFacts& facts,
                                           const std::vector<RowPair>& rows, std::size_t since) {
  const Campaign& campaign = *facts.campaign;
  std::array<std::vector<double>, 2> of_a;
  for (const std::size_t axis : {kTheta, kPhi}) {
    double off = 0;
    for (std::size_t k = since; k < rows.size(); ++k) {
      const bool anew =
          k == since || (facts.restarts[rows[k].a] != 0 && facts.restarts[rows[k].b] != 0);
      if (anew) off = campaign.from_deg[axis][rows[k].a] - campaign.from_deg[axis][rows[k].b];
      of_a[axis].push_back(off);
    }
  }
  return of_a;
}

std::optional<CommandSwap> AsCommandSwap(const CampaignFacts& facts, std::size_t a, std::size_t b) {
  const Campaign& campaign = *facts.campaign;
  const std::vector<RowPair> rows = RowsOfBoth(facts, a, b);
  const std::size_t since = SinceWhen(campaign, rows, a, b);
  if (since + kRowsMin > rows.size()) return std::nullopt;
  const std::array<std::vector<double>, 2> off = Offsets(facts, rows, since);
  std::vector<double> own, crossed;
  double square = 0;
  for (std::size_t k = since; k < rows.size(); ++k) {
    const double theta_off = off[kTheta][k - since], phi_off = off[kPhi][k - since];
    const auto take = [&](std::size_t row, std::size_t unit, std::size_t other, double side) {
      if (!std::isfinite(campaign.x_mm[row])) return;
      own.push_back(OwnMiss(campaign, row, unit));
      square += own.back() * own.back();
      crossed.push_back(MissAt(campaign, row, unit,
                               campaign.cmd_deg[kTheta][other] + side * theta_off,
                               campaign.cmd_deg[kPhi][other] + side * phi_off));
    };
    take(rows[k].a, a, rows[k].b, 1), take(rows[k].b, b, rows[k].a, -1);
  }
  if (own.size() < 2 * kRowsMin) return std::nullopt;
  const double rms_mm = std::sqrt(square / static_cast<double>(own.size()));
  if (Median(std::move(crossed)) >= kSwapBetter * Median(std::move(own))) return std::nullopt;
  return CommandSwap{a, b, rows[since].exposure, rms_mm};
}

// Pairs of units whose measured places belong to each other, for all of the campaign.
std::vector<std::pair<std::size_t, std::size_t>> FindSwaps(const Fit& fit) {
  const Campaign& campaign = *fit.facts->campaign;
  std::vector<std::size_t> bad;
  std::vector<double> miss_mm;
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit) {
    const double miss = MissOf(fit, unit);
    // A wrong name also drags the fitted base away.
    const double dragged =
        std::hypot(fit.model.units[unit].base_x_mm - campaign.units[unit].base_x_mm,
                   fit.model.units[unit].base_y_mm - campaign.units[unit].base_y_mm);
    if (miss > kBadUnit_mm || dragged > 1) bad.push_back(unit), miss_mm.push_back(miss);
  }
  std::vector<std::pair<std::size_t, std::size_t>> swaps;
  std::set<std::size_t> taken;
  for (const std::size_t a : bad)
    for (const std::size_t b : bad) {
      if (b <= a || taken.count(a) != 0 || taken.count(b) != 0) continue;
      const double own = CrossMiss(fit, a, a) + CrossMiss(fit, b, b);
      const double crossed = CrossMiss(fit, a, b) + CrossMiss(fit, b, a);
      if (crossed >= kSwapBetter * own) continue;
      swaps.emplace_back(a, b);
      taken.insert({a, b});
    }
  return swaps;
}

CauseFound SwapCause(const Campaign& campaign,
                     const std::vector<std::pair<std::size_t, std::size_t>>& swaps) {
  CauseFound cause = CauseNamed("identity_swap");
  cause.axis = "none";
  cause.scope = "unit";
  cause.amplitude_unit = "pairs";
  cause.amplitude = static_cast<double>(swaps.size());
  cause.ci95[0] = cause.ci95[1] = cause.amplitude;
  double square = 0;
  for (const auto& [a, b] : swaps) {
    cause.units.push_back(campaign.units[a].id);
    cause.units.push_back(campaign.units[b].id);
    square += std::pow(1e3 * std::hypot(campaign.units[a].base_x_mm - campaign.units[b].base_x_mm,
                                        campaign.units[a].base_y_mm - campaign.units[b].base_y_mm),
                       2);
  }
  cause.size_um = std::sqrt(square / static_cast<double>(swaps.size()));
  cause.predicted_gain_um = cause.size_um;
  cause.delta_log_likelihood = 1e6;
  cause.paragraph = "Two fibres are known under each other's name: exchange the names.";
  return cause;
}

CauseFound CommandSwapCause(const CampaignFacts& facts, const std::vector<CommandSwap>& swaps) {
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  double square = 0;
  for (const CommandSwap& swap : swaps)
    pairs.emplace_back(swap.a, swap.b), square += swap.miss_mm * swap.miss_mm;
  CauseFound cause = SwapCause(*facts.campaign, pairs);
  cause.size_um = 1e3 * std::sqrt(square / static_cast<double>(swaps.size()));
  cause.predicted_gain_um = cause.size_um;
  cause.shape = "each makes the other's moves, since move " +
                std::to_string(facts.exposures.move_id[swaps.front().since]);
  cause.paragraph =
      "Two units obey each other's commands: exchange their addresses on the bus, and home both.";
  return cause;
}

}  // namespace

void UndoSwap(const Exposures& exposures, std::size_t a, std::size_t b, Campaign* campaign) {
  constexpr double kMissing = std::numeric_limits<double>::quiet_NaN();
  std::vector<std::size_t> row_of(exposures.size(), SIZE_MAX);
  for (std::size_t row = campaign->first_row[b]; row < campaign->first_row[b + 1]; ++row)
    row_of[exposures.of_row[row]] = row;
  std::set<std::size_t> met;
  for (std::size_t row = campaign->first_row[a]; row < campaign->first_row[a + 1]; ++row) {
    const std::size_t other = row_of[exposures.of_row[row]];
    if (other == SIZE_MAX) {
      campaign->x_mm[row] = campaign->y_mm[row] = kMissing;
      continue;
    }
    met.insert(other);
    std::swap(campaign->x_mm[row], campaign->x_mm[other]);
    std::swap(campaign->y_mm[row], campaign->y_mm[other]);
  }
  for (std::size_t row = campaign->first_row[b]; row < campaign->first_row[b + 1]; ++row)
    if (met.count(row) == 0) campaign->x_mm[row] = campaign->y_mm[row] = kMissing;
}

std::vector<CommandSwap> FindCommandSwaps(const CampaignFacts& facts) {
  const std::vector<std::size_t> off = OffAtTheEnd(*facts.campaign);
  std::vector<CommandSwap> swaps;
  if (off.size() > kBadMost) return swaps;
  std::set<std::size_t> taken;
  for (const std::size_t a : off)
    for (const std::size_t b : off) {
      if (b <= a || taken.count(a) != 0 || taken.count(b) != 0) continue;
      const auto swap = AsCommandSwap(facts, a, b);
      if (!swap) continue;
      swaps.push_back(*swap);
      taken.insert({a, b});
    }
  return swaps;
}

void UndoCommandSwap(const CampaignFacts& facts, const CommandSwap& swap, Campaign* campaign) {
  constexpr double kMissing = std::numeric_limits<double>::quiet_NaN();
  std::vector<RowPair> rows = RowsOfBoth(facts, swap.a, swap.b);
  const auto first = std::ranges::find(rows, swap.since, &RowPair::exposure);
  const auto since = static_cast<std::size_t>(first - rows.begin());
  const std::array<std::vector<double>, 2> off = Offsets(facts, rows, since);
  std::set<std::size_t> met;
  for (std::size_t k = since; k < rows.size(); ++k) {
    met.insert({rows[k].a, rows[k].b});
    for (const std::size_t axis : {kTheta, kPhi})
      for (std::vector<double>* angle : {&campaign->from_deg[axis], &campaign->cmd_deg[axis]}) {
        double &of_a = (*angle)[rows[k].a], &of_b = (*angle)[rows[k].b];
        std::swap(of_a, of_b);
        of_a += off[axis][k - since], of_b -= off[axis][k - since];
      }
  }
  const auto lose = [&](std::size_t row, std::size_t unit) {
    for (; row < campaign->first_row[unit + 1]; ++row)
      if (met.count(row) == 0) campaign->x_mm[row] = campaign->y_mm[row] = kMissing;
  };
  lose(rows[since].a, swap.a), lose(rows[since].b, swap.b);
}

std::vector<CauseFound> UndoExchanges(const Fit& fit, Campaign* campaign, CampaignFacts* facts,
                                      std::optional<Campaign>* as_named) {
  std::vector<CauseFound> causes;
  const auto fibres = FindSwaps(fit);
  if (!fibres.empty()) {
    *as_named = *campaign;
    for (const auto& [a, b] : fibres) UndoSwap(facts->exposures, a, b, campaign);
    causes.push_back(SwapCause(*campaign, fibres));
  }
  const std::vector<CommandSwap> commands = FindCommandSwaps(*facts);
  if (!commands.empty()) {
    if (!*as_named) *as_named = *campaign;
    causes.push_back(CommandSwapCause(*facts, commands));
    for (const CommandSwap& swap : commands) UndoCommandSwap(*facts, swap, campaign);
    *facts = MakeFacts(*campaign);
  }
  return causes;
}

}  // namespace focalfleet::sim
