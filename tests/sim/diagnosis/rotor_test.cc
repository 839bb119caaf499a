// Rotors that are turned so far that their ripple is no sine, by physics of this file's own.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "tests/sim/diagnosis/planted_campaign.h"

namespace focalfleet::sim {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

// What turns the rotor away from where its field should hold it, in radians: at a rotor's angle
// and a drive level, for a unit.
using Turned = std::function<double(double rotor, double drive, std::uint32_t unit)>;

double Phase(std::uint32_t unit) { return 2.4 * unit; }

// sin(lag) = torque / drive, where the torque is that of the place to which the lag leads.
double DetentLag(double detent, double order, double rotor, double drive, std::uint32_t unit) {
  double lag = 0;
  for (int i = 0; i < 200; ++i) {
    const double torque = detent * std::sin(order * (rotor + lag) + Phase(unit)) / drive;
    lag = 0.5 * lag + 0.5 * std::asin(std::clamp(-torque, -1.0, 1.0));
  }
  return lag;
}

// Of a field whose phases are unequal: an ellipse.
double EllipseTurn(double unequal, double rotor, double, std::uint32_t unit) {
  const double x = std::cos(rotor) + unequal * std::cos(Phase(unit) - rotor);
  const double y = std::sin(rotor) + unequal * std::sin(Phase(unit) - rotor);
  return std::remainder(std::atan2(y, x) - rotor, 2 * std::numbers::pi);
}

Campaign RotorsTurned(const Turned& turned, std::uint64_t seed) {
  Campaign campaign = Planted({}, {.moves = 120, .seed = seed});
  std::vector<double> off_deg(campaign.rows(), 0);
  const std::vector<double>& drive =
      std::ranges::find(campaign.covariates, "drive_amplitude", &Covariate::name)->values;
  for (std::size_t u = 0; u < campaign.units.size(); ++u) {
    const CampaignUnit& unit = campaign.units[u];
    double held_deg = 0;
    for (std::size_t row = campaign.first_row[u]; row < campaign.first_row[u + 1]; ++row) {
      const double angle_deg = campaign.cmd_deg[kTheta][row];
      const bool moved =
          row == campaign.first_row[u] || angle_deg != campaign.cmd_deg[kTheta][row - 1];
      if (moved) {
        const double rotor = std::remainder(angle_deg * unit.gear[kTheta], 360) * kDegree;
        held_deg = turned(rotor, drive[row], unit.id) / kDegree / unit.gear[kTheta];
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
  ASSERT_EQ(diagnosis.causes.size(), 1u) << Told(diagnosis);
  EXPECT_EQ(diagnosis.causes[0].cause, cause);
  EXPECT_TRUE(diagnosis.unknown.empty()) << Told(diagnosis);
  EXPECT_TRUE(diagnosis.causes[0].all_units);
}

TEST(Rotor, ADetentThatBendsTheRippleIsCogging) {
  for (const double detent : {0.3, 0.5})
    ExpectNamed("cogging", std::bind_front(DetentLag, detent, 2.0), 3);
}

TEST(Rotor, AFieldThatTurnsInAnEllipseIsPhaseImbalance) {
  for (const double unequal : {0.2, 0.5, 0.7})
    ExpectNamed("phase_imbalance", std::bind_front(EllipseTurn, unequal), 3);
}

}  // namespace
}  // namespace focalfleet::sim
