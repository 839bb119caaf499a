#include "sim/diagnosis/exchanged.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "sim/diagnosis/chances.h"

namespace focalfleet::sim {
namespace {

constexpr double kBadUnit_mm = 0.3;    // median miss
constexpr double kSwapBetter = 0.2;    // of the miss that is left once names are exchanged
constexpr std::size_t kOffMost = 512;  // units of an exposure: more are another table
constexpr std::size_t kRowsMin = 3;    // that both have
constexpr std::size_t kBadMost = 64;   // units: more are no exchange, but another table

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

// A unit far from its own place in an exposure.
struct OffRow {
  std::size_t unit = 0, row = 0;
};

std::vector<std::vector<OffRow>> OffRowsOf(const CampaignFacts& facts) {
  const Campaign& campaign = *facts.campaign;
  std::vector<std::vector<OffRow>> off(facts.exposures.size());
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit)
    for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row)
      if (OwnMiss(campaign, row, unit) > kBadUnit_mm)
        off[facts.exposures.of_row[row]].push_back({unit, row});
  return off;
}

// Each stands where the other should.
bool AreCrossed(const Campaign& campaign, const OffRow& a, const OffRow& b) {
  const auto crossed = [&](const OffRow& one, const OffRow& other) {
    return MissAt(campaign, one.row, other.unit, campaign.cmd_deg[kTheta][other.row],
                  campaign.cmd_deg[kPhi][other.row]) <
           kSwapBetter * OwnMiss(campaign, one.row, one.unit);
  };
  return crossed(a, b) && crossed(b, a);
}

// The exposures of two units in which most rows say that they are crossed, and fewest that not.
std::optional<FibreSwap> SpanOf(const Campaign& campaign, const std::vector<RowPair>& rows,
                                std::size_t a, std::size_t b) {
  std::ptrdiff_t score = 0, most = 0;
  std::size_t begin = 0, first = 0, last = 0;
  std::vector<double> square(rows.size());
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const double own_a = OwnMiss(campaign, rows[k].a, a), own_b = OwnMiss(campaign, rows[k].b, b);
    square[k] = own_a * own_a + own_b * own_b;
    // A place that was not seen votes for neither.
    if (!std::isfinite(square[k])) continue;
    if (score <= 0) score = 0, begin = k;
    score += AreCrossed(campaign, {a, rows[k].a}, {b, rows[k].b}) ? 1 : -1;
    if (score > most) most = score, first = begin, last = k;
  }
  if (most < static_cast<std::ptrdiff_t>(kRowsMin)) return std::nullopt;
  double sum = 0, seen = 0;
  for (std::size_t k = first; k <= last; ++k)
    if (std::isfinite(square[k])) sum += square[k], seen += 2;
  const bool to_the_end = last + 1 == rows.size();
  return FibreSwap{a, b, first == 0 ? 0 : rows[first].exposure,
                   to_the_end ? UINT32_MAX : rows[last].exposure, std::sqrt(sum / seen)};
}

struct UnitPair {
  std::size_t a = 0, b = 0;
  double miss_mm = 0;
};

CauseFound SwapCause(const Campaign& campaign, const std::vector<UnitPair>& pairs) {
  CauseFound cause = CauseNamed("identity_swap");
  cause.axis = "none";
  cause.scope = "unit";
  cause.amplitude_unit = "pairs";
  cause.amplitude = static_cast<double>(pairs.size());
  cause.ci95[0] = cause.ci95[1] = cause.amplitude;
  double square = 0;
  for (const UnitPair& pair : pairs) {
    cause.units.push_back(campaign.units[pair.a].id);
    cause.units.push_back(campaign.units[pair.b].id);
    square += pair.miss_mm * pair.miss_mm;
  }
  cause.size_um = 1e3 * std::sqrt(square / static_cast<double>(pairs.size()));
  cause.predicted_gain_um = cause.size_um;
  cause.delta_log_likelihood = 1e6;
  return cause;
}

std::string WhileOf(const CampaignFacts& facts, const FibreSwap& swap) {
  const auto unit = [&](std::size_t at) { return std::to_string(facts.campaign->units[at].id); };
  const auto move = [&](std::uint32_t exposure) {
    return std::to_string(facts.exposures.move_id[exposure]);
  };
  const std::string pair = "units " + unit(swap.a) + " and " + unit(swap.b);
  if (swap.last == UINT32_MAX) return pair + " since move " + move(swap.first);
  return pair + " in moves " + move(swap.first) + " to " + move(swap.last);
}

