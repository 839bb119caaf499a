// Identification of a simulated plate with one trouble at a time, and with all at once. Troubles
// are planted in the truth, and the judge knows whose light is in which spot.
#include "fleet/camera/identify.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/fleet/camera/identify_fixture.h"
#include "tests/support/camera_field.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

using test::CameraField;
using test::FieldTroubles;
using test::Judgement;
using test::kNoTroubles;
using Complex = std::complex<double>;
using Identify = test::IdentifyTest;

TEST_F(Identify, AHealthyFleetIsMeasuredWithinItsErrors) {
  field_.Move(kNoTroubles);
  const Identification seen = See();
  const Judgement judged = test::Judge(field_, image_, seen);
  EXPECT_GE(Count(seen, MeasurementStatus::kMeasured), 216u);
  EXPECT_EQ(judged.wrong + judged.wrong_story, 0u);
  EXPECT_LT(std::sqrt(judged.squared_mm2 / judged.placed / 2), 0.006);
  EXPECT_EQ(seen.fiducials_used, 24u);
  EXPECT_NEAR(seen.scale_change, 0, 2e-3);
  EXPECT_TRUE(seen.unexplained.empty());
}

TEST_F(Identify, TheOrderOfTheSpotsDoesNotMatter) {
  field_.Move({});
  const Identification seen = See();
  std::reverse(exposure_.spots.begin(), exposure_.spots.end());
  const auto again = Ask(field_.Expectations());
  ASSERT_TRUE(again);
  for (std::size_t i = 0; i < seen.units.size(); ++i) {
    EXPECT_EQ(again->units[i].status, seen.units[i].status) << i;
    if (seen.units[i].spot == kNoSpot) continue;
    EXPECT_EQ(again->units[i].spot, exposure_.spots.size() - 1 - seen.units[i].spot);
    EXPECT_NEAR(again->units[i].at_fp.x_mm, seen.units[i].at_fp.x_mm, 1e-6);
  }
}

TEST_F(Identify, DarkFibresAreMissingAndDustIsNotAssigned) {
  field_.Move(kNoTroubles);
  auto sources = field_.Sources();
  const Complex dust = sources[40].place_mm;
  for (const std::uint32_t dark : {5u, 40u, 200u}) sources[dark].place_mm = {0, 5000};
  sources.push_back({sim::LightKind::kFibre, 9999, {Rim() + 30, 0}, 1});
  Picture(sources);
  const auto seen = Ask(field_.Expectations());
  ASSERT_TRUE(seen);
  for (const std::uint32_t dark : {5u, 40u, 200u}) {
    EXPECT_EQ(seen->units[dark].status, MeasurementStatus::kMissing);
    EXPECT_EQ(seen->units[dark].spot, kNoSpot);
  }
  ASSERT_EQ(seen->unexplained.size(), 1u);
  EXPECT_GT(std::abs(Complex(seen->spots_fp[seen->unexplained[0]].x_mm,
                             seen->spots_fp[seen->unexplained[0]].y_mm) -
                     dust),
            1);
}

TEST_F(Identify, AUnitThatDidNotMoveIsNamedWithItsAxes) {
  field_.Move(kNoTroubles);
  const std::uint32_t both = FarMover(0);
  const std::uint32_t theta = FarMover(1);
  const std::uint32_t phi = FarMover(2);
  auto& units = field_.units();
  units[both].place_mm = field_.PlaceOf(both, units[both].before);
  units[theta].place_mm =
      field_.PlaceOf(theta, {units[theta].before.theta_deg, units[theta].commanded.phi_deg});
  units[phi].place_mm =
      field_.PlaceOf(phi, {units[phi].commanded.theta_deg, units[phi].before.phi_deg});
  const Identification seen = See();
  const auto stayed = [&](std::uint32_t i) { return seen.units[i].stayed; };
  for (const std::uint32_t i : {both, theta, phi})
    EXPECT_EQ(seen.units[i].status, MeasurementStatus::kDidNotMove) << Name(seen.units[i].status);
  EXPECT_EQ(stayed(both), (std::array<bool, 2>{true, true}));
  EXPECT_EQ(stayed(theta), (std::array<bool, 2>{true, false}));
  EXPECT_EQ(stayed(phi), (std::array<bool, 2>{false, true}));
}

