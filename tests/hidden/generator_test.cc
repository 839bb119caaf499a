// Tests of the generator's physics and its keys. No effect gives no change. A planted effect is as
// visible, and as like its rivals, as its key says.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/hidden/generator/curves.h"
#include "tests/hidden/generator/planted.h"
#include "tests/support/seed.h"

namespace focalfleet::hidden {
namespace {

using focalfleet::test::TestSeed;

Campaign SmallCampaign(const std::string& design, std::size_t units, std::size_t moves,
                       std::uint64_t seed) {
  DesignOptions options;
  options.design = design;
  options.units = units;
  options.moves = moves;
  return MakeCampaign(options, seed);
}

NoiseModel NoiseOf(const Campaign& campaign) {
  return {std::vector<double>(campaign.unit_count(), 2.0), {0.02, 0.03}};
}

std::vector<char> AllSeen(const Campaign& campaign) {
  return std::vector<char>(campaign.rows.size(), 1);
}

Effect OfAll(const char* cause, const Campaign& campaign, std::size_t axis, double size) {
  Effect effect;
  effect.kind = FindKind(cause);
  effect.axis = axis;
  effect.size = size;
  effect.weight.assign(campaign.unit_count(), 1);
  effect.phase_rad.assign(campaign.unit_count(), 0);
  return effect;
}

TEST(HiddenPlant, WithoutEffectsIsTheSharedKinematics) {
  const Campaign campaign = SmallCampaign("diagnostic", 9, 60, TestSeed(1));
  const Scene scene = MakeScene(campaign);
  const auto places = RunPlant(scene, Believed(campaign), {}, AllUnits(campaign));
  for (std::size_t u = 0; u < 9; ++u)
    for (std::size_t m = 0; m < 60; ++m) {
      const Geometry& g = campaign.units[u].believed;
      const ByAxis& q = campaign.At(m, u).cmd_deg;
      const double first = (q[0] + g.zero_deg[0]) * kPi / 180;
      const double second = first + (q[1] + g.zero_deg[1]) * kPi / 180;
      const double x =
          g.base_mm.real() + g.arm_mm[0] * std::cos(first) + g.arm_mm[1] * std::cos(second);
      const double y =
          g.base_mm.imag() + g.arm_mm[0] * std::sin(first) + g.arm_mm[1] * std::sin(second);
      ASSERT_NEAR(places[u][m].real(), x, 1e-12);
      ASSERT_NEAR(places[u][m].imag(), y, 1e-12);
    }
}

class HiddenPhysics : public testing::TestWithParam<Physics> {};

TEST_P(HiddenPhysics, EveryEffectVanishesWithItsSize) {
  const Campaign campaign = SmallCampaign("diagnostic", 10, 90, TestSeed(2));
  const Scene scene = MakeScene(campaign, GetParam());
  Rng rng(TestSeed(2));
  for (const EffectKind& kind : Catalogue()) {
    if (kind.cause == "identity_swap") continue;  // all or nothing: it has no size
    Effect effect = DrawEffect(kind, campaign, &rng);
    effect.read_through = 23e-6;
    effect.owner = kind.owners.back();
    effect.weight.assign(campaign.unit_count(), 1);
    const auto largest = [&](double size) {
      effect.size = size;
      double most = 0;
      for (const auto& unit : Contribution(scene, Believed(campaign), effect))
        for (const Place& um : unit) most = std::max(most, std::abs(um));
      return most;
    };
    EXPECT_EQ(largest(0), 0) << kind.cause;
    if (kind.is_event && kind.stage == Stage::kTravel) continue;  // happens, or does not
    const double full = largest(1);
    EXPECT_GT(full, 0.01) << kind.cause;
    // A tenth of a step of the command has no effect, and play takes over within a move.
    if (kind.cause == "command_quantisation") continue;
    EXPECT_LT(largest(1e-3), 0.05 * full) << kind.cause;
  }
}

INSTANTIATE_TEST_SUITE_P(Each, HiddenPhysics,
                         testing::Values(Physics::kMechanisms, Physics::kCurves));

// Cosine of two contributions, as vectors over all rows.
double Likeness(const std::vector<std::vector<Place>>& a,
                const std::vector<std::vector<Place>>& b) {
  double product = 0, of_a = 0, of_b = 0;
  for (std::size_t u = 0; u < a.size(); ++u)
    for (std::size_t m = 0; m < a[u].size(); ++m) {
      product += (std::conj(a[u][m]) * b[u][m]).real();
      of_a += std::norm(a[u][m]), of_b += std::norm(b[u][m]);
    }
  return product / std::sqrt(of_a * of_b);
}

// A curve is the same cause by another law: its signature is like that of the mechanism, and is not
// the same. Where a cause has a free phase, both quadratures of the curve count.
TEST(HiddenPlant, ACurveIsLikeTheMechanismAndIsNotTheSame) {
  const Campaign campaign = SmallCampaign("diagnostic", 10, 120, TestSeed(6));
  std::size_t compared = 0;
  for (const EffectKind& kind : Catalogue()) {
    // Rounding and cutting make errors of other commands, and an arm that breaks loose at another
    // load does so in other moves.
    if (CurveOf(kind.cause) == nullptr || kind.is_event || kind.cause == "command_quantisation" ||
        kind.cause == "stiction")
      continue;
    Effect effect = OfAll(std::string(kind.cause).c_str(), campaign, kTheta, 0.3);
    effect.shape = {0.55, 0.3, 0.5, 0.5};
    effect.owner = kind.owners.back();
    const Truth truth = Believed(campaign);
    const auto mechanism = Contribution(MakeScene(campaign), truth, effect);
    const Scene by_curves = MakeScene(campaign, Physics::kCurves);
    double alike = Likeness(mechanism, Contribution(by_curves, truth, effect));
    if (kind.phases == 2) {
      effect.phase_rad.assign(campaign.unit_count(), kPi / 2);
      alike = std::hypot(alike, Likeness(mechanism, Contribution(by_curves, truth, effect)));
    }
    EXPECT_GT(alike, 0.5) << kind.cause;
    if (kind.phases == 1) {
      EXPECT_LT(alike, 0.99999) << kind.cause;
    }
    ++compared;
  }
  EXPECT_GE(compared, 24u);
}

// Play by Prandtl's rule: the arm stays within the gap, follows a flank, and crosses the gap when
// the motor turns back.
TEST(HiddenPlant, BacklashIsAPlayOperator) {
  const Campaign campaign = SmallCampaign("diagnostic", 4, 120, TestSeed(3));
  const Scene scene = MakeScene(campaign);
  Effect effect = OfAll("backlash", campaign, kPhi, 1);
  const double gap_deg = effect.kind->typical;
  const auto um = Contribution(scene, Believed(campaign), effect);
  std::size_t engaged = 0;
  for (std::size_t u = 0; u < 4; ++u)
    for (std::size_t m = 0; m < campaign.move_count(); ++m) {
      const Row& row = campaign.At(m, u);
      const double arc_um = campaign.units[u].believed.arm_mm[kPhi] * kDegree * 1000;
      const double off_deg = std::abs(um[u][m]) / arc_um;
      ASSERT_LE(off_deg, gap_deg / 2 * 1.001);
      if (std::abs(row.cmd_deg[kPhi] - row.from_deg[kPhi]) <= gap_deg) continue;
      ASSERT_NEAR(off_deg, gap_deg / 2, 1e-3 * gap_deg);
      // Behind the motor: a positive move leaves the arm at a smaller angle.
      const Place forward = StaticColumns(campaign, u)[5][m];
      const double along = (std::conj(forward) * um[u][m]).real();
      ASSERT_EQ(along<0, row.cmd_deg[kPhi]> row.from_deg[kPhi]);
      ++engaged;
    }
  EXPECT_GT(engaged, 100u);
}

TEST(HiddenPlant, SlipsComeInWholeRevolutionsOfTheMotor) {
  const Campaign campaign = SmallCampaign("diagnostic", 12, 120, TestSeed(4));
  const Scene scene = MakeScene(campaign);
  Effect effect = OfAll("step_loss", campaign, kTheta, 10);
  effect.seed = 7;
  std::size_t slipped = 0;
  const auto um = Contribution(scene, Believed(campaign), effect);
  const Truth believed = Believed(campaign);
  const auto without = RunPlant(scene, believed, {}, AllUnits(campaign));
  for (std::size_t u = 0; u < um.size(); ++u)
    for (std::size_t m = 0; m < um[u].size(); ++m) {
      const Place base = campaign.units[u].believed.base_mm;
      const Place before = without[u][m] - base;
      if (std::abs(before) < 1) continue;
      const double turned = std::arg((before + um[u][m] / 1000.0) / before) / kDegree / 360 *
                            campaign.units[u].gear[0];
      ASSERT_NEAR(turned, std::round(turned), 1e-6);
      slipped += std::abs(turned) > 0.5 ? 1u : 0u;
    }
  EXPECT_GT(slipped, 0u);
}

// Lambda by the textbook: a dense covariance, its Cholesky factor, and normal equations for the
// static geometry; no filter, no Gram-Schmidt.
double DenseLambda(const Campaign& campaign, const NoiseModel& noise, std::size_t unit,
                   const std::vector<Place>& um) {
  const std::size_t moves = campaign.move_count();
  const std::size_t n = 2 * moves;
  const auto statics = StaticColumns(campaign, unit);
  std::vector<std::vector<double>> c(n, std::vector<double>(n, 0));
  for (std::size_t a = 0; a < kAxes; ++a) {
    std::vector<std::size_t> episode(moves);
    std::size_t e = 0;
    for (std::size_t m = 0; m < moves; ++m) {
      const Row& row = campaign.At(m, unit);
      if (row.Moved(a) || row.rehomed) ++e;
      episode[m] = e;
    }
    const double variance = noise.actuation_deg[a] * noise.actuation_deg[a];
    const auto arc = [&](std::size_t i) {
      const Place per_deg = 1000.0 * statics[4 + a][i / 2];
      return i % 2 == 0 ? per_deg.real() : per_deg.imag();
    };
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t j = 0; j < n; ++j)
        if (episode[i / 2] == episode[j / 2]) c[i][j] += variance * arc(i) * arc(j);
  }
  for (std::size_t i = 0; i < n; ++i) c[i][i] += noise.centroid_um[unit] * noise.centroid_um[unit];
  for (std::size_t i = 0; i < n; ++i)  // Cholesky, in place
    for (std::size_t j = 0; j <= i; ++j) {
      double sum = c[i][j];
      for (std::size_t k = 0; k < j; ++k) sum -= c[i][k] * c[j][k];
      c[i][j] = i == j ? std::sqrt(sum) : sum / c[j][j];
    }
  const auto whiten = [&](const std::vector<Place>& v) {
    std::vector<double> y(n);
    for (std::size_t i = 0; i < n; ++i) {
      double sum = i % 2 == 0 ? v[i / 2].real() : v[i / 2].imag();
      for (std::size_t k = 0; k < i; ++k) sum -= c[i][k] * y[k];
      y[i] = sum / c[i][i];
    }
    return y;
  };
  // The chi-square of the effect as data, before and after the best static geometry.
  std::vector<std::vector<double>> a(6, std::vector<double>(7, 0));
  const auto y = whiten(um);
  std::vector<std::vector<double>> s;
  for (const auto& column : statics) s.push_back(whiten(column));
  for (std::size_t i = 0; i < 6; ++i) {
    for (std::size_t j = 0; j < 6; ++j) a[i][j] = Dot(s[i], s[j]);
    a[i][6] = Dot(s[i], y);
  }
  std::vector<double> right(6);
  for (std::size_t i = 0; i < 6; ++i) right[i] = a[i][6];
  for (std::size_t k = 0; k < 6; ++k)
    for (std::size_t i = 0; i < 6; ++i) {
      if (i == k) continue;
      const double f = a[i][k] / a[k][k];
      for (std::size_t j = k; j < 7; ++j) a[i][j] -= f * a[k][j];
    }
  double explained = 0;
  for (std::size_t i = 0; i < 6; ++i) explained += a[i][6] / a[i][i] * right[i];
  return Dot(y, y) - explained;
}

TEST(HiddenEvidence, LambdaIsWhatALeastSquaresFitFinds) {
  const Campaign campaign = SmallCampaign("diagnostic", 6, 63, TestSeed(5));
  const Scene scene = MakeScene(campaign);
  const NoiseModel noise = NoiseOf(campaign);
  for (const char* cause :
       {"backlash", "gear_scale", "eccentricity", "relaxation", "gravity_sag"}) {
    const auto um = Contribution(scene, Believed(campaign), OfAll(cause, campaign, kPhi, 2));
    const Visibility seen = Assess(scene, noise, AllSeen(campaign), um);
    double dense = 0;
    for (std::size_t u = 0; u < 6; ++u) dense += DenseLambda(campaign, noise, u, um[u]);
    EXPECT_GT(dense, 1) << cause;
    EXPECT_NEAR(seen.lambda / dense, 1, 1e-5) << cause;
  }
}

TEST(HiddenEvidence, WhatTheStaticGeometryDoesIsWorthNothing) {
  const Campaign campaign = SmallCampaign("survey", 3, 50, TestSeed(6));
  const auto seen = AllSeen(campaign);
  const UnitSpace space(campaign, NoiseOf(campaign), 1, {seen.data(), campaign.move_count()});
  for (const auto& column : StaticColumns(campaign, 1)) {
    const Column whole = space.Whiten(column);
    const Column left = space.Project(column);
    EXPECT_LT(Dot(left, left), 1e-12 * Dot(whole, whole));
  }
}

TEST(HiddenEvidence, AnEffectIsMadeAsVisibleAsItIsWanted) {
  const Campaign campaign = SmallCampaign("diagnostic", 16, 150, TestSeed(7));
  const Scene scene = MakeScene(campaign);
  const NoiseModel noise = NoiseOf(campaign);
  const auto seen = AllSeen(campaign);
  Rng rng(TestSeed(7));
  for (const EffectKind& kind : Catalogue()) {
    if (kind.is_event) continue;
    Effect effect = DrawEffect(kind, campaign, &rng);
    effect.read_through = 23e-6;
    Tune(scene, Believed(campaign), noise, seen, 300, &effect);
    const double lambda =
        Assess(scene, noise, seen, Contribution(scene, Believed(campaign), effect)).lambda;
    const bool at_the_end = std::abs(effect.size) >= 0.999 * kind.size_max;
    // Not every size exists: steps of a command's last bit are round numbers, and arms break loose
    // at the rungs of a ladder.
    const bool jumps = kind.cause == "command_quantisation" || kind.cause == "stiction";
    const double tolerance = jumps ? 0.7 : 0.1;
    if (at_the_end) {
      EXPECT_LT(lambda, 310) << kind.cause;
    } else {
      EXPECT_NEAR(lambda / 300, 1, tolerance) << kind.cause;
    }
    // With 16 units the effect of the voltage alone on the load angle is small.
    const double visible = kind.cause == "supply_drift" ? 2 : 10;
    EXPECT_GT(lambda, visible) << kind.cause << ": hardly visible even at its largest";
  }
}

// Lag and backlash are the same with one speed, one voltage and long moves; a drive that varies
// separates them.
TEST(HiddenRivals, EquivalenceDependsOnWhatTheMovesExcite) {
  const auto cosine = [](const std::string& design) {
    const Campaign campaign = SmallCampaign(design, 8, 120, TestSeed(8));
    const Scene scene = MakeScene(campaign);
    Effect effect = OfAll("load_angle_lag", campaign, kTheta, 1);
    effect.owner = Owner::kPlate;
    for (const Rival& rival : FindRivals(scene, NoiseOf(campaign), AllSeen(campaign), effect))
      if (rival.cause == "backlash") return rival.cosine;
    return 0.0;
  };
  EXPECT_GT(cosine("survey"), 0.995);
  EXPECT_LT(cosine("diagnostic"), 0.99);
}

// A detent of order one bends the rotor's angle just as an offset of one phase does, at any size. A
// detent of order two falls with the drive, and the ellipse of unequal gains does not.
TEST(HiddenRivals, ADetentOfOrderOneIsAnOffset) {
  const auto cosine = [](double order, double size) {
    const Campaign campaign = SmallCampaign("diagnostic", 8, 120, TestSeed(8));
    const Scene scene = MakeScene(campaign);
    Effect effect = OfAll("cogging", campaign, kTheta, size);
    effect.owner = Owner::kUnit;
    effect.shape[0] = order;
    for (std::size_t u = 0; u < effect.phase_rad.size(); ++u)
      effect.phase_rad[u] = 0.7 * static_cast<double>(u);
    for (const Rival& rival : FindRivals(scene, NoiseOf(campaign), AllSeen(campaign), effect))
      if (rival.cause == "phase_imbalance") return rival.cosine;
    return 0.0;
  };
  constexpr double kOne = 0.1, kTwo = 0.4;
  for (const double size : {0.5, 3.0}) {
    EXPECT_GT(cosine(kOne, size), 0.995) << size;
    EXPECT_LT(cosine(kTwo, size), 0.99) << size;
  }
}

}  // namespace
}  // namespace focalfleet::hidden
