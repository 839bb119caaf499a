#include "sim/campaigns/diagnosis/terms/outliers.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <set>

#include "sim/campaigns/diagnosis/model/chances.h"
#include "sim/campaigns/diagnosis/terms/events.h"

namespace focalfleet::sim {
namespace {

constexpr double kFarWhitened = 6;  // whitened length
constexpr double kStuckTravel_deg = 5;
constexpr double kStuckSpread_mm = 0.03;
constexpr double kClusterLeast = 4;        // units and exposures
constexpr std::size_t kClusterMost = 200;  // far visits in a window
// Share of the visits that are as near: some units do not move, or touch little.
constexpr double kTouchedLeast = 1.0 / 3;
// Visits that decide whether arms touch at wider gaps, too.
constexpr std::size_t kNextTouched = 12;
constexpr double kBeyondMost = 0.1;  // of that share, of arms that are farther apart
constexpr std::string_view kClusterColumns[] = {kCommand[kTheta], kCommand[kPhi], kArmGap};
constexpr double kMostRows = 0.3;  // of a unit's rows: the unit itself is named
// Times other units' distance: the unit is named, whatever its noise.
constexpr double kFarMore = 4;
constexpr std::size_t kOthersMin = 8;

double SpreadOf(const std::vector<double>& values) {
  return values.empty() ? 0 : Quantile(values, 0.95) - Quantile(values, 0.05);
}

// Whether the unit was commanded to move, and does not.
bool IsStuck(const Campaign& campaign, std::size_t unit) {
  std::vector<double> x, y;
  double low[2] = {1e300, 1e300}, high[2] = {-1e300, -1e300};
  for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row) {
    if (!std::isfinite(campaign.x_mm[row])) continue;
    x.push_back(campaign.x_mm[row]);
    y.push_back(campaign.y_mm[row]);
    for (const std::size_t axis : {kTheta, kPhi}) {
      low[axis] = std::min(low[axis], campaign.cmd_deg[axis][row]);
      high[axis] = std::max(high[axis], campaign.cmd_deg[axis][row]);
    }
  }
  return x.size() >= 4 && std::max(high[0] - low[0], high[1] - low[1]) > kStuckTravel_deg &&
         SpreadOf(x) < kStuckSpread_mm && SpreadOf(y) < kStuckSpread_mm;
}

// Whether the fibre stayed where the move began.
bool Stayed(const Fit& fit, std::size_t unit, std::size_t row) {
  const Campaign& campaign = *fit.facts->campaign;
  const double from_x_um = 1e3 * campaign.x_mm[row], from_y_um = 1e3 * campaign.y_mm[row];
  const PlacePoint start =
      PlaceOf(fit.model.units[unit], campaign.from_deg[kTheta][row], campaign.from_deg[kPhi][row]);
  const double miss = std::hypot(fit.x_um[row], fit.y_um[row]);
  return std::hypot(from_x_um - 1e3 * start.x_mm, from_y_um - 1e3 * start.y_mm) < 0.2 * miss;
}

// A visit is an axis' stay at one value of a column. A row that is far because of its pose is far
// as long as the axis stays there.
struct Visit {
  double value = 0;
  std::size_t row = 0;  // its first, or its first far one
  std::size_t unit = 0;
  std::size_t rows = 0;
  bool far = false;
};

std::vector<Visit> VisitsOf(const Fit& fit, const FilledColumn& column,
                            const std::vector<char>& is_far) {
  const std::vector<std::size_t>& first_row = fit.facts->campaign->first_row;
  // Without a near arm the column has no gap.
  const FilledColumn* side =
      &column == fit.facts->Find(kArmGap) ? fit.facts->Find(kArmGapSide) : nullptr;
  std::vector<Visit> visits;
  for (std::size_t unit = 0; unit + 1 < first_row.size(); ++unit) {
    bool begins = true;
    for (std::size_t row = first_row[unit]; row < first_row[unit + 1]; ++row) {
      if (fit.aside[row] != 0 || !std::isfinite(fit.x_um[row])) continue;
      if (side != nullptr && side->values[row] == 0) continue;
      if (begins || column.values[row] != visits.back().value)
        visits.push_back({.value = column.values[row], .row = row, .unit = unit});
      begins = false;
      ++visits.back().rows;
      if (is_far[row] == 0 || visits.back().far) continue;
      visits.back().far = true;
      visits.back().row = row;
    }
  }
  std::ranges::stable_sort(visits, {}, &Visit::value);
  return visits;
}

struct Window {
  double log_p = 0;  // of so many far visits in so narrow a window, of all windows
  std::vector<const Visit*> visits;
};

// The window from one far visit to another that chance fills least, of all such windows. `visits`
// in the order of their values.
Window DensestOf(const std::vector<Visit>& visits, const Exposures& exposures) {
  std::vector<std::size_t> far, rows_before = {0};
  for (std::size_t k = 0; k < visits.size(); ++k) {
    if (visits[k].far) far.push_back(k);
    rows_before.push_back(rows_before.back() + visits[k].rows);
  }
  // Ties are taken whole: the order of equal values means nothing.
  const auto begin_of = [&](std::size_t k) {
    const auto first = std::ranges::lower_bound(visits, visits[k].value, {}, &Visit::value);
    return static_cast<std::size_t>(first - visits.begin());
  };
  const auto end_of = [&](std::size_t k) {
    const auto past = std::ranges::upper_bound(visits, visits[k].value, {}, &Visit::value);
    return static_cast<std::size_t>(past - visits.begin());
  };
  const auto all = static_cast<double>(far.size());
  Window densest;
  std::size_t begin = 0, end = 0;
  for (std::size_t i = 0; i < far.size(); ++i) {
    // Visits of one unit, or of one exposure, count once: they may have another common reason.
    std::set<std::size_t> units, together;
    for (std::size_t j = i; j < std::min(far.size(), i + kClusterMost); ++j) {
      units.insert(visits[far[j]].unit);
      together.insert(exposures.of_row[visits[far[j]].row]);
      const auto k = static_cast<double>(std::min(units.size(), together.size()));
      if (k < kClusterLeast) continue;
      // A longer visit has more rows that can be far.
      const double share =
          static_cast<double>(rows_before[end_of(far[j])] - rows_before[begin_of(far[i])]) /
          static_cast<double>(rows_before.back());
      // The expected number of sets of k that lie so close; of any k.
      const double log_p =
          LogChoose(all, k) + std::log(k) + (k - 1) * std::log(share) + std::log(all);
      if (log_p < densest.log_p) densest.log_p = log_p, begin = i, end = j + 1;
    }
  }
  for (std::size_t i = begin; i < end; ++i) densest.visits.push_back(&visits[far[i]]);
  return densest;
}

// Units that are far more off than others are, in most rows and without a cause.
std::vector<std::uint32_t> FarMoreThanOthers(const Fit& fit) {
  const std::vector<std::size_t>& first_row = fit.facts->campaign->first_row;
  std::vector<std::pair<double, std::uint32_t>> usual_um;
  std::vector<double> all_um;
  for (std::size_t unit = 0; unit + 1 < first_row.size(); ++unit) {
    std::vector<double> off_um;
    for (std::size_t row = first_row[unit]; row < first_row[unit + 1]; ++row)
      if (fit.aside[row] == 0 && std::isfinite(fit.x_um[row]))
        off_um.push_back(std::hypot(fit.x_um[row], fit.y_um[row]));
    if (off_um.empty()) continue;
    usual_um.emplace_back(Median(std::move(off_um)), fit.model.units[unit].id);
    all_um.push_back(usual_um.back().first);
  }
  std::vector<std::uint32_t> far;
  if (all_um.size() < kOthersMin) return far;
  const double most_um = kFarMore * Median(std::move(all_um));
  for (const auto& [off_um, id] : usual_um)
    if (off_um > most_um) far.push_back(id);
  return far;
}

// The squared whitened length of a used row, without its weight.
double SquareLength(const Fit& fit, const WhiteUnit& white, std::size_t k) {
  const auto at = static_cast<Eigen::Index>(2 * k);
  return white.y.segment(at, 2).squaredNorm() / fit.weight[white.track.first_row + white.moves[k]];
}

double MissSquare_um2(const Fit& fit, std::size_t row) {
  return fit.x_um[row] * fit.x_um[row] + fit.y_um[row] * fit.y_um[row];
}

// The widest gap at which arms touch: from the window on, as long as many of the next visits are
// far.
double WidestTouch_mm(const std::vector<Visit>& visits, const Window& window, double pitch_mm) {
  auto end = std::ranges::upper_bound(visits, window.visits.back()->value, {}, &Visit::value);
  const auto many_of_next = [&] {
    const auto next = std::min<std::ptrdiff_t>(kNextTouched, visits.end() - end);
    const auto far = std::count_if(end, end + next, [](const Visit& visit) { return visit.far; });
    return next > 0 && static_cast<double>(far) >= kTouchedLeast * static_cast<double>(next);
  };
  while (many_of_next()) ++end;
  return std::min(std::prev(end)->value, kThickestArm * pitch_mm);
}

// Far rows whose arms are near enough to touch. Empty where many visits there are not far, or many
// beyond are: the arms are not the reason then. `far`: rows.
std::vector<std::size_t> TouchedRows(const Fit& fit, const std::vector<Visit>& visits,
                                     const Window& window, const std::vector<std::size_t>& far) {
  const double touching_mm = WidestTouch_mm(visits, window, fit.facts->pitch_mm);
  std::array<double, 2> all{}, are_far{};  // by whether they are near
  for (const Visit& visit : visits) {
    const std::size_t near = visit.value <= touching_mm ? 1 : 0;
    ++all[near];
    if (visit.far) ++are_far[near];
  }
  if (all[1] == 0 || are_far[1] < kTouchedLeast * all[1]) return {};
  if (are_far[0] * all[1] > kBeyondMost * are_far[1] * all[0]) return {};
  const std::vector<double>& gap_mm = fit.facts->Find(kArmGap)->values;
  const std::vector<double>& side = fit.facts->Find(kArmGapSide)->values;
  std::vector<std::size_t> rows;
  for (const std::size_t row : far)
    if (side[row] != 0 && gap_mm[row] <= touching_mm) rows.push_back(row);
  return rows;
}

// ln L that these rows lose by being where they are in place of where they should be. `rows`
// ascend.
double LostIn(const Fit& fit, const std::vector<std::size_t>& rows) {
  double lost = 0;
  auto next = rows.begin();
  for (std::size_t unit = 0; next != rows.end(); ++unit) {
    if (*next >= fit.facts->campaign->first_row[unit + 1]) continue;
    const WhiteUnit white = Whiten(fit, unit);
    for (std::size_t k = 0; k < white.moves.size() && next != rows.end(); ++k) {
      const std::size_t row = white.track.first_row + white.moves[k];
      while (next != rows.end() && *next < row) ++next;
      if (next == rows.end() || *next != row) continue;
      lost += MinusLogDensity(SquareLength(fit, white, k));
      ++next;
    }
    next = std::ranges::lower_bound(next, rows.end(), fit.facts->campaign->first_row[unit + 1]);
  }
  return lost;
}

}  // namespace

