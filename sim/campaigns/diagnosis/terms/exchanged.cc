#include "sim/campaigns/diagnosis/terms/exchanged.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <numbers>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "protocol/base/units.h"
#include "sim/campaigns/campaign/place_steps.h"
#include "sim/campaigns/diagnosis/model/chances.h"
#include "sim/campaigns/effects/other_causes.h"

namespace focalfleet::sim {
namespace {

constexpr double kBad_mm = 0.3;            // distance from the expected place
constexpr double kSwapBetter = 0.2;        // of the distance that is left once names are exchanged
constexpr double kSwapNear_mm = 3;         // absolute limit: the table's zeros may be wrong
constexpr std::size_t kCommonRowsMin = 3;  // rows that both units have
constexpr double kChange = 2.5;            // votes that a change of the exchange costs
constexpr std::size_t kBadMost = 64;       // units: more are no exchange, but another table

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

// Distance of a measured place from that of a unit of the table at these angles; NaN: not seen.
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
    if (misses.size() >= kCommonRowsMin && Median(std::move(misses)) > kBad_mm) off.push_back(unit);
  }
  return off;
}

// ln L that the exchange gains: places are about the expected ones with the spread that they have
// about those of the exchanged names.
double GainOf(const std::vector<double>& own_mm, const std::vector<double>& crossed_mm) {
  const double spread_mm =
      std::max(Median(crossed_mm) / std::sqrt(2 * std::numbers::ln2), kNoiseLeast_um / kUmPerMm);
  double gain = 0;
  for (const double miss_mm : own_mm) gain += MinusLogDensity(std::pow(miss_mm / spread_mm, 2));
  for (const double miss_mm : crossed_mm) gain -= MinusLogDensity(std::pow(miss_mm / spread_mm, 2));
  return gain;
}

// The pair of rows from which on the units are off: the change that most rows agree with.
std::size_t SinceWhen(const Campaign& campaign, const std::vector<RowPair>& rows, std::size_t a,
                      std::size_t b) {
  std::ptrdiff_t score = 0, most = 0;
  std::size_t since = rows.size();
  for (std::size_t k = rows.size(); k-- > 0;) {
    // A place that was not seen votes for neither.
    const double miss = OwnMiss(campaign, rows[k].a, a) + OwnMiss(campaign, rows[k].b, b);
    if (std::isfinite(miss)) score += miss > kBad_mm ? 1 : -1;
    if (score >= most && std::isfinite(miss)) most = score, since = k;
  }
  return since;
}

// The error of the other's commands, for each pair of rows. The units were at different angles when
// they began to make each other's moves, and are at different ones where both are homed.
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
  if (since + kCommonRowsMin > rows.size()) return std::nullopt;
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
  if (own.size() < 2 * kCommonRowsMin) return std::nullopt;
  const double rms_mm = std::sqrt(square / static_cast<double>(own.size()));
  if (Median(crossed) >= kSwapBetter * Median(own)) return std::nullopt;
  return CommandSwap{a, b, rows[since].exposure, rms_mm, GainOf(own, crossed)};
}

// The expected places of fibres by the table, and the distance from there to the measured ones.
// Shape: (rows).
struct Expected {
  std::vector<PlacePoint> at;
  std::vector<double> own_mm;  // NaN: not seen
};

Expected ExpectedOf(const Campaign& campaign) {
  Expected expected;
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit)
    for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row) {
      expected.at.push_back(PlaceOf(campaign.units[unit], campaign.cmd_deg[kTheta][row],
                                    campaign.cmd_deg[kPhi][row]));
      expected.own_mm.push_back(std::hypot(campaign.x_mm[row] - expected.at.back().x_mm,
                                           campaign.y_mm[row] - expected.at.back().y_mm));
    }
  return expected;
}

double MissOf(const Campaign& campaign, const Expected& expected, std::size_t row,
              std::size_t other) {
  return std::hypot(campaign.x_mm[row] - expected.at[other].x_mm,
                    campaign.y_mm[row] - expected.at[other].y_mm);
}

