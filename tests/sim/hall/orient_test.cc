// Orientation from voltages: exact where the model is, as good as noise allows where it is not, and
// with all branches reported. The plant is the independent one.
#include "sim/hall/orient.h"

#include <gtest/gtest.h>

#include "sim/hall/closed_form.h"
#include "sim/hall/field_fit.h"
#include "tests/sim/hall/planted_rig.h"
#include "tests/support/seed.h"

namespace focalfleet::sim {
namespace {

std::shared_ptr<const FieldModel> Surface() {
  return MakeField(SurfaceParameters{.amplitude_T = 0.08});
}
HallRig Rig() {
  HallRig rig;
  rig.electronics.clips = false;
  return rig;
}

HallReading ReadingAt(const OrientationSolver& solver, const Orientation& orientation) {
  HallReading reading;
  std::vector<double> b_T(8);
  solver.Predict(orientation, b_T);
  for (std::size_t k = 0; k < 8; ++k) reading.b_T[k] = b_T[k];
  reading.used = 0xff;
  return reading;
}

Orientation Drawn(Rng* rng, double tilt_deg) {
  const double tilt_rad = tilt_deg * kRadPerDeg;
  return {rng->Uniform(-tilt_rad, tilt_rad), rng->Uniform(-tilt_rad, tilt_rad),
          rng->Uniform(-45, 45) * kRadPerDeg};
}

double Worst_deg(const Orientation& a, const Orientation& b) {
  return std::max({std::abs(a.alpha_rad - b.alpha_rad), std::abs(a.beta_rad - b.beta_rad),
                   std::abs(std::remainder(a.gamma_rad - b.gamma_rad, 90 * kRadPerDeg))}) /
         kRadPerDeg;
}

TEST(Orient, RotationIsTheProductOfThreeMatrices) {
  Rng rng(1);
  for (int k = 0; k < 100; ++k) {
    const Orientation o{rng.Uniform(-3, 3), rng.Uniform(-3, 3), rng.Uniform(-3, 3)};
    const Vector3 p = Unit({rng.Normal(), rng.Normal(), rng.Normal()});
    const auto expected = test::BackTurned(
        test::RotationMatrix(o.alpha_rad, o.beta_rad, o.gamma_rad), {p.x, p.y, p.z});
    const Turned turned = Rotation(o).ToRotorWithSlopes(p);
    EXPECT_NEAR(turned.local.x, expected[0], 1e-14);
    EXPECT_NEAR(turned.local.y, expected[1], 1e-14);
    EXPECT_NEAR(turned.local.z, expected[2], 1e-14);
    constexpr double kStep = 1e-6;
    const auto slope = [&](double a, double b, double c) {
      const Orientation up{o.alpha_rad + a, o.beta_rad + b, o.gamma_rad + c};
      return (1 / kStep) * (Rotation(up).ToRotor(p) - turned.local);
    };
    EXPECT_LT(Length(slope(kStep, 0, 0) - turned.by_alpha), 1e-5);
    EXPECT_LT(Length(slope(0, kStep, 0) - turned.by_beta), 1e-5);
    EXPECT_LT(Length(slope(0, 0, kStep) - turned.by_gamma), 1e-5);
  }
}

TEST(Orient, InvertsItsOwnVoltagesToABillionthOfADegree) {
  const std::uint64_t seed = test::TestSeed(11);
  FOCALFLEET_TRACE_SEED(seed);
  const test::DipoleRotor rotor(test::PlantedOneShell(), 4);
  FieldMap map;
  for (int theta = 0; theta <= 180; theta += 6)
    for (int phi = 0; phi < 360; phi += 6) {
      const Vector3 u = DirectionAt(theta * kRadPerDeg, phi * kRadPerDeg);
      map.push_back({theta * kRadPerDeg, phi * kRadPerDeg,
                     test::OfRotor(rotor)({59 * u.x, 59 * u.y, 59 * u.z}, {u.x, u.y, u.z})});
    }
  const auto fit = FitField(map, FieldKind::kSpherical);
  ASSERT_TRUE(fit);
  for (const auto& field :
       {Surface(), std::shared_ptr<const FieldModel>(MakeField(fit->parameters)),
        std::shared_ptr<const FieldModel>(MakeField(HarmonicParameters{.amplitude_T = 0.08}))}) {
    const OrientationSolver solver(Rig(), field);
    Rng rng(seed);
    for (int k = 0; k < 100; ++k) {
      const Orientation truth = Drawn(&rng, 12);
      const auto fits = solver.Solve(ReadingAt(solver, truth));
      ASSERT_FALSE(fits.empty()) << field->kind();
      EXPECT_LT(Worst_deg(fits.front().orientation, truth), 1e-9) << field->kind() << k;
    }
  }
}

TEST(Orient, ALastStepLeavesLessThanAnyNoise) {
  const OrientationSolver solver(Rig(), Surface()),
      quick(Rig(), Surface(), {.last_step_rad = 1e-3});
  Rng rng(3);
  for (int k = 0; k < 200; ++k) {
    const Orientation truth = Drawn(&rng, 12);
    HallReading reading = ReadingAt(solver, truth);
    for (std::size_t s = 0; s < 8; ++s) reading.b_T[s] += 5e-4 * rng.Normal();
    const Orientation start{truth.alpha_rad + 0.01, truth.beta_rad - 0.01, truth.gamma_rad + 0.01};
    const OrientationFit full = solver.Refine(reading, start), early = quick.Refine(reading, start);
    EXPECT_TRUE(early.converged);
    EXPECT_LE(early.steps, full.steps);
    EXPECT_LT(Worst_deg(early.orientation, full.orientation), 0.02) << "a tenth of the noise's";
  }
}

TEST(Orient, ReachesTheCramerRaoBound) {
  const std::uint64_t seed = test::TestSeed(13);
  FOCALFLEET_TRACE_SEED(seed);
  constexpr double kNoise_T = 5e-4;
  const OrientationSolver solver(Rig(), Surface());
  Rng rng(seed);
  for (const Orientation truth : {Orientation{0.05, -0.1, 0.1}, Orientation{-0.15, 0.12, -0.3}}) {
    // The bound comes from differences of the plant's own prediction, not from the solver's slopes.
    std::array<std::array<double, 3>, 8> slope{};
    constexpr double kStep = 1e-5;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      std::vector<double> up(8), down(8);
      const auto moved = [&](double by) {
        Orientation o = truth;
        (axis == 0 ? o.alpha_rad : axis == 1 ? o.beta_rad : o.gamma_rad) += by;
        return o;
      };
      solver.Predict(moved(kStep), up);
      solver.Predict(moved(-kStep), down);
      for (std::size_t s = 0; s < 8; ++s) slope[s][axis] = (up[s] - down[s]) / (2 * kStep);
    }
    double f[3][3] = {};
    for (const auto& row : slope)
      for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t j = 0; j < 3; ++j) f[i][j] += row[i] * row[j] / (kNoise_T * kNoise_T);
    const double det = f[0][0] * (f[1][1] * f[2][2] - f[1][2] * f[2][1]) -
                       f[0][1] * (f[1][0] * f[2][2] - f[1][2] * f[2][0]) +
                       f[0][2] * (f[1][0] * f[2][1] - f[1][1] * f[2][0]);
    const double bound[] = {(f[1][1] * f[2][2] - f[1][2] * f[2][1]) / det,
                            (f[0][0] * f[2][2] - f[0][2] * f[2][0]) / det,
                            (f[0][0] * f[1][1] - f[0][1] * f[1][0]) / det};
    const HallReading clean = ReadingAt(solver, truth);
    double squares[3] = {}, said[3] = {};
    constexpr int kTrials = 4000;
    for (int k = 0; k < kTrials; ++k) {
      HallReading reading = clean;
      for (std::size_t s = 0; s < 8; ++s) reading.b_T[s] += kNoise_T * rng.Normal();
      const OrientationFit fit = solver.Refine(reading, truth);
      ASSERT_TRUE(fit.converged);
      const double miss[] = {fit.orientation.alpha_rad - truth.alpha_rad,
                             fit.orientation.beta_rad - truth.beta_rad,
                             fit.orientation.gamma_rad - truth.gamma_rad};
      for (std::size_t i = 0; i < 3; ++i) {
        squares[i] += miss[i] * miss[i] / kTrials;
        said[i] += fit.unit_covariance[i][i] * kNoise_T * kNoise_T / kTrials;
      }
    }
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_NEAR(squares[i] / bound[i], 1, 0.1) << "angle " << i;
      EXPECT_NEAR(said[i] / bound[i], 1, 0.05) << "angle " << i;
    }
  }
}

