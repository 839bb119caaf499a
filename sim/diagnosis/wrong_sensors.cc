#include "sim/diagnosis/wrong_sensors.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>

#include "sim/diagnosis/chances.h"

namespace focalfleet::sim {
namespace {

constexpr std::string_view kTemperature = "temp_C";
constexpr std::size_t kUnitsMin = 8;
constexpr double kRange_K = 2;     // less tells no gain
constexpr double kGainMin = 0.05;  // off, to be suspect
constexpr double kSpreads = 6;     // of the units' gains
constexpr double kOfGroup = 0.8;   // of a rail's units, for it to be the rail's

bool ReadsTemperature(const ModelTerm& term) {
  return std::ranges::find(term.form.effect->needs, kTemperature) != term.form.effect->needs.end();
}

// A plane over the plate, least squares. Where units stand in a line, or are few: their mean.
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

// The plane's temperature at every row, of the units that are not suspect. NaN: nobody is left.
std::vector<double> PlaneTemperatures(const Campaign& campaign, const CampaignFacts& facts,
                                      const std::vector<char>& suspect) {
  const std::vector<double>& told = facts.Find(kTemperature)->values;
  std::vector<Plane> planes(facts.exposures.size());
  const auto each = [&](const auto& visit) {
    for (std::size_t unit = 0; unit < campaign.units.size(); ++unit)
      for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row)
        visit(unit, row);
  };
  each([&](std::size_t unit, std::size_t row) {
    if (suspect[unit] == 0)
      planes[facts.exposures.of_row[row]].Add(campaign.units[unit].base_x_mm,
                                              campaign.units[unit].base_y_mm, told[row]);
  });
  std::vector<std::optional<Eigen::Vector3d>> solved;
  for (const Plane& plane : planes) solved.push_back(plane.Solve());
  std::vector<double> at(told.size(), std::nan(""));
  each([&](std::size_t unit, std::size_t row) {
    if (const auto& plane = solved[facts.exposures.of_row[row]])
      at[row] = plane->dot(
          Eigen::Vector3d(1, campaign.units[unit].base_x_mm, campaign.units[unit].base_y_mm));
  });
  return at;
}

// What each unit tells a kelvin of the plane. NaN: the plane's temperature hardly changes.
std::vector<double> Gains(const Campaign& campaign, const std::vector<double>& told,
                          const std::vector<double>& plane) {
  std::vector<double> gains;
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit) {
    double n = 0, x = 0, y = 0, xx = 0, xy = 0, low = 1e300, high = -1e300;
    for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row) {
      if (!std::isfinite(plane[row])) continue;
      n += 1, x += plane[row], y += told[row];
      xx += plane[row] * plane[row], xy += plane[row] * told[row];
      low = std::min(low, plane[row]), high = std::max(high, plane[row]);
    }
    gains.push_back(high - low < kRange_K ? std::nan("")
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
  usual.spread = 1.4826 * Median(std::move(away));
  return usual;
}

// To begin with somebody: sensors of one rail may be wrong together.
std::vector<char> NotOfTheLargestRail(const Campaign& campaign) {
  std::map<double, std::size_t> rails;
  for (const CampaignUnit& unit : campaign.units)
    if (std::isfinite(unit.rail)) ++rails[unit.rail];
  std::vector<char> others(campaign.units.size(), 0);
  if (rails.empty()) return others;
  const double largest =
      std::ranges::max_element(rails, {}, [](const auto& one) { return one.second; })->first;
  for (std::size_t unit = 0; unit < others.size(); ++unit)
    others[unit] = campaign.units[unit].rail != largest;
  return others;
}

// Whose the suspects are.
Owner OwnerOf(const Campaign& campaign, const std::vector<char>& suspect) {
  const auto whole = [&](double CampaignUnit::*group) {
    for (std::size_t unit = 0; unit < suspect.size(); ++unit) {
      if (!std::isfinite(campaign.units[unit].*group)) return false;
      double all = 0, have = 0;
      for (std::size_t other = 0; other < suspect.size(); ++other)
        if (campaign.units[other].*group == campaign.units[unit].*group)
          all += 1, have += suspect[other];
      if (suspect[unit] != 0 && have < kOfGroup * all) return false;
    }
    return true;
  };
  return whole(&CampaignUnit::rail)  ? Owner::kRail
         : whole(&CampaignUnit::bus) ? Owner::kBus
                                     : Owner::kUnit;
}

}  // namespace