// Whether each fibre is where the other should be, and far from its own place.
bool AreCrossed(const Campaign& campaign, const Expected& expected, std::size_t a, std::size_t b) {
  const auto crossed = [&](std::size_t row, std::size_t other) {
    const double own_mm = expected.own_mm[row];
    return own_mm > kBad_mm &&
           MissOf(campaign, expected, row, other) < std::min(kSwapBetter * own_mm, kSwapNear_mm);
  };
  return crossed(a, b) && crossed(b, a);
}

bool AreRight(const Campaign& campaign, const Expected& expected, std::size_t a, std::size_t b) {
  const auto right = [&](std::size_t row, std::size_t other) {
    return expected.own_mm[row] < kSwapBetter * MissOf(campaign, expected, row, other);
  };
  return right(a, b) && right(b, a);
}

// A row of one unit and one of a later unit that are crossed.
struct Crossing {
  std::size_t unit_a = 0, row_a = 0, unit_b = 0, row_b = 0;
};

std::vector<Crossing> FindCrossings(const CampaignFacts& facts, const Expected& expected) {
  const Campaign& campaign = *facts.campaign;
  struct Off {
    std::size_t unit = 0, row = 0;
    double x_mm = 0;  // expected place
  };
  std::vector<std::vector<Off>> off_in(facts.exposures.size());
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit)
    for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row)
      if (expected.own_mm[row] > kBad_mm)
        off_in[facts.exposures.of_row[row]].push_back({unit, row, expected.at[row].x_mm});
  std::vector<Crossing> crossings;
  for (std::vector<Off>& off : off_in) {
    std::ranges::stable_sort(off, {}, &Off::x_mm);
    for (const Off& a : off) {
      const double x_mm = campaign.x_mm[a.row];
      auto b = std::ranges::lower_bound(off, x_mm - kSwapNear_mm, {}, &Off::x_mm);
      for (; b != off.end() && b->x_mm < x_mm + kSwapNear_mm; ++b)
        if (b->unit > a.unit && AreCrossed(campaign, expected, a.row, b->row))
          crossings.push_back({a.unit, a.row, b->unit, b->row});
    }
  }
  return crossings;
}

// The rows in which names are exchanged: the changes that most rows agree with, for their price. A
// row that decides neither way, as an outlier does, goes with those around it.
std::vector<char> ExchangedIn(const Campaign& campaign, const Expected& expected,
                              const std::vector<RowPair>& rows) {
  std::array<double, 2> best = {0, 0};  // by whether names are exchanged
  std::vector<std::array<char, 2>> came_from(rows.size());
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const auto [exposure, a, b] = rows[k];
    const double vote = AreCrossed(campaign, expected, a, b) ? 1
                        : AreRight(campaign, expected, a, b) ? -1
                                                             : 0;
    std::array<double, 2> next{};
    for (const std::size_t is : {0u, 1u}) {
      const bool changes = best[1 - is] - kChange > best[is];
      came_from[k][is] = static_cast<char>(changes ? 1 - is : is);
      next[is] = (changes ? best[1 - is] - kChange : best[is]) + (is == 1 ? vote : -vote);
    }
    best = next;
  }
  std::vector<char> exchanged(rows.size());
  char is = best[1] > best[0] ? 1 : 0;
  for (std::size_t k = rows.size(); k-- > 0;) {
    exchanged[k] = is;
    is = came_from[k][static_cast<std::size_t>(is)];
  }
  return exchanged;
}