TEST(Orient, OnMagnetsOursErrsLessThanATwentiethOfADegree) {
  const std::uint64_t seed = test::TestSeed(17);
  FOCALFLEET_TRACE_SEED(seed);
  const test::DipoleRotor rotor(test::PlantedTwoShells(), 6);
  const auto law = test::OfRotor(rotor);
  FieldMap map;
  for (int theta = 0; theta <= 180; theta += 5)
    for (int phi = 0; phi < 360; phi += 5) {
      const Vector3 u = DirectionAt(theta * kRadPerDeg, phi * kRadPerDeg);
      map.push_back({theta * kRadPerDeg, phi * kRadPerDeg,
                     law({59 * u.x, 59 * u.y, 59 * u.z}, {u.x, u.y, u.z})});
    }
  test::CampaignPlan plan{.rows = 60, .noise_T = 0, .seed = seed};
  const auto campaign = test::MakeCampaign(plan, law, law, {});
  double worst_deg[3] = {};
  for (const FieldKind kind : kFieldKinds) {
    const auto fit = FitField(map, kind);
    ASSERT_TRUE(fit);
    const OrientationSolver solver(Rig(), MakeField(fit->parameters));
    for (const auto& pose : campaign.poses) {
      const Orientation truth{pose.alpha_deg * kRadPerDeg, pose.beta_deg * kRadPerDeg,
                              pose.gamma_deg * kRadPerDeg};
      const HallReading reading = ReadingOf(solver.rig(), pose.volts);
      // The harmonic model has wrong branches that fit better; the test refines its own from the
      // truth.
      OrientationFit found = solver.Refine(reading, truth);
      if (kind == FieldKind::kSpherical) found = solver.Solve(reading).front();
      auto& worst = worst_deg[static_cast<std::size_t>(kind)];
      worst = std::max(worst, Worst_deg(found.orientation, truth));
    }
  }
  RecordProperty("harmonic_deg", std::to_string(worst_deg[0]));
  RecordProperty("surface_deg", std::to_string(worst_deg[1]));
  RecordProperty("spherical_deg", std::to_string(worst_deg[2]));
  EXPECT_GT(worst_deg[0], 3);
  EXPECT_GT(worst_deg[0], worst_deg[1]);
  EXPECT_LT(worst_deg[2], 0.05);
}