OutliersFound FindBeforeFit(const CampaignFacts& facts, const RepeatedPlaces& repeated,
                            std::vector<char>* aside) {
  const Campaign& campaign = *facts.campaign;
  OutliersFound found;
  aside->assign(campaign.rows(), 0);
  std::vector<const char*> unseen(campaign.rows(), "not seen");
  for (const std::size_t row : repeated.carried_on)
    unseen[row] = "carried on, the unit was not moved";
  for (const std::size_t row : repeated.copied) unseen[row] = "the exposure repeats the one before";
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit) {
    const bool stuck = IsStuck(campaign, unit);
    const CampaignUnit& u = campaign.units[unit];
    if (stuck) found.units.push_back(u.id);
    for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row) {
      std::string why;
      if (!std::isfinite(campaign.x_mm[row])) {
        why = unseen[row];
      } else if (stuck) {
        why = "stuck unit";
        (*aside)[row] = 1;
      }
      if (why.empty()) continue;
      ++found.why[why];
      ++found.rows;
    }
  }
  return found;
}

void SetAside(const std::vector<std::size_t>& rows, const std::string& why,
              std::vector<char>* aside, OutliersFound* found) {
  for (const std::size_t row : rows) {
    if ((*aside)[row] != 0) continue;
    (*aside)[row] = 1;
    ++found->rows;
    ++found->why[why];
  }
}

