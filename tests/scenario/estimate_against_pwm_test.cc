// These tests compare the coordinator's estimate of a motor's power with the simulation at PWM
// level: two derivations of one circuit that share no line. They use 200 random operating points.
// Every point that turns must be within 2 % of mean supply power. A point that stalls in one must
// stall in the other. docs/physics.md has the table of these errors.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <vector>

#include "fleet/drive_power.h"
#include "fleet/estimate.h"
#include "protocol/base/rng.h"
#include "sim/drive/start_study.h"
#include "sim/drive/steady.h"
#include "sim/world/axis/field_path.h"
#include "tests/fleet/plan/planning.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

struct Point {
  MotorModel model;
  Feed feed;
  sim::Drive::Setting setting;
  sim::Modulation modulation;
};

Point Draw(Rng* rng) {
  constexpr std::array<std::uint16_t, 4> kCounters = {250, 500, 1000, 2000};
  constexpr std::array<std::uint16_t, 5> kSubdivisions = {6, 12, 24, 48, 96};
  const sim::ParameterSet& set = sim::kParameterSets[rng->Below(sim::kParameterSets.size())];
  Point point;
  point.setting.motor = set.motor;
  point.setting.motor.load_variation = 0;
  point.setting.motor.load_Nm *= rng->Uniform(0.2, 1.2);
  point.setting.bridge = {.v_bus_V = rng->Uniform(1.7, 9.2),
                          .rise_s = rng->Uniform(0, 20e-9),
                          .fall_s = rng->Uniform(0, 20e-9),
                          .dead_time_s = rng->Uniform(0, 100e-9)};
  const std::uint16_t subdivision = kSubdivisions[rng->Below(kSubdivisions.size())];
  const std::uint16_t counter1 = kCounters[rng->Below(kCounters.size())];
  // The duration of a vector at 8 to 120 carriers of 500 counts and 96 vectors.
  const double vector_s =
      std::exp(rng->Uniform(std::log(8.0), std::log(120.0))) * 500 / 144e6 * 96 / subdivision;
  const auto repeat =
      static_cast<std::uint8_t>(std::clamp(std::lround(vector_s * 144e6 / counter1), 1L, 255L));
  const auto mode = static_cast<WaveMode>(rng->Below(3));
  point.modulation = {
      .counter1 = counter1, .repeat = repeat, .subdivision = subdivision, .mode = mode};
  point.feed = {{counter1, repeat, subdivision}, mode, point.setting.bridge.v_bus_V};
  point.model = {.phase_resistance_ohm = set.motor.resistance_ohm,
                 .phase_inductance_H = set.motor.inductance_H,
                 .flux_linkage_Wb = set.motor.flux_linkage_Wb,
                 .load_torque_Nm = point.setting.motor.load_Nm,
                 .viscous_Nms = set.motor.viscous_Nms,
                 .switch_rise_s = point.setting.bridge.rise_s,
                 .switch_fall_s = point.setting.bridge.fall_s,
                 .dead_time_s = point.setting.bridge.dead_time_s};
  return point;
}

