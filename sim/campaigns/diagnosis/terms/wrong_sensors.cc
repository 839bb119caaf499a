#include "sim/campaigns/diagnosis/terms/wrong_sensors.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <span>

#include "sim/campaigns/diagnosis/model/chances.h"
#include "sim/campaigns/diagnosis/score/fleet_groups.h"

namespace focalfleet::sim {
namespace {

constexpr std::string_view kTemperature = "temp_C";
constexpr std::size_t kUnitsMin = 8;
constexpr double kReadingsMin = 8;  // readings of a unit
constexpr double kRange_K = 0.5;    // a smaller range shows no gain
constexpr double kGainMin = 0.05;   // deviation of a suspect's gain
constexpr double kSpreads = 6;      // of the units' gains
constexpr double kOfGroup = 0.8;    // of a rail's units, for the fault to be the rail's

bool ReadsTemperature(const ModelTerm& term) {
  return std::ranges::find(term.form.effect->needs, kTemperature) != term.form.effect->needs.end();
}

// A plane over the plate, by least squares. For units in a line, or few units, it is their mean.
class Plane {
 public:
  void Add(double x, double y, double value) {
    const std::array<double, 3> row = {1, x, y};
    for (std::size_t i = 0; i < 3; ++i) {
      right_[i] += row[i] * value;
      for (std::size_t j = 0; j < 3; ++j) normal_(Index(i), Index(j)) += row[i] * row[j];
    }
    ++count_;
  }
  [[nodiscard]] std::optional<Eigen::Vector3d> Solve() const {
    if (count_ == 0) return std::nullopt;
    const Eigen::Vector3d right(right_[0], right_[1], right_[2]);
    const Eigen::LDLT<Eigen::Matrix3d> solver(normal_);
    if (count_ < kUnitsMin || solver.vectorD().minCoeff() < 1e-6 * solver.vectorD().maxCoeff())
      return Eigen::Vector3d(right_[0] / static_cast<double>(count_), 0, 0);
    return solver.solve(right);
  }

 private:
  static Eigen::Index Index(std::size_t i) { return static_cast<Eigen::Index>(i); }
  Eigen::Matrix3d normal_ = Eigen::Matrix3d::Zero();
  std::array<double, 3> right_{};
  std::size_t count_ = 0;
};

// The plane's temperature at every row, of the units that are not suspect. NaN: no unit is left.
std::vector<double> PlaneTemperatures(const CampaignFacts& facts,
                                      const std::vector<char>& suspect) {
  const Campaign& campaign = *facts.campaign;
  const std::span<const double> reported = campaign.Find(kTemperature);
  std::vector<Plane> planes(facts.exposures.size());
  const auto each = [&](const auto& visit) {
    for (std::size_t unit = 0; unit < campaign.units.size(); ++unit)
      for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row)
        visit(row, suspect[unit] != 0, campaign.units[unit].base_x_mm / facts.radius_mm,
              campaign.units[unit].base_y_mm / facts.radius_mm);
  };
  each([&](std::size_t row, bool is_suspect, double x, double y) {
    if (!is_suspect && std::isfinite(reported[row]))
      planes[facts.exposures.of_row[row]].Add(x, y, reported[row]);
  });
  std::vector<std::optional<Eigen::Vector3d>> solved;
  for (const Plane& plane : planes) solved.push_back(plane.Solve());
  std::vector<double> at(reported.size(), std::nan(""));
  each([&](std::size_t row, bool, double x, double y) {
    if (const auto& plane = solved[facts.exposures.of_row[row]])
      at[row] = plane->dot(Eigen::Vector3d(1, x, y));
  });
  return at;
}

// The reading of each unit per kelvin of the plane. NaN: it has too few readings, or too little
// changes.
std::vector<double> Gains(const Campaign& campaign, const std::vector<double>& plane) {
  const std::span<const double> reported = campaign.Find(kTemperature);
  std::vector<double> gains;
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit) {
    double n = 0, x = 0, y = 0, xx = 0, xy = 0, low = 1e300, high = -1e300;
    for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row) {
      if (!std::isfinite(plane[row]) || !std::isfinite(reported[row])) continue;
      n += 1, x += plane[row], y += reported[row];
      xx += plane[row] * plane[row], xy += plane[row] * reported[row];
      low = std::min(low, plane[row]), high = std::max(high, plane[row]);
    }
    gains.push_back(n < kReadingsMin || high - low < kRange_K
                        ? std::nan("")
                        : (xy - x * y / n) / std::max(xx - x * x / n, 1e-12));
  }
  return gains;
}