TEST_F(Identify, AStayThatALargeErrorExplainsAsWellIsNotClaimed) {
  field_.Move(kNoTroubles);
  const std::uint32_t i = FarMover(0);
  auto& unit = field_.units()[i];
  unit.commanded.phi_deg = unit.before.phi_deg + (unit.before.phi_deg < 90 ? 3 : -3);
  // The place is near where a stay of phi would have left the fibre, and not far from the end of
  // the move.
  unit.place_mm = field_.PlaceOf(i, {unit.commanded.theta_deg - 0.6,
                                     unit.before.phi_deg * 0.9 + unit.commanded.phi_deg * 0.1});
  const Identification seen = See();
  EXPECT_EQ(seen.units[i].status, MeasurementStatus::kMeasured) << Name(seen.units[i].status);
  EXPECT_FALSE(seen.units[i].motion_is_known);
  ASSERT_NE(seen.units[i].spot, kNoSpot);
  EXPECT_EQ(image_.light[seen.units[i].spot], std::vector<std::uint32_t>{i});
}

TEST_F(Identify, AMoveTooShortToTellIsMeasuredAndSaysSo) {
  field_.Move(kNoTroubles);
  field_.units()[8].commanded = field_.units()[8].before;
  field_.units()[8].commanded.phi_deg += 0.05;
  field_.units()[8].place_mm = field_.PlaceOf(8, field_.units()[8].before);
  const Identification seen = See();
  EXPECT_EQ(seen.units[8].status, MeasurementStatus::kMeasured);
  EXPECT_FALSE(seen.units[8].motion_is_known);
}

TEST_F(Identify, AUnitThatStoppedOnItsWayHasStrayed) {
  field_.Move(kNoTroubles);
  const std::uint32_t i = FarMover(3);
  auto& unit = field_.units()[i];
  unit.place_mm = field_.PlaceOf(i, {unit.before.theta_deg * 0.4 + unit.commanded.theta_deg * 0.6,
                                     unit.before.phi_deg * 0.4 + unit.commanded.phi_deg * 0.6});
  const Identification seen = See();
  EXPECT_EQ(seen.units[i].status, MeasurementStatus::kStrayed);
  ASSERT_NE(seen.units[i].spot, kNoSpot);
  EXPECT_EQ(image_.light[seen.units[i].spot], std::vector<std::uint32_t>{i});
  EXPECT_FALSE(IsCertain(seen.units[i].status));
}

TEST_F(Identify, TwoThatStrayedIntoACommonAreaAreAmbiguous) {
  field_.Move(kNoTroubles);
  const Layout& layout = field_.layout();
  const std::uint32_t a = 0;
  const std::uint32_t b = layout.neighbours({a})[0].value;
  const Complex pa(layout.unit({a}).base_fp.x_mm, layout.unit({a}).base_fp.y_mm);
  const Complex pb(layout.unit({b}).base_fp.x_mm, layout.unit({b}).base_fp.y_mm);
  const Complex across = (pb - pa) / std::abs(pb - pa);
  // The place is in both patrol areas, off the line between the bases.
  field_.units()[a].place_mm = (pa + pb) / 2.0 + across * Complex(1.5, 3);
  field_.units()[b].place_mm = (pa + pb) / 2.0 + across * Complex(-1.5, -3);
  const Identification seen = See();
  for (const std::uint32_t i : {a, b}) {
    EXPECT_EQ(seen.units[i].status, MeasurementStatus::kAmbiguous) << Name(seen.units[i].status);
    EXPECT_EQ(seen.units[i].spot, kNoSpot);
  }
  EXPECT_EQ(seen.units[a].other.value, b);
}

TEST_F(Identify, APairThatExchangedItsCommandsIsNamed) {
  for (int k = 0; k < 20; ++k) {
    FieldTroubles troubles = kNoTroubles;
    troubles.swaps = 6;
    field_.Move(troubles);
    const Identification seen = See();
    const Judgement result = test::Judge(field_, image_, seen);
    EXPECT_EQ(result.pairs, 6u);
    EXPECT_EQ(result.pairs_unseen, 0u);
    EXPECT_GE(result.pairs_found + result.pairs_alike + result.pairs_flagged, 6u);
    EXPECT_EQ(result.wrong + result.wrong_story, 0u);
  }
}