TEST(EstimateAgainstPwm, MeanPowerIsWithinTwoPercentAt200RandomPoints) {
  struct Errors {
    std::vector<double> supply;
    std::vector<double> winding;
    int stalled = 0;
  };
  std::array<Errors, 3> by_mode;
  const std::uint64_t first = test::TestSeed(4000);
  for (std::uint64_t k = 0; k < 200; ++k) {
    FOCALFLEET_TRACE_SEED(first);
    Rng rng = Rng::Stream(first, "operating point", k);
    const Point point = Draw(&rng);
    SCOPED_TRACE(::testing::Message()
                 << "point " << k << ": " << Name(point.feed.mode) << ", " << point.feed.v_bus_V
                 << " V, counter1 " << point.feed.drive.counter1 << ", repeat "
                 << int{point.feed.drive.repeat} << ", subdivision " << point.feed.drive.subdivision
                 << ", load " << point.model.load_torque_Nm << " Nm, flux "
                 << point.model.flux_linkage_Wb << " Wb");
    const MotorPower estimate = SteadyPower(point.model, point.feed);
    const auto state =
        FindSteadyState(point.setting, point.modulation, point.setting.motor.load_Nm);
    Errors& errors = by_mode[static_cast<std::size_t>(point.feed.mode)];
    if (!state || estimate.stalled) {
      ++errors.stalled;
      // At the edge of pull-out the smallest difference decides.
      const double share = sim::PullOutTorque(point.setting, point.modulation) /
                           (point.setting.motor.load_Nm +
                            point.setting.motor.viscous_Nms * SpeedRadPerS(point.feed.drive));
      if (state.has_value() == estimate.stalled) {
        EXPECT_NEAR(share, 1, 0.01);
      }
      continue;
    }
    const sim::WaveFigures pwm = MeasureSteadyWave(point.setting, point.modulation, *state);
    errors.supply.push_back(estimate.total_W() / pwm.power.supply_W - 1);
    errors.winding.push_back(estimate.winding_W / pwm.power.copper_W - 1);
    EXPECT_LT(std::abs(errors.supply.back()), 0.02);
  }
  for (std::size_t mode = 0; mode < by_mode.size(); ++mode) {
    Errors& errors = by_mode[mode];
    ASSERT_GT(errors.supply.size(), 30u);
    const auto largest = [](const std::vector<double>& all) {
      double most = 0;
      for (const double error : all) most = std::max(most, std::abs(error));
      return 100 * most;
    };
    double squares = 0;
    for (const double error : errors.supply) squares += error * error;
    std::printf(
        "%-14s %3zu turn, %d stall; supply: rms %.4f %%, largest %.4f %%; winding: largest %.4f "
        "%%\n",
        Name(static_cast<WaveMode>(mode)), errors.supply.size(), errors.stalled,
        100 * std::sqrt(squares / static_cast<double>(errors.supply.size())),
        largest(errors.supply), largest(errors.winding));
  }
}

TEST(EstimateAgainstPwm, TimeOfAMoveIsExactToACarrierPeriod) {
  const std::uint64_t first = test::TestSeed(4100);
  for (std::uint64_t k = 0; k < 200; ++k) {
    FOCALFLEET_TRACE_SEED(first);
    Rng rng = Rng::Stream(first, "move", k);
    const Point point = Draw(&rng);
    const auto vectors = static_cast<std::int32_t>(1 + rng.Below(40));
    const std::int32_t signed_vectors = rng.Below(2) == 0 ? vectors : -vectors;
    sim::Drive drive(point.setting);
    drive.Place(0, 0);
    RunVectors(&drive, point.modulation, VectorTable(point.modulation), 0, signed_vectors);
    const SegmentTime time =
        TimeOf({.start_ticks = 0, .delta = signed_vectors, .repeat = point.feed.drive.repeat},
               point.feed.drive);
    EXPECT_LT(std::abs(time.t1_s - time.t0_s - drive.t_s()), 0.5 * point.modulation.carrier_s());
  }
}

// Plans have segments that wait, that follow one another and that are slower than tuned. The unit's
// timing is the simulation's field path.
TEST(EstimateAgainstPwm, MakespanOfAPlanIsThatOfTheUnitsFields) {
  for (std::uint64_t k = 0; k < 5; ++k) {
    const std::uint64_t seed = test::TestSeed(4200 + k);
    FOCALFLEET_TRACE_SEED(seed);
    test::PlanningFleet fleet = test::HexFleet(127);
    test::DrawStartAndTargets(&fleet, seed);
    const auto plan = MakePlan(fleet.request(), {});
    ASSERT_TRUE(plan) << plan.error().text;
    double makespan_s = 0;
    std::size_t segments = 0;
    for (const UnitPlan& move : plan->moves)
      for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
        const AxisDrive& drive = fleet.drives[move.unit.value].axis[axis];
        const double carrier_s = drive.counter1 / kTimerHz;
        const auto path = move.path[axis].segments();
        const sim::FieldPath field(
            {.from = move.from[axis], .begin = {0}, .clock = {1.0}, .counter1 = drive.counter1},
            path);
        for (std::size_t n = 0; n < path.size(); ++n, ++segments) {
          const SegmentTime time = TimeOf(path[n], drive);
          EXPECT_NEAR(time.t0_s, field.pieces()[n].begin_ns * 1e-9, carrier_s);
          EXPECT_NEAR(time.t1_s, field.pieces()[n].end_ns() * 1e-9, carrier_s);
        }
        makespan_s = std::max(makespan_s, static_cast<double>(field.end().ns) * 1e-9);
      }
    EXPECT_GT(segments, 2 * plan->moves.size()) << "no segment follows another";
    const PlanEstimate estimate = Estimate(*plan, fleet.layout, fleet.drives, MotorModel{});
    EXPECT_NEAR(estimate.makespan_s, makespan_s, 500 / kTimerHz);
  }
}

}  // namespace
}  // namespace focalfleet
