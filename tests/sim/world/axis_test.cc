#include "sim/world/axis/axis.h"

#include <gtest/gtest.h>

#include <cmath>

#include "protocol/base/rng.h"
#include "sim/drive/start_study.h"
#include "sim/drive/steady.h"
#include "sim/world/axis/motor.h"
#include "tests/sim/drive/bench_motor.h"
#include "tests/support/seed.h"

namespace focalfleet::sim {
namespace {

using test::BenchMotor;

constexpr double kTurnElectricalDeg = 360;

// Without dead time the closed forms of paper 1's motor hold.
constexpr Bridge kIdeal1V8{.rise_s = 0, .fall_s = 0, .dead_time_s = 0};

TEST(Motor, LagsFifteenDegreesAtRestAndTwentyThreeAtTheTunedSpeed) {
  const Motor motor({.bridge = kIdeal1V8}, {});
  // sin(lag) = 4.07 uNm * 14.85 ohm / (1.5 * 0.15 mWb * 1.8 V / sqrt 3); counts round the voltage.
  EXPECT_NEAR(std::sin(motor.StaticLagTurns(1) * 2 * M_PI),
              4.07e-6 * 14.85 / (1.5 * 0.15e-3 * 1.8 / std::sqrt(3)), 1e-3);
  const double tuned = 144e6 / (108.0 * 500 * 96);
  EXPECT_NEAR(motor.RunningLagTurns(tuned, 1) * kTurnElectricalDeg, 23.2, 0.1);
  EXPECT_GT(motor.RunningLagTurns(tuned, 1.2), motor.RunningLagTurns(tuned, 0.8));
  EXPECT_EQ(motor.RunningLagTurns(1000, 1), 0.25);
  EXPECT_GT(Motor({}, {}).StaticLagTurns(1), motor.StaticLagTurns(1)) << "dead time takes voltage";
}

// The critical n of this motor by bus voltage comes from an independent integration of the averaged
// equation.
TEST(Motor, ComesUpExactlyFromItsCriticalSpeed) {
  struct Row {
    double v_bus_V;
    int critical_n;
  };
  for (const Row& row : {Row{1.7, 39}, Row{1.8, 37}, Row{2, 34}, Row{2.5, 28}, Row{3, 24},
                         Row{4, 20}, Row{5, 17}, Row{7, 14}, Row{9.2, 12}}) {
    SCOPED_TRACE(row.v_bus_V);
    Bridge bridge = kIdeal1V8;
    bridge.v_bus_V = row.v_bus_V;
    const Motor motor({.bridge = bridge}, {});
    const auto speed = [](int n) { return 144e6 / (n * 500.0 * 96); };
    EXPECT_TRUE(motor.Follows(speed(row.critical_n)));
    EXPECT_FALSE(motor.Follows(speed(row.critical_n - 1)));
  }
}

TEST(Motor, IsWithinADegreeOfPwmLevelAndStartsWhatItStarts) {
  double worst_deg = 0;
  for (std::uint64_t k = 0; k < 10; ++k) {
    const std::uint64_t seed = ::focalfleet::test::TestSeed(500 + k);
    FOCALFLEET_TRACE_SEED(seed);
    Rng rng(seed);
    const Drive::Setting setting{
        kParameterSets[rng.Below(5)].motor, {}, {.v_bus_V = rng.Uniform(1.7, 9.2)}};
    Modulation modulation{.subdivision = 24 << rng.Below(3),
                          .mode = static_cast<WaveMode>(rng.Below(3))};
    const Motor motor(setting, modulation);
    const double critical =
        1 / (motor.pull_in_turns_per_s() * modulation.subdivision * modulation.carrier_s());
    modulation.repeat = static_cast<int>(critical * rng.Uniform(1.1, 3)) + 1;
    const auto state = FindSteadyState(setting, modulation, setting.motor.load_Nm);
    ASSERT_TRUE(state);
    const double lag_deg = motor.RunningLagTurns(modulation.field_Hz(), 1) * kTurnElectricalDeg;
    // The PWM level lags the middle of the vector that is shown; the field here is at a vector's
    // begin.
    worst_deg = std::max(worst_deg, std::abs(lag_deg - state->lag_rad * 180 / M_PI));
    EXPECT_NEAR(lag_deg, state->lag_rad * 180 / M_PI, 1.0);

    modulation.repeat = static_cast<int>(std::ceil(critical)) + 1;
    EXPECT_TRUE(motor.Follows(modulation.field_Hz()));
    EXPECT_TRUE(StartsAtWorstLoad(setting, modulation, {}, DriveLevel::kPwm));
    modulation.repeat = static_cast<int>(std::ceil(critical)) - 2;
    EXPECT_FALSE(motor.Follows(modulation.field_Hz()));
    EXPECT_FALSE(StartsAtWorstLoad(setting, modulation, {}, DriveLevel::kPwm));
  }
  RecordProperty("largest_lag_error_deg", std::to_string(worst_deg));
}

TEST(FieldPath, ShowsEachVectorForItsTime) {
  const Segment segments[] = {{10, 3, 108}, {10, -2, 37}, {100, 5, 1}};
  const FieldPath path({100, {1000}, {1.0}, 500}, segments);
  const auto at = [&](double us) { return path.Applied({1000 + std::llround(us * 1000)}); };
  EXPECT_EQ(at(-1), 100);
  EXPECT_EQ(at(999.9), 100);
  EXPECT_EQ(at(1000), 101);
  EXPECT_EQ(at(1374.9), 101);
  EXPECT_EQ(at(1375), 102);
  EXPECT_EQ(at(1750), 103);
  EXPECT_EQ(at(2124.9), 103);
  EXPECT_EQ(at(2125), 102);  // the second segment waited for the first
  EXPECT_EQ(at(2125 + 37 * 500 / 144.0 + 0.1), 101);
  EXPECT_EQ(at(9999), 101);
  EXPECT_EQ(at(20'000), 106);
  EXPECT_EQ(path.to(), 106);
  EXPECT_NEAR(static_cast<double>(path.end().ns - 1000), 10e6 + 5 * 500 / 0.144, 1);
}

AxisTraits OnTheBench(AxisTraits traits) {
  if (traits.gear == 1) traits.gear = 100;
  return traits;
}

class AxisRig {
 public:
  explicit AxisRig(AxisTraits traits, std::int32_t position = 0)
      : axis_(OnTheBench(traits), &BenchMotor(), AxisModel::Start{position, 96, 100}),
        at_(position) {
    axis_.Energise({position, 96});
  }
  void Move(std::int32_t vectors, std::uint8_t repeat = 108) {
    const Segment segment{0, vectors, repeat};
    const FieldPath path({at_, now_, {1.0}, 500}, {&segment, 1});
    axis_.Run(path);
    now_ = path.end();
    axis_.Halt(now_);
    at_ += vectors;
  }
  [[nodiscard]] double Deg() const { return axis_.AngleDeg(now_); }
  [[nodiscard]] double FieldDeg() const { return at_ * 0.0375; }  // 360 / (96 * 100)
  AxisModel& axis() { return axis_; }
  HostInstant now_{0};

 private:
  AxisModel axis_;
  std::int32_t at_;
};

TEST(Axis, RestsBehindTheFieldInTheDirectionOfItsLastMotion) {
  AxisRig rig({});
  EXPECT_EQ(rig.Deg(), 0);
  rig.Move(5000);
  const double up = rig.FieldDeg() - rig.Deg();
  EXPECT_GT(up, 12.0 / 100 * 0.9);  // 15 electrical degrees, the load varies by a fifth
  EXPECT_LT(up, 18.0 / 100 * 1.1);
  rig.Move(-2000);
  const double down = rig.FieldDeg() - rig.Deg();
  EXPECT_LT(down, -0.12 * 0.9);
  EXPECT_GT(down, -0.18 * 1.1);
  // A step smaller than the friction band does not turn the rotor.
  const double before = rig.Deg();
  rig.Move(2);
  EXPECT_EQ(rig.Deg(), before);
}

TEST(Axis, RunsFartherBehindThanItRests) {
  AxisRig rig({});
  const Segment segment{0, 9600, 108};
  const FieldPath path({0, {0}, {1.0}, 500}, {&segment, 1});
  rig.axis().Run(path);
  double last = -1;
  for (std::int64_t ms = 0; ms < 3600; ms += 7) {
    const HostInstant at{ms * 1'000'000};
    const double deg = rig.axis().AngleDeg(at);
    EXPECT_GE(deg, last) << "turned back";
    last = deg;
    if (ms < 100) continue;
    const double behind = static_cast<double>(ms) * 1e6 / 375e3 * 0.0375 - deg;
    EXPECT_NEAR(behind * 100, 23.2, 4) << "electrical degrees";
  }
}

TEST(Axis, DoesNotDependOnHowOftenItIsLookedAt) {
  AxisTraits traits;
  traits.backlash_deg = 1.5;
  traits.periodic_deg = 0.1;
  AxisRig seen(traits);
  AxisRig unseen(traits);
  for (const std::int32_t way : {3000, -70, 900, -4000, 12}) {
    seen.Move(way);
    unseen.Move(way);
    (void)seen.Deg();
    (void)seen.axis().Memory(seen.now_);
  }
  EXPECT_EQ(seen.Deg(), unseen.Deg());
  EXPECT_EQ(seen.axis().Memory(seen.now_), unseen.axis().Memory(unseen.now_));
}

TEST(Axis, TooFastAFieldLeavesTheRotorWhereItStood) {
  AxisRig rig({});
  rig.Move(3000, 30);
  EXPECT_NEAR(rig.Deg(), 0, 1.8);  // at most half an electrical turn, to agree with the field again
  rig.Move(3000, 40);
  EXPECT_GT(rig.Deg(), 100);
}

TEST(Axis, BacklashIsLostWhenTheDirectionTurns) {
  AxisTraits traits;
  traits.backlash_deg = 1.5;
  AxisRig rig(traits);
  rig.Move(4000);
  const double up = rig.Deg();
  rig.Move(-4000);
  AxisRig clean({});
  clean.Move(4000);
  const double clean_up = clean.Deg();
  clean.Move(-4000);
  // The load, and with it the lag, differs a little between the places of the two.
  EXPECT_NEAR((up - rig.Deg()) - (clean_up - clean.Deg()), -1.5, 0.01);
}

TEST(Axis, TheStopHoldsTheShaftAndTheFieldSlipsWholeTurns) {
  AxisTraits traits;
  traits.stop_high_deg = 36 + 0.9;  // ten electrical turns and a quarter
  for (const std::int32_t beyond : {0, 20, 96, 500, 9600}) {
    AxisRig rig(traits);
    rig.Move(960 + beyond);
    EXPECT_LE(rig.Deg(), 36.9 + 1e-9);
    const double off_turns = (rig.FieldDeg() - rig.Deg()) / 3.6;
    if (beyond % 96 == 0) {
      EXPECT_NEAR(off_turns - std::round(off_turns), 15.0 / 360, 4.0 / 360);
      EXPECT_NEAR(rig.Deg(), 36, 0.2);
    }
    rig.Move(-480);
    EXPECT_LT(rig.Deg(), 36.9 - 480 * 0.0375 + 2);
  }
}

TEST(Axis, PowerOnAlignsWithTheNearestTurnOfTheStoredVector) {
  // FLASH says 0 while the rotor stands elsewhere. The rotor ends whole turns off, after less than
  // half a turn of motion.
  for (std::int32_t stands = -300; stands <= 300; stands += 7) {
    AxisRig rig({}, stands);
    const double before = rig.Deg();
    rig.axis().Release({0});
    rig.axis().Energise({0, 96});
    const double turns = rig.Deg() / 3.6;
    EXPECT_NEAR(turns, std::round(turns), 18.0 / 360 * 1.1) << stands;
    EXPECT_LE(std::abs(rig.Deg() - before), 1.8 + 1e-9) << stands;
  }
}

TEST(Axis, SlippingAndDeadAxesArriveShort) {
  AxisTraits slipping;
  slipping.grip = 0.5;
  AxisRig half(slipping);
  half.Move(4000);
  EXPECT_NEAR(half.Deg(), 75, 0.2);
  AxisTraits dead;
  dead.grip = 0;
  dead.scatter_deg = 0.1;
  AxisRig none(dead);
  none.Move(4000);
  EXPECT_EQ(none.Deg(), 0);
}

// The spread of the place, and of its change in a move, over `moves` there and back by `way_deg`.
struct Scattered {
  double place_deg = 0;
  double change_deg = 0;
};
Scattered ScatterOver(double way_deg, int moves) {
  AxisTraits traits;
  traits.scatter_deg = 0.1;
  traits.scatter_seed = 5;
  AxisRig rig(traits);
  AxisRig clean({});
  Scattered sums;
  double before = 0;
  for (int i = 0; i < moves; ++i) {
    const auto way = static_cast<std::int32_t>((i % 2 == 0 ? way_deg : -way_deg) / 0.0375);
    rig.Move(way);
    clean.Move(way);
    const double off = rig.Deg() - clean.Deg();
    sums.place_deg += off * off;
    sums.change_deg += (off - before) * (off - before);
    before = off;
  }
  return {std::sqrt(sums.place_deg / moves), std::sqrt(sums.change_deg / moves)};
}

TEST(Axis, ScatterGrowsWithTheWayAndForgetsItselfOverAFullTurn) {
  constexpr int kMoves = 4000;
  const double tolerance = 5 / std::sqrt(2.0 * kMoves);
  for (const double way_deg : {15.0, 60.0, 360.0}) {
    const double kept = std::exp(-way_deg / kScatterTravelDeg);
    const double expected = 0.1 * std::sqrt(2 * (1 - kept));
    EXPECT_NEAR(ScatterOver(way_deg, kMoves).change_deg, expected, tolerance * expected) << way_deg;
  }
  EXPECT_NEAR(ScatterOver(1440, kMoves).place_deg, 0.1, tolerance * 0.1);
}

TEST(Axis, FoundAgainFromMemoryItStandsWhereItStood) {
  AxisTraits traits;
  traits.gear = 100;
  traits.backlash_deg = 1.4;
  AxisRig rig(traits);
  rig.Move(1234);
  const AxisMemory memory = rig.axis().Memory(rig.now_);
  AxisModel found(traits, &BenchMotor(), memory);
  found.Energise({1234, 96});
  EXPECT_EQ(found.AngleDeg({0}), rig.Deg());
  EXPECT_EQ(found.Memory({0}), memory);
}

}  // namespace
}  // namespace focalfleet::sim