TEST_F(Identify, ThreeThatExchangedInARingAreNamed) {
  field_.Move(kNoTroubles);
  const std::uint32_t ring[] = {FarMover(0), FarMover(4), FarMover(9)};
  for (int k = 0; k < 3; ++k)
    field_.units()[ring[k]].place_mm =
        field_.PlaceOf(ring[k], field_.units()[ring[(k + 1) % 3]].commanded);
  const Identification seen = See();
  for (int k = 0; k < 3; ++k) {
    EXPECT_EQ(seen.units[ring[k]].status, MeasurementStatus::kSwapped)
        << Name(seen.units[ring[k]].status);
    EXPECT_EQ(seen.units[ring[k]].other.value, ring[(k + 1) % 3]);
  }
}

TEST_F(Identify, HalfAnExchangeIsASuspicion) {
  field_.Move(kNoTroubles);
  const std::uint32_t a = FarMover(0);
  const std::uint32_t b = FarMover(4);
  auto sources = field_.Sources();
  sources[a].place_mm = field_.PlaceOf(a, field_.units()[b].commanded);
  sources[b].place_mm = {0, 5000};
  Picture(sources);
  const auto seen = Ask(field_.Expectations());
  ASSERT_TRUE(seen);
  EXPECT_EQ(seen->units[a].status, MeasurementStatus::kSwapSuspected)
      << Name(seen->units[a].status);
  EXPECT_EQ(seen->units[a].other.value, b);
  EXPECT_EQ(seen->units[b].status, MeasurementStatus::kMissing);
}

TEST_F(Identify, ExchangedUnitsOfEqualCommandsCannotBeSeen) {
  field_.Move(kNoTroubles);
  auto& units = field_.units();
  units[10].commanded = units[90].commanded;
  units[10].place_mm = field_.PlaceOf(10, units[90].commanded);
  const Identification seen = See();
  EXPECT_EQ(seen.units[10].status, MeasurementStatus::kMeasured);
  EXPECT_EQ(seen.units[90].status, MeasurementStatus::kMeasured);
}

TEST_F(Identify, TwoFibresInOneSpotAreBlended) {
  field_.Move(kNoTroubles);
  const std::uint32_t a = 0;
  const std::uint32_t b = field_.layout().neighbours({a})[0].value;
  const PointFp pa = field_.layout().unit({a}).base_fp;
  const PointFp pb = field_.layout().unit({b}).base_fp;
  const PointFp middle{(pa.x_mm + pb.x_mm) / 2, (pa.y_mm + pb.y_mm) / 2};
  auto& units = field_.units();
  for (const std::uint32_t i : {a, b}) {
    const auto angles =
        AnglesFor(field_.layout().unit({i}), {middle.x_mm + (i == a ? 0.04 : -0.04), middle.y_mm});
    ASSERT_FALSE(angles.empty());
    units[i].commanded = angles.front();
    units[i].place_mm = field_.PlaceOf(i, angles.front());
  }
  const Identification seen = See();
  for (const std::uint32_t i : {a, b})
    EXPECT_TRUE(seen.units[i].status == MeasurementStatus::kBlended ||
                seen.units[i].status == MeasurementStatus::kAmbiguous)
        << Name(seen.units[i].status);
}

TEST_F(Identify, ASpotOfDoubleLightIsBlended) {
  field_.Move(kNoTroubles);
  auto sources = field_.Sources();
  sources.push_back({sim::LightKind::kFibre, 9999, sources[60].place_mm + Complex(0.1, 0), 1});
  Picture(sources);
  const auto seen = Ask(field_.Expectations());
  ASSERT_TRUE(seen);
  EXPECT_EQ(seen->units[60].status, MeasurementStatus::kBlended) << Name(seen->units[60].status);
  EXPECT_GT(seen->units[60].covariance.xx, 0.05 * 0.05);
}