struct Usual {
  double middle = 1, spread = 0;
};
Usual UsualOf(const std::vector<double>& gains, const std::vector<char>& suspect, char which) {
  std::vector<double> some, away;
  for (std::size_t unit = 0; unit < gains.size(); ++unit)
    if (suspect[unit] == which && std::isfinite(gains[unit])) some.push_back(gains[unit]);
  if (some.empty()) return {};
  Usual usual{.middle = Median(some)};
  for (const double gain : some) away.push_back(std::abs(gain - usual.middle));
  usual.spread = kSigmaOfMedian * Median(std::move(away));
  return usual;
}

// Units with another gain than `usual`.
std::vector<char> Beside(const Usual& usual, const std::vector<double>& gains) {
  std::vector<char> beside;
  for (const double gain : gains)
    beside.push_back(std::abs(gain - usual.middle) > std::max(kGainMin, kSpreads * usual.spread));
  return beside;
}

// The exposures' medians, which a few wrong sensors do not move.
std::vector<double> MedianTemperatures(const CampaignFacts& facts) {
  const std::span<const double> reported = facts.campaign->Find(kTemperature);
  std::vector<std::vector<double>> of(facts.exposures.size());
  for (std::size_t row = 0; row < reported.size(); ++row)
    if (std::isfinite(reported[row])) of[facts.exposures.of_row[row]].push_back(reported[row]);
  std::vector<double> at(reported.size(), std::nan(""));
  std::vector<double> median;
  for (std::vector<double>& values : of)
    median.push_back(values.empty() ? std::nan("") : Median(std::move(values)));
  for (std::size_t row = 0; row < reported.size(); ++row)
    at[row] = median[facts.exposures.of_row[row]];
  return at;
}

// The suspects to begin with. A rail's sensors may be wrong together: the search begins with each
// single rail as right, or else with the median.
std::vector<std::vector<char>> Beginnings(const FleetGroups& groups, const CampaignFacts& facts) {
  constexpr std::uint32_t kRailsMost = 12;
  const std::size_t units = facts.campaign->units.size();
  const std::vector<double> gains = Gains(*facts.campaign, MedianTemperatures(facts));
  std::vector<std::vector<char>> begin = {
      Beside(UsualOf(gains, std::vector<char>(units, 0), 0), gains)};
  for (std::uint32_t believed = 0; believed < std::min<std::size_t>(groups.rails, kRailsMost);
       ++believed) {
    begin.emplace_back();
    for (const std::uint32_t rail : groups.rail) begin.back().push_back(rail != believed);
  }
  return begin;
}

// The suspects, with the plane of the others and all gains.
struct Settled {
  std::vector<char> suspect;
  std::vector<double> plane, gains;
  [[nodiscard]] std::ptrdiff_t suspects() const { return std::ranges::count(suspect, char{1}); }
  [[nodiscard]] std::ptrdiff_t reporting() const {
    return std::ranges::count_if(gains, [](double gain) { return std::isfinite(gain); });
  }
  // A majority is believed.
  [[nodiscard]] bool can_be() const { return reporting() > 0 && 2 * suspects() <= reporting(); }
};

// Wrong sensors bend the plane: it is made anew by the remaining units, until the suspects stay the
// same.
Settled Settle(const CampaignFacts& facts, std::vector<char> suspect) {
  constexpr int kRounds = 8;
  Settled now{.suspect = std::move(suspect), .plane = {}, .gains = {}};
  for (int round = 0;; ++round) {
    now.plane = PlaneTemperatures(facts, now.suspect);
    now.gains = Gains(*facts.campaign, now.plane);
    std::vector<char> next = Beside(UsualOf(now.gains, now.suspect, 0), now.gains);
    if (next == now.suspect || round == kRounds) return now;
    now.suspect = std::move(next);
  }
}

// The owner of the suspects.
Owner OwnerOf(const FleetGroups& groups, const std::vector<char>& suspect) {
  const auto whole = [&](const std::vector<std::uint32_t>& group, std::size_t count) {
    std::vector<double> all(count, 0), have(count, 0);
    for (std::size_t unit = 0; count > 0 && unit < suspect.size(); ++unit) {
      if (group[unit] == kNoGroup) return false;
      all[group[unit]] += 1, have[group[unit]] += suspect[unit];
    }
    for (std::size_t k = 0; k < count; ++k)
      if (have[k] > 0 && have[k] < kOfGroup * all[k]) return false;
    return count > 0;
  };
  return whole(groups.rail, groups.rails)  ? Owner::kRail
         : whole(groups.bus, groups.buses) ? Owner::kBus
                                           : Owner::kUnit;
}

}  // namespace