CauseFound FibreSwapCause(const CampaignFacts& facts, const std::vector<FibreSwap>& swaps) {
  std::vector<UnitPair> pairs;
  for (const FibreSwap& swap : swaps) pairs.push_back({swap.a, swap.b, swap.miss_mm});
  CauseFound cause = SwapCause(*facts.campaign, pairs);
  for (const FibreSwap& swap : swaps) {
    if (swap.first == 0 && swap.last == UINT32_MAX) continue;
    cause.shape += (cause.shape.empty() ? "" : "; ") + WhileOf(facts, swap);
  }
  cause.paragraph = cause.shape.empty()
                        ? "Two fibres are known under each other's name: exchange the names."
                        : "Two fibres are known under each other's name for a while: exchange the "
                          "names there, and "
                          "look at how spots are given to units.";
  return cause;
}

CauseFound CommandSwapCause(const CampaignFacts& facts, const std::vector<CommandSwap>& swaps) {
  std::vector<UnitPair> pairs;
  for (const CommandSwap& swap : swaps) pairs.push_back({swap.a, swap.b, swap.miss_mm});
  CauseFound cause = SwapCause(*facts.campaign, pairs);
  cause.shape = "each makes the other's moves, since move " +
                std::to_string(facts.exposures.move_id[swaps.front().since]);
  cause.paragraph =
      "Two units obey each other's commands: exchange their addresses on the bus, and home both.";
  return cause;
}

}  // namespace

std::vector<FibreSwap> FindFibreSwaps(const CampaignFacts& facts) {
  const Campaign& campaign = *facts.campaign;
  std::map<std::pair<std::size_t, std::size_t>, std::size_t> votes;
  for (const std::vector<OffRow>& off : OffRowsOf(facts)) {
    if (off.size() > kOffMost) continue;
    for (std::size_t i = 0; i < off.size(); ++i)
      for (std::size_t j = i + 1; j < off.size(); ++j)
        if (AreCrossed(campaign, off[i], off[j])) ++votes[{off[i].unit, off[j].unit}];
  }
  std::vector<FibreSwap> swaps;
  std::set<std::size_t> taken;
  for (const auto& [pair, crossed] : votes) {
    const auto [a, b] = pair;
    if (crossed < kRowsMin || taken.count(a) != 0 || taken.count(b) != 0) continue;
    const auto swap = SpanOf(campaign, RowsOfBoth(facts, a, b), a, b);
    if (!swap) continue;
    swaps.push_back(*swap);
    taken.insert({a, b});
  }
  return swaps;
}

void UndoFibreSwap(const Exposures& exposures, const FibreSwap& swap, Campaign* campaign) {
  constexpr double kMissing = std::numeric_limits<double>::quiet_NaN();
  const auto [a, b, first, last, miss_mm] = swap;
  const auto is_in = [&](std::size_t row) {
    return exposures.of_row[row] >= first && exposures.of_row[row] <= last;
  };
  std::vector<std::size_t> row_of(exposures.size(), SIZE_MAX);
  for (std::size_t row = campaign->first_row[b]; row < campaign->first_row[b + 1]; ++row)
    row_of[exposures.of_row[row]] = row;
  std::set<std::size_t> met;
  for (std::size_t row = campaign->first_row[a]; row < campaign->first_row[a + 1]; ++row) {
    if (!is_in(row)) continue;
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
    if (is_in(row) && met.count(row) == 0) campaign->x_mm[row] = campaign->y_mm[row] = kMissing;
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

std::vector<CauseFound> UndoExchanges(Campaign* campaign, CampaignFacts* facts,
                                      std::optional<Campaign>* as_named) {
  std::vector<CauseFound> causes;
  const std::vector<FibreSwap> fibres = FindFibreSwaps(*facts);
  if (!fibres.empty()) {
    *as_named = *campaign;
    causes.push_back(FibreSwapCause(*facts, fibres));
    for (const FibreSwap& swap : fibres) UndoFibreSwap(facts->exposures, swap, campaign);
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