// The exchange in stretches of three exposures or more; nullopt where there is none.
std::optional<FibreSwap> AsFibreSwap(const CampaignFacts& facts, const Expected& expected,
                                     std::size_t a, std::size_t b) {
  const Campaign& campaign = *facts.campaign;
  const std::vector<RowPair> rows = RowsOfBoth(facts, a, b);
  const std::vector<char> exchanged = ExchangedIn(campaign, expected, rows);
  FibreSwap swap{.a = a, .b = b};
  std::vector<double> own_mm, crossed_mm;
  const auto take = [&](std::size_t row, std::size_t other) {
    if (!std::isfinite(expected.own_mm[row])) return;
    own_mm.push_back(expected.own_mm[row]);
    crossed_mm.push_back(MissOf(campaign, expected, row, other));
  };
  for (std::size_t begin = 0, end = 0; begin < rows.size(); begin = end) {
    std::size_t crossed = 0;
    for (end = begin; end < rows.size() && exchanged[end] == exchanged[begin]; ++end)
      if (AreCrossed(campaign, expected, rows[end].a, rows[end].b)) ++crossed;
    if (exchanged[begin] == 0 || crossed < kCommonRowsMin) continue;
    // An exchange to the end of the rows that both units have is one to the end of each unit.
    FibreSwap::Stretch stretch = FibreSwap::Whole(campaign, a, b).stretches.front();
    if (begin > 0) stretch.begin_a = rows[begin].a, stretch.begin_b = rows[begin].b;
    if (end < rows.size()) stretch.end_a = rows[end].a, stretch.end_b = rows[end].b;
    swap.stretches.push_back(stretch);
    for (std::size_t k = begin; k < end; ++k)
      take(rows[k].a, rows[k].b), take(rows[k].b, rows[k].a);
  }
  if (swap.stretches.empty()) return std::nullopt;
  double square = 0;
  for (const double miss_mm : own_mm) square += miss_mm * miss_mm;
  swap.miss_mm = std::sqrt(square / static_cast<double>(own_mm.size()));
  swap.delta_log_likelihood = GainOf(own_mm, crossed_mm);
  return swap;
}

struct UnitPair {
  std::size_t a = 0, b = 0;
  double miss_mm = 0;
  double delta_log_likelihood = 0;
};

CauseFound SwapCause(const Campaign& campaign, const std::vector<UnitPair>& pairs) {
  CauseFound cause = CauseNamed(kIdentitySwap);
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
    cause.delta_log_likelihood += pair.delta_log_likelihood;
  }
  cause.size_um = 1e3 * std::sqrt(square / static_cast<double>(pairs.size()));
  cause.predicted_gain_um = cause.size_um;
  return cause;
}

bool IsForAll(const Campaign& campaign, const FibreSwap& swap) {
  return swap.stretches == FibreSwap::Whole(campaign, swap.a, swap.b).stretches;
}

std::string WhileOf(const Campaign& campaign, const FibreSwap& swap) {
  std::string when;
  for (const FibreSwap::Stretch& stretch : swap.stretches) {
    const std::string first = std::to_string(campaign.move_id[stretch.begin_a]);
    const std::string last = std::to_string(campaign.move_id[stretch.end_a - 1]);
    const bool to_the_end = stretch.end_a == campaign.first_row[swap.a + 1];
    when += when.empty() ? "" : " and";
    when += to_the_end ? " since move " + first : " in moves " + first + " to " + last;
  }
  return "units " + std::to_string(campaign.units[swap.a].id) + " and " +
         std::to_string(campaign.units[swap.b].id) + when;
}

CauseFound FibreSwapCause(const Campaign& campaign, const std::vector<FibreSwap>& swaps) {
  std::vector<UnitPair> pairs;
  for (const FibreSwap& swap : swaps)
    pairs.push_back({swap.a, swap.b, swap.miss_mm, swap.delta_log_likelihood});
  CauseFound cause = SwapCause(campaign, pairs);
  for (const FibreSwap& swap : swaps)
    if (!IsForAll(campaign, swap))
      cause.shape += (cause.shape.empty() ? "" : "; ") + WhileOf(campaign, swap);
  cause.paragraph =
      cause.shape.empty()
          ? "Two fibres are known under each other's name: exchange the names."
          : "Two fibres are known under each other's name for a while: exchange the names there, "
            "and look at how spots are given to units.";
  return cause;
}