std::string WhyNoSensorIsTested(const CampaignFacts& facts) {
  const FilledColumn* reported = facts.Find(kTemperature);
  if (reported == nullptr) return "column temp_C is missing";
  if (reported->high - reported->low < kRange_K) return "the temperature hardly changes";
  if (facts.campaign->units.size() < kUnitsMin) return "too few units around a sensor";
  return {};
}

bool ReadsTemperature(const CampaignModel& model) {
  return std::ranges::any_of(model.terms,
                             [](const ModelTerm& term) { return ReadsTemperature(term); });
}

std::unique_ptr<TrueTemperatures> FindSuspectSensors(const CampaignFacts& facts) {
  const Campaign& campaign = *facts.campaign;
  const FleetGroups groups = GroupsOf(facts);
  // The possible solution whose believed units agree best with each other.
  Settled best;
  double least = std::numeric_limits<double>::infinity();
  for (std::vector<char>& begin : Beginnings(groups, facts)) {
    Settled one = Settle(facts, std::move(begin));
    const double spread = UsualOf(one.gains, one.suspect, 0).spread;
    if (!one.can_be() || spread >= least) continue;
    least = spread;
    best = std::move(one);
  }
  if (best.suspects() == 0) return nullptr;
  auto truth = std::make_unique<TrueTemperatures>();
  for (std::size_t unit = 0; unit < best.suspect.size(); ++unit)
    if (best.suspect[unit] != 0) truth->units.push_back(unit);
  truth->are_half = 2 * best.suspects() == best.reporting();
  truth->owner = OwnerOf(groups, best.suspect);
  const Usual theirs = UsualOf(best.gains, best.suspect, 1);
  truth->gain = theirs.middle;
  // A single suspect has no scatter: that of the right ones is used.
  truth->gain_sigma = std::max(theirs.spread, UsualOf(best.gains, best.suspect, 0).spread);
  truth->campaign = campaign;
  for (Covariate& column : truth->campaign.covariates)
    if (column.name == kTemperature)
      for (const std::size_t unit : truth->units)
        for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row)
          if (std::isfinite(best.plane[row])) column.values[row] = best.plane[row];
  truth->facts = MakeFacts(truth->campaign);
  return truth;
}

CauseFound SensorCause(const Fit& fit, const TrueTemperatures& truth,
                       const CampaignFacts& as_reported, bool decided) {
  CauseFound cause = CauseNamed(kSensorBias);
  CampaignModel thermal;
  thermal.units = fit.model.units;
  for (const ModelTerm& term : fit.model.terms) {
    if (!ReadsTemperature(term)) continue;
    thermal.terms.push_back(term);
    const std::string name(term.form.effect->cause);
    if (!decided && std::ranges::find(cause.candidates, name) == cause.candidates.end())
      cause.candidates.push_back(name);
  }
  const Places right = Predict(thermal, *fit.facts, fit.parallel);
  const Places wrong = Predict(thermal, as_reported, fit.parallel);
  double square = 0, count = 0;
  for (const std::size_t unit : truth.units) {
    cause.units.push_back(truth.campaign.units[unit].id);
    for (std::size_t row = truth.campaign.first_row[unit]; row < truth.campaign.first_row[unit + 1];
         ++row)
      square += std::pow(right.x_mm[row] - wrong.x_mm[row], 2) +
                std::pow(right.y_mm[row] - wrong.y_mm[row], 2),
          count += 1;
  }
  cause.axis = "none";
  cause.scope = Name(truth.owner);
  cause.amplitude_unit = "gain";
  cause.amplitude = truth.gain - 1;
  const double sigma = truth.gain_sigma / std::sqrt(static_cast<double>(truth.units.size()));
  cause.ci95[0] = cause.amplitude - 1.96 * sigma;
  cause.ci95[1] = cause.amplitude + 1.96 * sigma;
  cause.size_um = count > 0 ? 1e3 * std::sqrt(square / count) : 0;
  cause.shape = "tells " + std::to_string(truth.gain).substr(0, 5) + " K a kelvin of those around";
  if (truth.are_half) cause.shape += ", or these tell too much or too little";
  cause.paragraph =
      "These boards tell a temperature that runs with another gain than all around them, and arms "
      "and gears go with that of the others: calibrate the sensors. The model goes by the plane "
      "through the other units' temperatures.";
  return cause;
}

}  // namespace focalfleet::sim
