#include "sim/drive/motor/shaft.h"

#include <gtest/gtest.h>

#include <cmath>

namespace focalfleet::sim {
namespace {

constexpr MotorParameters kEven{.viscous_Nms = 2e-8, .load_Nm = 4e-6, .load_variation = 0};

TEST(Shaft, AtRestFrictionHoldsUpToTheLoad) {
  Shaft shaft(kEven, {});
  shaft.Place(1, 0);
  for (int k = 0; k < 100; ++k) shaft.Step(3.99e-6 * 1e-6, 1e-6);
  EXPECT_EQ(shaft.angle_rad(), 1);
  EXPECT_EQ(shaft.load_J(), 0);
  shaft.Step(4.01e-6 * 1e-6, 1e-6);
  EXPECT_GT(shaft.speed_rad_per_s(), 0);
}

TEST(Shaft, SpeedUpFollowsTheExponentialOfDrag) {
  Shaft shaft(kEven, {});
  shaft.Place(0, 0);
  const double torque = 10e-6;
  const double step = 1e-6;
  for (int k = 0; k < 4000; ++k) shaft.Step(torque * step, step);
  const double tau = kEven.inertia_kg_m2 / kEven.viscous_Nms;
  const double end = (torque - kEven.load_Nm) / kEven.viscous_Nms;
  EXPECT_NEAR(shaft.speed_rad_per_s() / (end * (1 - std::exp(-4e-3 / tau))), 1, 1e-8);
}

TEST(Shaft, WorkIsKineticEnergyFrictionAndDrag) {
  Shaft shaft(kEven, {.play_rad = 2});
  shaft.Place(0, 0);
  double work = 0;
  for (int k = 0; k < 20'000; ++k) {
    const double torque = 15e-6 * std::sin(k * 1e-3);
    const double before = shaft.angle_rad();
    shaft.Step(torque * 1e-6, 1e-6);
    work += torque * (shaft.angle_rad() - before);
  }
  EXPECT_GT(shaft.load_J(), 0);
  EXPECT_NEAR((shaft.kinetic_J() + shaft.load_J() + shaft.viscous_J()) / work, 1, 1e-4);
}

TEST(Shaft, PlayFreesTheRotorFromTheLoadUntilItIsTakenUp) {
  const double play = 1.5;
  Shaft shaft(kEven, {.play_rad = play});
  shaft.Place(0, 0);  // in contact forward
  const double output = shaft.output_rad();
  shaft.Step(-1e-6 * 1e-6, 1e-6);  // less than the load, and backwards
  EXPECT_LT(shaft.speed_rad_per_s(), 0);
  while (shaft.angle_rad() > -play + 1e-3) {
    shaft.Step(-1e-6 * 1e-5, 1e-5);
    ASSERT_EQ(shaft.output_rad(), output);
  }
  for (int k = 0; k < 2000; ++k) shaft.Step(-1e-6 * 1e-5, 1e-5);
  EXPECT_EQ(shaft.speed_rad_per_s(), 0) << "the load stops it";
}

TEST(Shaft, LoadVariesOverAnOutputTurn) {
  MotorParameters motor = kEven;
  motor.load_variation = 0.2;
  Shaft shaft(motor, {.ratio = 10, .load_phase_rad = 0});
  shaft.Place(0, 0);
  EXPECT_NEAR(shaft.LoadTorque(), 1.2 * 4e-6, 1e-15);
  shaft.Place(10 * std::numbers::pi, 0);
  EXPECT_NEAR(shaft.LoadTorque(), 0.8 * 4e-6, 1e-15);
}

}  // namespace
}  // namespace focalfleet::sim