TEST_F(Identify, ASpotOutOfReachIsSaid) {
  field_.Move(kNoTroubles);
  // The outermost unit, so that no other reaches there.
  const std::uint32_t i = 216;
  const Complex base(field_.layout().unit({i}).base_fp.x_mm,
                     field_.layout().unit({i}).base_fp.y_mm);
  field_.units()[i].place_mm = base + base / std::abs(base) * 17.1;
  const Identification seen = See();
  EXPECT_EQ(seen.units[i].status, MeasurementStatus::kOutsidePatrol) << Name(seen.units[i].status);
}

TEST_F(Identify, EverythingAtOnceIsNeverWrongUnseen) {
  const std::uint64_t seed = test::TestSeed(1);
  FOCALFLEET_TRACE_SEED(seed);
  traits_.missing_share = 0.01;
  traits_.extra_share = 0.005;
  for (const bool collision_free : {true, false}) {
    for (int k = 0; k < 25; ++k) {
      field_.Move({.swaps = 2, .collision_free = collision_free});
      const Identification seen = See();
      const Judgement judged = test::Judge(field_, image_, seen);
      EXPECT_EQ(judged.wrong, 0u);
      EXPECT_EQ(judged.pairs_unseen, 0u);
      EXPECT_LE(judged.lost, 6u);
    }
  }
}

// ---- the camera

TEST_F(Identify, MissingFalseAndExtraFiducialsAreBorne) {
  field_.Move(kNoTroubles);
  auto sources = field_.Sources();
  for (std::size_t k = 0; k < 5; ++k) sources[217 + k].place_mm = {0, 5000};
  sources[217 + 9].place_mm += Complex(0.4, 0);
  Picture(sources);
  const auto seen = Ask(field_.Expectations());
  ASSERT_TRUE(seen) << seen.error().text;
  EXPECT_EQ(seen->fiducials_missing, 5u);
  EXPECT_EQ(seen->fiducials_false, 1u);
  EXPECT_GE(Count(*seen, MeasurementStatus::kMeasured), 215u);
}

TEST_F(Identify, UnitsThatStandStillHelp) {
  field_ = CameraField({.count = 217, .fiducials = 8}, test::TestSeed(1));
  traits_.air = {.sigma_mm = 0.008, .length_mm = 80};
  FieldTroubles troubles = kNoTroubles;
  troubles.disabled_share = 0.4;
  double with2 = 0;
  double without2 = 0;
  for (int k = 0; k < 10; ++k) {
    field_.Move(troubles);
    options_.use_still_units = true;
    const Identification seen = See();
    EXPECT_GT(seen.still_units_used, 50u);
    const Judgement with = test::Judge(field_, image_, seen);
    options_.use_still_units = false;
    const auto alone = Ask(field_.Expectations());
    ASSERT_TRUE(alone);
    const Judgement without = test::Judge(field_, image_, *alone);
    with2 += with.squared_mm2 / with.placed;
    without2 += without.squared_mm2 / without.placed;
  }
  EXPECT_LT(with2, 0.6 * without2);
}

TEST_F(Identify, TurnedAndMirroredPicturesAreRefusedByName) {
  field_.Move({.swaps = 2});
  for (const int degrees : {90, 180, 270}) {
    traits_.optics.rotation_deg = 3 + degrees;
    Picture(field_.Sources());
    const auto result = Ask(field_.Expectations());
    ASSERT_FALSE(result);
    EXPECT_EQ(result.error().reason, RefusalReason::kTurned);
    EXPECT_NE(result.error().text.find(std::to_string(degrees)), std::string::npos)
        << result.error().text;
  }
  traits_.optics.rotation_deg = 3;
  traits_.optics.mirrored = false;
  Picture(field_.Sources());
  EXPECT_EQ(RefusedAs(), "mirrored");
}

TEST_F(Identify, AnotherFieldIsRefused) {
  field_.Move(kNoTroubles);
  Picture(field_.Sources());
  const auto before = exposure_;
  field_.Move(kNoTroubles);
  field_.Move(kNoTroubles);
  exposure_ = before;
  EXPECT_EQ(RefusedAs(), "other_field");
}