TEST(Orient, LostSignsLeaveTwoOrientations) {
  const OrientationSolver solver(Rig(), Surface(), {.magnitudes = true});
  const Orientation truth{0.05, -0.08, 0.1};
  const auto fits = solver.Solve(ReadingAt(solver, truth));
  int exact = 0;
  bool half_turn = false;
  for (const OrientationFit& fit : fits) {
    if (fit.squares_T2 > 1e-14) continue;
    ++exact;
    half_turn = half_turn || std::abs(std::abs(fit.orientation.gamma_rad - truth.gamma_rad) -
                                      45 * kRadPerDeg) < 1e-6;
  }
  EXPECT_GE(exact, 2);
  EXPECT_TRUE(half_turn);
}

TEST(Orient, FindsAnyTiltOfItsRange) {
  const OrientationSolver solver(Rig(), Surface());
  Rng rng(5);
  for (int k = 0; k < 60; ++k) {
    const Orientation truth = Drawn(&rng, 25);
    const auto fits = solver.Solve(ReadingAt(solver, truth));
    ASSERT_FALSE(fits.empty());
    EXPECT_LT(Worst_deg(fits.front().orientation, truth), 1e-6);
  }
}

TEST(ClosedForm, IsExactWhereItsModelIs) {
  const double widths_deg[] = {21, 24};
  for (const double width_deg : widths_deg) {
    const auto law = test::OfSurface(0.08, width_deg);
    for (const double tilt_deg : {-12.0, -3.0, 7.0}) {
      for (const bool alpha : {true, false}) {
        std::vector<double> b_T;
        const auto turn = test::RotationMatrix(alpha ? tilt_deg * kRadPerDeg : 0,
                                               alpha ? 0 : tilt_deg * kRadPerDeg, 0);
        for (const auto& sensor : test::PlantedSensors()) {
          const auto local = test::BackTurned(turn, sensor);
          b_T.push_back(law({59 * local[0], 59 * local[1], 59 * local[2]}, local));
        }
        const auto any = OrientBySurfaceOfAnyWidth(b_T, {});
        const auto known = OrientBySurface(b_T, {}, width_deg * kRadPerDeg);
        ASSERT_TRUE(any && known);
        EXPECT_NEAR((alpha ? any->alpha_rad : any->beta_rad) / kRadPerDeg, tilt_deg, 1e-9);
        EXPECT_NEAR((alpha ? known->alpha_rad : known->beta_rad) / kRadPerDeg, tilt_deg, 1e-9);
      }
    }
  }
  const OrientationSolver solver(Rig(), MakeField(HarmonicParameters{.amplitude_T = 0.05}));
  std::vector<double> b_T(8);
  solver.Predict({0.15, 0, 0}, b_T);
  EXPECT_NEAR(OrientByHarmonic(b_T, {})->alpha_rad, 0.15, 1e-9);
  solver.Predict({0, -0.1, 0}, b_T);
  EXPECT_NEAR(OrientByHarmonic(b_T, {})->beta_rad, -0.1, 1e-9);
  solver.Predict({0, 0, 0.3}, b_T);
  EXPECT_NEAR(OrientByHarmonic(b_T, {})->gamma_rad, 0.3, 1e-9);
  b_T[4] = -b_T[5];
  EXPECT_FALSE(OrientByHarmonic(b_T, {})) << "no logarithm of a negative ratio";
}

}  // namespace
}  // namespace focalfleet::sim
