// Planted campaigns and their verdicts, for the tests of the diagnosis.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <string>
#include <vector>

#include "protocol/base/rng.h"
#include "protocol/base/units.h"
#include "sim/campaigns/diagnosis/decide/diagnosis.h"
#include "sim/campaigns/diagnosis/model/fit.h"
#include "sim/campaigns/planting/planted.h"

namespace focalfleet::sim::test {

/// A campaign of exactly `options.units` units; 24 are enough for most tests and quick to diagnose.
inline Campaign Planted(std::vector<PlantedEffect> effects,
                        PlantedOptions options = {.units = 24}) {
  options.effects = std::move(effects);
  auto campaign = PlantCampaign(options);
  EXPECT_TRUE(campaign) << campaign.error().text;
  EXPECT_EQ(campaign->units.size(), options.units);
  return *campaign;
}

/// Turns every fibre about its base, as if the theta angle of that row were off. No effect of the
/// library does this.
inline void TurnTheta(const std::function<double(std::size_t row)>& off_deg, Campaign* campaign) {
  for (std::size_t unit = 0; unit < campaign->units.size(); ++unit)
    for (std::size_t row = campaign->first_row[unit]; row < campaign->first_row[unit + 1]; ++row) {
      const double off = off_deg(row) * std::numbers::pi / 180;
      const CampaignUnit& base = campaign->units[unit];
      const double x = campaign->x_mm[row] - base.base_x_mm;
      const double y = campaign->y_mm[row] - base.base_y_mm;
      campaign->x_mm[row] = base.base_x_mm + std::cos(off) * x - std::sin(off) * y;
      campaign->y_mm[row] = base.base_y_mm + std::sin(off) * x + std::cos(off) * y;
    }
}

/// Exchanges the fibres of two units. Pre: as many moves of both.
inline void ExchangePlaces(std::size_t a, std::size_t b, Campaign* campaign) {
  for (std::vector<double>* place : {&campaign->x_mm, &campaign->y_mm}) {
    const auto at = [&](std::size_t k) {
      return place->begin() + static_cast<std::ptrdiff_t>(campaign->first_row[k]);
    };
    std::swap_ranges(at(a), at(a + 1), at(b));
  }
}

/// A campaign whose theta angle follows the air's humidity, bent, up to 0.12 degrees.
inline Campaign Damp(std::uint64_t seed) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 80, .seed = seed});
  const Exposures exposures = FindExposures(campaign);
  Rng rng = Rng::Stream(seed, "humidity");
  std::vector<double> of_exposure(exposures.size());
  for (double& humidity : of_exposure) humidity = rng.Uniform(20, 90);
  Covariate column{.name = "humidity_pct", .values = {}};
  for (std::size_t row = 0; row < campaign.rows(); ++row)
    column.values.push_back(of_exposure[exposures.of_row[row]]);
  TurnTheta([&](std::size_t row) { return 0.12 * std::pow((column.values[row] - 20) / 70, 2); },
            &campaign);
  campaign.covariates.push_back(std::move(column));
  return campaign;
}

inline constexpr double kPull_deg = 0.03;

/// Angles of rotors, anywhere.
inline std::vector<double> RandomPhases_deg(std::size_t units, std::uint64_t seed) {
  Rng rng = Rng::Stream(seed, "rotors");
  std::vector<double> phases(units);
  for (double& phase : phases) phase = rng.Uniform(0, 360);
  return phases;
}

/// Each theta motor is pulled by its neighbours', whose rotors stand at these angles.
inline Campaign Pulled(const std::vector<double>& phases_deg, std::uint64_t seed) {
  Campaign campaign = Planted({}, {.units = phases_deg.size(), .moves = 60, .seed = seed});
  const CampaignFacts facts = MakeFacts(campaign);
  std::vector<double> off_deg(campaign.rows(), 0);
  for (std::size_t u = 0; u < phases_deg.size(); ++u)
    for (const std::size_t v : facts.neighbours[u])
      for (const PullingPair& pair : PullOf(facts, u, v, kTheta))
        off_deg[pair.row] +=
            kPull_deg * pair.nearness *
            std::sin(pair.angle_rad + kRadiansPerDegree * (phases_deg[u] - phases_deg[v]));
  TurnTheta([&](std::size_t row) { return off_deg[row]; }, &campaign);
  return campaign;
}

/// The fit of geometry alone, as a diagnosis starts. The facts outlive the fit.
inline Fit StaticFit(const CampaignFacts& facts) {
  CampaignModel model;
  model.units = facts.campaign->units;
  return StartFit(facts, model, std::vector<char>(facts.campaign->rows(), 0), OneAfterTheOther());
}

inline Diagnosis Verdicts(const Campaign& campaign, DiagnoseOptions options = {}) {
  options.with_gain = false;
  return Diagnose(campaign, options);
}

inline std::string Reported(const Diagnosis& diagnosis) {
  std::string text(Name(diagnosis.verdict));
  for (const CauseFound& cause : diagnosis.causes) {
    text += "; " + cause.cause + " " + cause.axis + " " + cause.scope + " " +
            std::to_string(cause.amplitude);
    for (const std::string& candidate : cause.candidates) text += " " + candidate;
  }
  for (const UnknownFound& unknown : diagnosis.unknown) text += "; against " + unknown.covariate;
  return text;
}

}  // namespace focalfleet::sim::test