// Units that may be anywhere stand in any field.
TEST_F(Identify, AnotherFieldIsRefusedWhereAllUnitsAreLost) {
  field_.Move(kNoTroubles);
  std::vector<UnitExpectation> lost = field_.Expectations();
  for (UnitExpectation& one : lost) one.lost = true, one.before_fp.reset(), one.before.reset();
  Picture(field_.Sources());
  EXPECT_TRUE(Ask(lost)) << "their own field";
  auto sources = field_.Sources();
  for (std::size_t k = 3; k < 217; ++k) sources[k].place_mm += Complex(8, -5);
  Picture(sources);
  EXPECT_STREQ(Ask(lost) ? "" : Name(Ask(lost).error().reason), "other_field");
}

TEST_F(Identify, AnotherPlateIsRefused) {
  CameraField other({.count = 217, .pitch_mm = 24, .fiducials = 24}, 3);
  field_.Move(kNoTroubles);
  Picture(other.Sources());
  EXPECT_EQ(RefusedAs(), "few_fiducials");
}

TEST_F(Identify, ACameraOutOfBoundsIsRefusedByName) {
  field_.Move(kNoTroubles);
  const sim::Optics good = traits_.optics;
  traits_.optics.pixels_per_mm *= 1.004;
  Picture(field_.Sources());
  EXPECT_EQ(RefusedAs(), "scale");
  traits_.optics = good;
  traits_.optics.rotation_deg += 0.4;
  Picture(field_.Sources());
  EXPECT_EQ(RefusedAs(), "rotation");
  traits_.optics = good;
  traits_.optics.centre_px += Complex(45, 0);
  Picture(field_.Sources());
  EXPECT_EQ(RefusedAs(), "shift");
}

TEST_F(Identify, FewFiducialsAndRoughAirAreRefused) {
  field_.Move(kNoTroubles);
  auto sources = field_.Sources();
  for (std::size_t k = 0; k < 13; ++k) sources[217 + k].place_mm = {0, 5000};
  Picture(sources);
  EXPECT_EQ(RefusedAs(), "few_fiducials");
  traits_.air = {.sigma_mm = 0.15, .length_mm = 40};
  Picture(field_.Sources());
  EXPECT_EQ(RefusedAs(), "rough");
}

TEST_F(Identify, FarTooFewOrManySpotsAreRefused) {
  field_.Move(kNoTroubles);
  Picture(field_.Sources());
  exposure_.spots.resize(60);
  EXPECT_EQ(RefusedAs(), "count");
  Picture(field_.Sources());
  const std::vector<Spot> all = exposure_.spots;
  for (Spot spot : all) exposure_.spots.push_back({spot.id, spot.x_px + 3, spot.y_px, 1, 0});
  EXPECT_EQ(RefusedAs(), "count");
}

TEST_F(Identify, AFleetInWhichNoUnitMovedIsNotAnotherField) {
  field_.Move(kNoTroubles);
  for (std::uint32_t i = 0; i < field_.units().size(); ++i)
    field_.units()[i].place_mm = field_.PlaceOf(i, field_.units()[i].before);
  const Identification seen = See();
  EXPECT_GE(Count(seen, MeasurementStatus::kDidNotMove), 205u);
}

TEST_F(Identify, AnyNoiseOfSpotsIsAnAnswerOrARefusal) {
  const std::uint64_t seed = test::TestSeed(21);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  field_.Move({});
  const auto sources = field_.Sources();
  for (int k = 0; k < 40; ++k) {
    Picture(sources);
    const double share = rng.Uniform();
    for (Spot& spot : exposure_.spots)
      if (rng.Uniform() < share) {
        spot.x_px = rng.Uniform(0, traits_.sensor_px.real());
        spot.y_px = rng.Uniform(0, traits_.sensor_px.imag());
      }
    const auto result = Ask(field_.Expectations());
    if (!result) continue;
    std::vector<int> uses(exposure_.spots.size(), 0);
    for (const UnitMeasurement& unit : result->units) {
      if (unit.spot == kNoSpot) continue;
      ASSERT_LT(unit.spot, exposure_.spots.size());
      if (unit.status != MeasurementStatus::kBlended) {
        EXPECT_EQ(++uses[unit.spot], 1);
      }
      EXPECT_TRUE(std::isfinite(unit.at_fp.x_mm) && unit.covariance.xx > 0);
    }
  }
}

}  // namespace
}  // namespace focalfleet