CauseFound CommandSwapCause(const CampaignFacts& facts, const std::vector<CommandSwap>& swaps) {
  std::vector<UnitPair> pairs;
  for (const CommandSwap& swap : swaps)
    pairs.push_back({swap.a, swap.b, swap.miss_mm, swap.delta_log_likelihood});
  CauseFound cause = SwapCause(*facts.campaign, pairs);
  cause.shape = "each makes the other's moves, since move " +
                std::to_string(facts.exposures.move_id[swaps.front().since]);
  cause.paragraph =
      "Two units obey each other's commands: exchange their addresses on the bus, and home both.";
  return cause;
}

}  // namespace

FibreSwap FibreSwap::Whole(const Campaign& campaign, std::size_t a, std::size_t b) {
  const std::vector<std::size_t>& first_row = campaign.first_row;
  return {.a = a,
          .b = b,
          .stretches = {{first_row[a], first_row[a + 1], first_row[b], first_row[b + 1]}}};
}

std::vector<FibreSwap> FindFibreSwaps(const CampaignFacts& facts) {
  const Expected expected = ExpectedOf(*facts.campaign);
  std::map<std::pair<std::size_t, std::size_t>, std::size_t> crossed;  // exposures of a pair
  for (const Crossing& one : FindCrossings(facts, expected)) ++crossed[{one.unit_a, one.unit_b}];
  std::vector<std::pair<std::size_t, std::pair<std::size_t, std::size_t>>> pairs;
  for (const auto& [pair, exposures] : crossed)
    if (exposures >= kCommonRowsMin) pairs.emplace_back(exposures, pair);
  std::ranges::stable_sort(pairs, std::greater{}, [](const auto& one) { return one.first; });
  std::vector<FibreSwap> swaps;
  std::set<std::size_t> taken;
  for (const auto& [exposures, pair] : pairs) {
    const auto [a, b] = pair;
    if (taken.count(a) != 0 || taken.count(b) != 0) continue;
    auto swap = AsFibreSwap(facts, expected, a, b);
    if (!swap) continue;
    swaps.push_back(std::move(*swap));
    taken.insert({a, b});
  }
  return swaps;
}

std::vector<std::size_t> RowsUnderAnothersName(const CampaignFacts& facts) {
  const Campaign& campaign = *facts.campaign;
  const Expected expected = ExpectedOf(campaign);
  // A wrong table of a unit makes it unknown whose place it is at.
  const auto is_known = [&](std::size_t unit) {
    std::vector<double> misses;
    for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row)
      if (std::isfinite(expected.own_mm[row])) misses.push_back(expected.own_mm[row]);
    return Median(std::move(misses)) < kBad_mm;
  };
  std::vector<std::size_t> rows;
  for (const Crossing& one : FindCrossings(facts, expected))
    if (is_known(one.unit_a) && is_known(one.unit_b))
      rows.insert(rows.end(), {one.row_a, one.row_b});
  std::ranges::sort(rows);
  rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
  return rows;
}

void UndoFibreSwap(const Exposures& exposures, const FibreSwap& swap, Campaign* campaign) {
  constexpr double kMissing = std::numeric_limits<double>::quiet_NaN();
  for (const FibreSwap::Stretch& stretch : swap.stretches) {
    std::vector<std::size_t> row_of(exposures.size(), SIZE_MAX);
    for (std::size_t row = stretch.begin_b; row < stretch.end_b; ++row)
      row_of[exposures.of_row[row]] = row;
    for (std::size_t row = stretch.begin_a; row < stretch.end_a; ++row) {
      std::size_t& other = row_of[exposures.of_row[row]];
      if (other == SIZE_MAX) {
        campaign->x_mm[row] = campaign->y_mm[row] = kMissing;
        continue;
      }
      std::swap(campaign->x_mm[row], campaign->x_mm[other]);
      std::swap(campaign->y_mm[row], campaign->y_mm[other]);
      other = SIZE_MAX;
    }
    for (const std::size_t alone : row_of)
      if (alone != SIZE_MAX) campaign->x_mm[alone] = campaign->y_mm[alone] = kMissing;
  }
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
    causes.push_back(FibreSwapCause(*campaign, fibres));
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
