// Rotors that are turned so far that their ripple is no sine, by physics of this file's own.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <numeric>

#include "sim/campaigns/diagnosis/search/rotors.h"
#include "sim/campaigns/effects/registry.h"
#include "sim/campaigns/effects/rotor_ways.h"
#include "tests/sim/campaigns/planting/planted_campaign.h"

namespace focalfleet::sim {
namespace {

using test::Planted;
using test::Reported;
using test::StaticFit;
using test::TurnTheta;
using test::Verdicts;

constexpr double kDegree = std::numbers::pi / 180;

struct Motion {
  double rotor;      // commanded angle, radians
  double direction;  // 1 or -1
  double drive;      // of the nominal drive
  double supply;     // of the usual voltage
  std::uint32_t unit;
};

// The angle by which a cause turns the rotor away from its field, in radians.
using Turned = std::function<double(const Motion&)>;

double Phase(std::uint32_t unit) { return 2.4 * unit; }

// The solution of sin(lag) = torque / drive, with the torque at the place to which the lag leads.
double DetentLag(double detent, double order, const Motion& motion) {
  double lag = 0;
  for (int i = 0; i < 200; ++i) {
    const double at = motion.rotor + lag;
    const double torque = detent * std::sin(order * at + Phase(motion.unit)) / motion.drive;
    lag = 0.5 * lag + 0.5 * std::asin(std::clamp(-torque, -1.0, 1.0));
  }
  return lag;
}

// The turn of a field whose phases are unequal: an ellipse.
double EllipseTurn(double unequal, const Motion& motion) {
  const double rotor = motion.rotor, back = Phase(motion.unit) - rotor;
  const double x = std::cos(rotor) + unequal * std::cos(back);
  const double y = std::sin(rotor) + unequal * std::sin(back);
  return std::remainder(std::atan2(y, x) - rotor, 2 * std::numbers::pi);
}

// The lag of a load that the tuning includes, at a voltage that it does not.
double SinkingLag(double load, const Motion& motion) {
  const auto lag = [&](double supply) {
    return std::asin(std::min(load / (motion.drive * supply), 0.98));
  };
  return -motion.direction * (lag(motion.supply) - lag(1));
}

Campaign RotorsTurned(const Turned& turned, std::uint64_t seed) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 120, .seed = seed});
  std::vector<double> off_deg(campaign.rows(), 0);
  const auto column = [&](const char* name) -> std::vector<double>& {
    return std::ranges::find(campaign.covariates, name, &Covariate::name)->values;
  };
  const std::vector<double>& drive = column("drive_amplitude");
  std::vector<double>& volts = column("v_bus_V");
  const double usual_V =
      std::accumulate(volts.begin(), volts.end(), 0.0) / static_cast<double>(volts.size());
  constexpr double kDeeper = 3;  // than at small angles
  for (double& one : volts) one = usual_V + kDeeper * (one - usual_V);
  for (std::size_t u = 0; u < campaign.units.size(); ++u) {
    const CampaignUnit& unit = campaign.units[u];
    double held_deg = 0;
    for (std::size_t row = campaign.first_row[u]; row < campaign.first_row[u + 1]; ++row) {
      const double angle_deg = campaign.cmd_deg[kTheta][row];
      const bool moved =
          row == campaign.first_row[u] || angle_deg != campaign.cmd_deg[kTheta][row - 1];
      if (moved) {
        const double rotor = std::remainder(angle_deg * unit.gear[kTheta], 360) * kDegree;
        const double step_deg = angle_deg - campaign.from_deg[kTheta][row];
        held_deg = turned({.rotor = rotor,
                           .direction = step_deg < 0 ? -1.0 : 1.0,
                           .drive = drive[row],
                           .supply = volts[row] / usual_V,
                           .unit = unit.id}) /
                   kDegree / unit.gear[kTheta];
      }
      off_deg[row] = held_deg;
    }
  }
  TurnTheta([&](std::size_t row) { return off_deg[row]; }, &campaign);
  return campaign;
}

void ExpectNamed(const char* cause, const Turned& turned, std::uint64_t seed) {
  SCOPED_TRACE(testing::Message() << cause << ", seed " << seed);
  const Diagnosis diagnosis = Verdicts(RotorsTurned(turned, seed));
  ASSERT_EQ(diagnosis.causes.size(), 1u) << Reported(diagnosis);
  EXPECT_EQ(diagnosis.causes[0].candidates.size(), 1u) << Reported(diagnosis);
  EXPECT_EQ(diagnosis.causes[0].cause, cause);
  EXPECT_TRUE(diagnosis.unknown.empty()) << Reported(diagnosis);
  EXPECT_TRUE(diagnosis.causes[0].all_units);
}