std::vector<std::size_t> FindAfterFit(const Fit& fit, OutliersFound* found) {
  std::vector<std::size_t> far_rows;
  const Campaign& campaign = *fit.facts->campaign;
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit) {
    const WhiteUnit white = Whiten(fit, unit);
    std::size_t far = 0;
    for (std::size_t k = 0; k < white.moves.size(); ++k) {
      const std::size_t row = white.track.first_row + white.moves[k];
      if (SquareLength(fit, white, k) <= kFarWhitened * kFarWhitened) continue;
      ++far;
      far_rows.push_back(row);
      ++found->rows;
      ++found->why[Stayed(fit, unit, row) ? "move did not happen" : "far from every prediction"];
    }
    if (static_cast<double>(far) > kMostRows * static_cast<double>(white.moves.size()))
      found->units.push_back(campaign.units[unit].id);
  }
  for (const std::uint32_t unit : FarMoreThanOthers(fit)) found->units.push_back(unit);
  std::sort(found->units.begin(), found->units.end());
  found->units.erase(std::unique(found->units.begin(), found->units.end()), found->units.end());
  return far_rows;
}

std::optional<Cluster> FindCluster(const Fit& fit, const std::vector<std::size_t>& far,
                                   double family_wise) {
  std::vector<char> is_far(fit.weight.size(), 0);
  for (const std::size_t row : far) is_far[row] = 1;
  std::optional<Cluster> best;
  double least =
      std::log(kShareOfSearch * family_wise / static_cast<double>(std::size(kClusterColumns)));
  for (const std::string_view name : kClusterColumns) {
    const FilledColumn* column = fit.facts->Find(name);
    if (column == nullptr || !column->varies()) continue;
    const std::vector<Visit> visits = VisitsOf(fit, *column, is_far);
    const Window window = DensestOf(visits, fit.facts->exposures);
    if (window.log_p >= least) continue;
    least = window.log_p;
    double square = 0;
    for (const Visit* visit : window.visits) square += MissSquare_um2(fit, visit->row);
    best = {.reported = {.covariate = std::string(name),
                         .channel = "rows far from every prediction",
                         .p_value = std::exp(window.log_p) *
                                    static_cast<double>(std::size(kClusterColumns)),
                         .size_um = std::sqrt(square / static_cast<double>(visits.size())),
                         .delta_log_likelihood = -window.log_p},
            .touched = name == kArmGap ? TouchedRows(fit, visits, window, far)
                                       : std::vector<std::size_t>()};
  }
  return best;
}

