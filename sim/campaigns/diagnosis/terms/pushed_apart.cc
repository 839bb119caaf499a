#include "sim/campaigns/diagnosis/terms/pushed_apart.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <set>
#include <utility>

#include "sim/campaigns/diagnosis/model/chances.h"

namespace focalfleet::sim {
namespace {

// The chance of the directions alone, below which they say so, too: nearness alone is no push. Also
// of a pair whose rows are reported with the others. Half and double of it: docs/diagnosis.md.
constexpr double kChanceMax = 0.05;
constexpr std::size_t kNoRow = SIZE_MAX;

// Two neighbours in one exposure.
struct NeighbourPair {
  std::size_t unit[2];
  std::size_t row[2];
};

std::size_t UnitOf(const Campaign& campaign, std::size_t row) {
  const auto past = std::ranges::upper_bound(campaign.first_row, row);
  return static_cast<std::size_t>(past - campaign.first_row.begin()) - 1;
}

PlacePoint CommandedOf(const Fit& fit, std::size_t unit, std::size_t row) {
  const Campaign& campaign = *fit.facts->campaign;
  return PlaceOf(fit.model.units[unit], campaign.cmd_deg[kTheta][row], campaign.cmd_deg[kPhi][row]);
}

double DistanceOf_mm(const Fit& fit, const NeighbourPair& two) {
  const PlacePoint a = CommandedOf(fit, two.unit[0], two.row[0]);
  const PlacePoint b = CommandedOf(fit, two.unit[1], two.row[1]);
  return std::hypot(a.x_mm - b.x_mm, a.y_mm - b.y_mm);
}

std::vector<NeighbourPair> NeighboursAmong(const Fit& fit, const std::vector<std::size_t>& far) {
  const CampaignFacts& facts = *fit.facts;
  std::map<std::uint32_t, std::vector<std::size_t>> of_exposure;
  for (const std::size_t row : far) of_exposure[facts.exposures.of_row[row]].push_back(row);
  std::vector<NeighbourPair> pairs;
  for (const auto& [exposure, rows] : of_exposure)
    for (std::size_t i = 0; i < rows.size(); ++i)
      for (std::size_t j = i + 1; j < rows.size(); ++j) {
        const std::size_t a = UnitOf(*facts.campaign, rows[i]),
                          b = UnitOf(*facts.campaign, rows[j]);
        if (std::ranges::count(facts.neighbours[a], b) != 0)
          pairs.push_back({{a, b}, {rows[i], rows[j]}});
      }
  return pairs;
}

// The commanded distances of all neighbours in all exposures, in ascending order.
std::vector<double> DistancesOf_mm(const Fit& fit) {
  const CampaignFacts& facts = *fit.facts;
  const std::vector<std::size_t>& first_row = facts.campaign->first_row;
  std::vector<double> distances_mm;
  std::vector<std::size_t> row_of(facts.exposures.size());
  for (std::size_t a = 0; a < facts.neighbours.size(); ++a)
    for (const std::size_t b : facts.neighbours[a]) {
      if (b < a) continue;
      std::ranges::fill(row_of, kNoRow);
      for (std::size_t row = first_row[b]; row < first_row[b + 1]; ++row)
        row_of[facts.exposures.of_row[row]] = row;
      for (std::size_t row = first_row[a]; row < first_row[a + 1]; ++row)
        if (const std::size_t other = row_of[facts.exposures.of_row[row]]; other != kNoRow)
          distances_mm.push_back(DistanceOf_mm(fit, {{a, b}, {row, other}}));
    }
  std::ranges::sort(distances_mm);
  return distances_mm;
}

// ln of the chance that a row points so nearly away from the other unit's fibre. A direction is no
// better known than the noise allows.
double LogChanceOfDirection(const Fit& fit, const NeighbourPair& two, std::size_t which) {
  const PlacePoint own = CommandedOf(fit, two.unit[which], two.row[which]);
  const PlacePoint other = CommandedOf(fit, two.unit[1 - which], two.row[1 - which]);
  const double dx = own.x_mm - other.x_mm, dy = own.y_mm - other.y_mm;
  const double x_um = fit.x_um[two.row[which]], y_um = fit.y_um[two.row[which]];
  const double angle = std::abs(std::atan2(dx * y_um - dy * x_um, dx * x_um + dy * y_um));
  const double blur = fit.noise.typical_um / std::hypot(x_um, y_um);
  return std::min(std::log(std::max(angle, blur) / std::numbers::pi), 0.0);
}

// Fisher's combination of independent chances. `sum`: of their logarithms.
double LogCombined(double sum, std::size_t chances) {
  return LogChiSquareTail(-2 * sum, 2 * static_cast<double>(chances));
}

}  // namespace

std::optional<PushedApart> FindPushedApart(const Fit& fit, const std::vector<std::size_t>& far,
                                           double family_wise) {
  if (fit.facts->neighbours.empty()) return std::nullopt;
  const std::vector<NeighbourPair> pairs = NeighboursAmong(fit, far);
  if (pairs.empty()) return std::nullopt;
  const std::vector<double> all_mm = DistancesOf_mm(fit);
  // The likeliest of two units' rows: ln of the chance of directions and distance, and of
  // directions.
  struct Likeliest {
    double both = -std::numeric_limits<double>::infinity();
    double directions = both;
  };
  std::map<std::pair<std::size_t, std::size_t>, Likeliest> of_units;
  std::set<std::size_t> rows;
  for (const NeighbourPair& two : pairs) {
    const auto as_near = std::ranges::upper_bound(all_mm, DistanceOf_mm(fit, two)) - all_mm.begin();
    const double share = static_cast<double>(as_near) / static_cast<double>(all_mm.size());
    const double directions = LogChanceOfDirection(fit, two, 0) + LogChanceOfDirection(fit, two, 1);
    const double both = LogCombined(directions + std::log(share), 3);
    Likeliest& most = of_units[{two.unit[0], two.unit[1]}];
    most.both = std::max(most.both, both);
    most.directions = std::max(most.directions, LogCombined(directions, 2));
    if (both < std::log(kChanceMax)) rows.insert({two.row[0], two.row[1]});
  }
  Likeliest sum{0, 0};
  for (const auto& [units, most] : of_units)
    sum.both += most.both, sum.directions += most.directions;
  const double log_p = LogCombined(sum.both, of_units.size());
  if (rows.empty() || log_p > std::log(kShareOfSearch * family_wise) ||
      LogCombined(sum.directions, of_units.size()) > std::log(kChanceMax))
    return std::nullopt;
  PushedApart found{.rows = {rows.begin(), rows.end()}, .log_p = log_p};
  for (const std::size_t row : found.rows)
    found.size_um += fit.x_um[row] * fit.x_um[row] + fit.y_um[row] * fit.y_um[row];
  found.size_um = std::sqrt(found.size_um / static_cast<double>(found.rows.size()));
  return found;
}

}  // namespace focalfleet::sim