std::string WhyNoSensorIsTested(const CampaignFacts& facts) {
  const FilledColumn* told = facts.Find(kTemperature);
  if (told == nullptr) return "column temp_C is missing";
  if (told->high - told->low < kRange_K) return "the temperature hardly changes";
  if (facts.campaign->units.size() < kUnitsMin) return "too few units around a sensor";
  return {};
}

bool ReadsTemperature(const CampaignModel& model) {
  return std::ranges::any_of(model.terms,
                             [](const ModelTerm& term) { return ReadsTemperature(term); });
}

std::unique_ptr<TrueTemperatures> FindSuspectSensors(const Campaign& campaign,
                                                     const CampaignFacts& facts) {
  const FilledColumn* told = facts.Find(kTemperature);
  std::vector<char> suspect = NotOfTheLargestRail(campaign);
  std::vector<double> plane, gains;
  const auto settle = [&] {
    // Wrong ones bend the plane: by who is left, until it rests.
    constexpr int kRounds = 5;
    for (int round = 0; round < kRounds; ++round) {
      plane = PlaneTemperatures(campaign, facts, suspect);
      gains = Gains(campaign, told->values, plane);
      const Usual usual = UsualOf(gains, suspect, 0);
      std::vector<char> now(suspect.size(), 0);
      for (std::size_t unit = 0; unit < now.size(); ++unit)
        now[unit] =
            std::abs(gains[unit] - usual.middle) > std::max(kGainMin, kSpreads * usual.spread);
      if (now == suspect) break;
      suspect = std::move(now);
    }
  };
  settle();
  // The many are believed.
  if (2 * std::ranges::count(suspect, char{1}) > std::ssize(suspect)) {
    for (char& one : suspect) one = one == 0;
    settle();
  }
  if (2 * std::ranges::count(suspect, char{1}) > std::ssize(suspect)) return nullptr;
  auto truth = std::make_unique<TrueTemperatures>();
  for (std::size_t unit = 0; unit < suspect.size(); ++unit)
    if (suspect[unit] != 0) truth->units.push_back(unit);
  if (truth->units.empty()) return nullptr;
  truth->owner = OwnerOf(campaign, suspect);
  const Usual theirs = UsualOf(gains, suspect, 1);
  truth->gain = theirs.middle;
  truth->gain_sigma = theirs.spread;
  truth->campaign = campaign;
  for (Covariate& column : truth->campaign.covariates)
    if (column.name == kTemperature)
      for (const std::size_t unit : truth->units)
        for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row)
          column.values[row] = plane[row];
  truth->facts = MakeFacts(truth->campaign);
  return truth;
}

CauseFound SensorCause(const Fit& fit, const TrueTemperatures& truth, const CampaignFacts& as_told,
                       bool decided) {
  CauseFound cause;
  cause.cause = kSensorBias;
  cause.candidates = {cause.cause};
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
  const Places wrong = Predict(thermal, as_told, fit.parallel);
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
  Fit misled = fit;
  misled.facts = &as_told;
  UpdateResiduals(&misled);
  cause.delta_log_likelihood = std::max(0.0, (Merit(fit) - Merit(misled)) / 2);
  cause.shape = "tells " + std::to_string(truth.gain).substr(0, 5) + " K a kelvin of those around";
  cause.paragraph =
      "These boards tell a temperature that runs with another gain than all around them, and arms "
      "and gears go with that of the others: calibrate the sensors. The model goes by the plane "
      "through the other units' temperatures.";
  return cause;
}

}  // namespace focalfleet::sim