CauseFound TouchCause(const Fit& fit, const std::vector<std::size_t>& rows) {
  CauseFound cause = CauseNamed(kContact);
  cause.axis = "both";
  cause.scope = "unit";
  const std::vector<std::size_t>& first_row = fit.facts->campaign->first_row;
  std::set<std::uint32_t> units, exposures;
  double square = 0;
  for (const std::size_t row : rows) {
    const auto past = std::ranges::upper_bound(first_row, row);
    units.insert(fit.model.units[static_cast<std::size_t>(past - first_row.begin()) - 1].id);
    exposures.insert(fit.facts->exposures.of_row[row]);
    square += MissSquare_um2(fit, row);
  }
  cause.units.assign(units.begin(), units.end());
  cause.all_units = units.size() == fit.model.units.size();
  cause.amplitude_unit = "moves";
  cause.amplitude = static_cast<double>(exposures.size());
  cause.ci95[0] = cause.ci95[1] = cause.amplitude;
  cause.size_um = std::sqrt(square / static_cast<double>(rows.size()));
  cause.delta_log_likelihood = LostIn(fit, rows);
  cause.paragraph =
      "Where arms come nearest to each other their fibres are far from their place, in these moves "
      "alone: they have touched. Look at the arms, and at the plans of these moves.";
  return cause;
}

}  // namespace focalfleet::sim