// At the rotor's rest the field balances the detent, and no such balance lies between there and the
// field.
TEST(Rotor, ADetentHoldsItWhereTheFieldDoes) {
  for (const double harmonic : {1.0, 2.0, 4.0, 6.0})
    for (const double detent : {0.05, 0.3, 0.6})
      for (double wave_deg = -175; wave_deg < 180; wave_deg += 10) {
        const double lag = -kDegree * DetentError(harmonic, wave_deg, detent);
        const auto pull = [&](double at) {
          return std::sin(at) - detent * std::sin(wave_deg * kDegree - harmonic * at);
        };
        EXPECT_NEAR(pull(lag), 0, 1e-6) << harmonic << ' ' << detent << ' ' << wave_deg;
        for (const double share : {0.1, 0.5, 0.9})
          EXPECT_LT(pull(share * lag) * lag, 0) << harmonic << ' ' << detent << ' ' << wave_deg;
      }
}

TEST(Rotor, ADetentThatBendsTheRippleIsCogging) {
  for (const double detent : {0.3, 0.5})
    ExpectNamed("cogging", std::bind_front(DetentLag, detent, 2.0), 3);
}

ModelTerm OfEachUnit(const Template& form, std::size_t units) {
  ModelTerm term{.form = form, .sharing = Sharing::kUnit};
  term.group_of_unit.resize(units);
  std::iota(term.group_of_unit.begin(), term.group_of_unit.end(), 0u);
  term.amplitude.assign(form.columns * units, 0), term.sigma = term.amplitude;
  return term;
}

struct Settled {
  std::string_view cause;  // of the first term
  std::size_t terms = 0;
  std::vector<std::string> rivals;
};

// Settles a model that has phase_imbalance bent by order 2, and a rest of order 4. `noise_share`:
// the noise of the fit, as a share of the true one. `also`: a second effect of the library.
Settled Settle(const Turned& turned, double noise_share, const Effect* also = nullptr) {
  const Campaign campaign = RotorsTurned(turned, 3);
  const CampaignFacts facts = MakeFacts(campaign);
  Fit fit = StaticFit(facts);
  Templates library = ListTemplates(*FindEffect("phase_imbalance"), facts);
  const auto of = [&](std::size_t columns) {
    return *std::ranges::find_if(library, [&](const Template& one) {
      return one.axis == EffectAxis::kTheta && one.shape == 2 && one.columns == columns;
    });
  };
  fit.model.terms = {OfEachUnit(of(6), campaign.units.size())};
  Template left = of(6);
  left.shape = 4;
  fit.model.terms.push_back(OfEachUnit(left, campaign.units.size()));
  if (also != nullptr)
    for (Template& form : ListTemplates(*also, facts)) library.push_back(std::move(form));
  StepFit(&fit);
  SettleFit(&fit, 3);
  fit.noise.place_um *= noise_share;
  for (const std::size_t axis : {kTheta, kPhi})
    fit.noise.angle_deg[axis] *= noise_share, fit.noise.rest_deg[axis] *= noise_share;
  Selection selection;
  selection.accepted.resize(2);
  SettleRotors(library, {}, {}, &fit, &selection);
  Settled settled{.cause = fit.model.terms[0].form.effect->cause, .terms = fit.model.terms.size()};
  EXPECT_EQ(settled.terms, selection.accepted.size());
  for (const Rival& rival : selection.accepted[0].rivals) settled.rivals.emplace_back(rival.cause);
  return settled;
}

TEST(Rotor, WhatIsFarFromEitherWaveIsNeithers) {
  const Turned turned = std::bind_front(DetentLag, 0.5, 2.0);
  EXPECT_EQ(Settle(turned, 1).cause, "cogging");
  EXPECT_EQ(Settle(turned, 0.3).cause, "phase_imbalance");
}

// The exchanged term is alone, and has the rivals that the data do not separate from it.
TEST(Rotor, AnExchangedNameHasRivalsOfItsOwn) {
  Effect twin = *FindEffect("cogging");
  twin.cause = "cogging_again";
  const Settled settled = Settle(std::bind_front(DetentLag, 0.5, 2.0), 1, &twin);
  EXPECT_EQ(settled.terms, 1u);
  EXPECT_EQ(settled.rivals, std::vector<std::string>{"cogging_again"});
}

TEST(Rotor, AFieldThatTurnsInAnEllipseIsPhaseImbalance) {
  for (const double unequal : {0.2, 0.5, 0.7})
    ExpectNamed("phase_imbalance", std::bind_front(EllipseTurn, unequal), 3);
}

TEST(Rotor, ALoadedRotorOfASinkingSupplyIsSupplyDrift) {
  for (const double load : {0.7, 0.9})
    ExpectNamed("supply_drift", std::bind_front(SinkingLag, load), 3);
}

}  // namespace
}  // namespace focalfleet::sim
