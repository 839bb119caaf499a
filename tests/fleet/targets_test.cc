#include "fleet/targets.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "fleet/hex_layout.h"
#include "fleet/kinematics.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

using ::testing::HasSubstr;

struct Fleet {
  Layout layout;
  std::vector<UnitDrive> drives;
};

Fleet FleetOf(std::vector<Unit> units, std::vector<Obstacle> obstacles = {}) {
  auto layout =
      Layout::Create(std::move(units), {.clearance_mm = 0, .obstacles = std::move(obstacles)});
  EXPECT_TRUE(layout) << layout.error().text;
  std::vector<UnitDrive> drives(layout->size());
  return {std::move(*layout), std::move(drives)};
}

Fleet Hex(std::uint32_t count) { return FleetOf(MakeHexLayout({.count = count})); }

std::string ErrorOf(const Fleet& fleet, std::vector<TargetRow> rows) {
  const auto poses = ResolveTargets({"night.csv", std::move(rows)}, fleet.layout, fleet.drives, {});
  return poses ? "" : poses.error().text;
}

TargetRow Row(std::uint32_t unit, std::variant<PointFp, TargetAngles> place, int line = 2) {
  TargetRow row;
  row.unit = UnitId{unit};
  row.place = place;
  row.line = line;
  return row;
}

// A distance of its own, without shared code: dense samples along both arms.
double SampledDistance(const SegmentFp& s, const SegmentFp& t) {
  constexpr int kSteps = 60;
  const auto along = [](const SegmentFp& g, int k) {
    const double f = static_cast<double>(k) / kSteps;
    return PointFp{g.a.x_mm + f * (g.b.x_mm - g.a.x_mm), g.a.y_mm + f * (g.b.y_mm - g.a.y_mm)};
  };
  double least = 1e9;
  for (int i = 0; i <= kSteps; ++i)
    for (int j = 0; j <= kSteps; ++j) {
      const PointFp p = along(s, i);
      const PointFp q = along(t, j);
      least = std::min(least, std::hypot(p.x_mm - q.x_mm, p.y_mm - q.y_mm));
    }
  return least;
}

void ExpectAllClear(const Fleet& fleet, const std::vector<Pose>& poses) {
  const Layout& layout = fleet.layout;
  std::vector<SegmentFp> arms;
  for (std::uint32_t i = 0; i < layout.size(); ++i) {
    EXPECT_TRUE(InRange(layout.unit({i}), fleet.drives[i], poses[i]));
    arms.push_back(ArmAt(layout.unit({i}), fleet.drives[i], poses[i]));
  }
  for (std::uint32_t i = 0; i < layout.size(); ++i) {
    for (std::uint32_t j = i + 1; j < layout.size(); ++j) {
      const PointFp a = layout.unit({i}).base_fp;
      const PointFp b = layout.unit({j}).base_fp;
      if (std::hypot(a.x_mm - b.x_mm, a.y_mm - b.y_mm) >
          layout.unit({i}).reach_mm() + layout.unit({j}).reach_mm() + 1)
        continue;
      const double needed = layout.unit({i}).arm_half_width_mm +
                            layout.unit({j}).arm_half_width_mm + layout.clearance_mm();
      ASSERT_GT(SampledDistance(arms[i], arms[j]), needed) << "pair " << i << ", " << j;
    }
    for (const Obstacle& o : layout.obstacles())
      ASSERT_GT(SampledDistance(arms[i], {o.centre_fp, o.centre_fp}),
                layout.unit({i}).arm_half_width_mm + o.radius_mm + layout.clearance_mm());
  }
}

TEST(ResolveTargets, APointIsReachedWithinHalfAVector) {
  const Fleet fleet = Hex(7);
  const PointFp point{3.2, -7.7};
  const auto poses = ResolveTargets({"t.csv", {Row(1, point)}}, fleet.layout, fleet.drives, {});
  ASSERT_TRUE(poses) << poses.error().text;
  ASSERT_TRUE((*poses)[0]);
  EXPECT_FALSE((*poses)[1]);
  EXPECT_LT(DistanceMm(FibreAt(fleet.layout.unit({0}), fleet.drives[0], *(*poses)[0]), point),
            1e-3);
}

TEST(ResolveTargets, TakesTheWholeTurnNearestToWhereTheUnitStands) {
  const Fleet fleet = Hex(1);
  const Unit& unit = fleet.layout.unit({0});
  const UnitDrive& drive = fleet.drives[0];
  for (const double stands_deg : {-180.0, 180.0}) {
    const UnitKnowledge now =
        Exactly(Witness::kReported, {NearestVectors(stands_deg, unit.theta(), drive.axis[0]), 0});
    const auto poses = ResolveTargets({"t.csv", {Row(1, TargetAngles{175 + 720, 30})}},
                                      fleet.layout, fleet.drives, std::vector{now});
    ASSERT_TRUE(poses);
    const double theta = AnglesOf(unit, drive, *(*poses)[0]).theta_deg;
    EXPECT_NEAR(theta, stands_deg < 0 ? -185 : 175, 0.003);
  }
}

TEST(ResolveTargets, TakesTheElbowSideNearestToWhereTheUnitStands) {
  auto units = MakeHexLayout({.count = 1});
  units[0].axis[1].min_deg = -180;
  const Fleet fleet = FleetOf(units);
  const Unit& unit = fleet.layout.unit({0});
  const PointFp point = FibreAt(unit, AxisAngles{0, 90});
  for (const double stands_deg : {-80.0, 80.0}) {
    const UnitKnowledge now =
        Exactly(Witness::kMeasured, {NearestVectors(45 - stands_deg / 2, unit.theta(), {}),
                                     NearestVectors(stands_deg, unit.phi(), {})});
    const auto poses =
        ResolveTargets({"t.csv", {Row(1, point)}}, fleet.layout, fleet.drives, std::vector{now});
    ASSERT_TRUE(poses);
    EXPECT_NEAR(AnglesOf(unit, {}, *(*poses)[0]).phi_deg, std::copysign(90, stands_deg), 0.01);
  }
}

TEST(ResolveTargets, TakesTheOtherElbowSideWhereTheNearestTouchesANeighbour) {
  auto units = MakeHexLayout({.count = 2});
  units[0].axis[1].min_deg = -180;
  const Fleet fleet = FleetOf(units);
  const Layout& layout = fleet.layout;
  const Unit& unit = layout.unit({0});
  const double needed = unit.arm_half_width_mm * 2 + layout.clearance_mm();
  Rng rng(11);
  int cases = 0;
  for (int k = 0; k < 20'000 && cases < 20; ++k) {
    const Pose other{static_cast<std::int32_t>(rng.Below(80'000)) - 40'000,
                     static_cast<std::int32_t>(rng.Below(40'000))};
    const SegmentFp other_arm = ArmAt(layout.unit({1}), {}, other);
    const double r = rng.Uniform(5, 16);
    const double direction = rng.Uniform(-3, 3);
    const PointFp point{r * std::cos(direction), r * std::sin(direction)};
    const auto solutions = AnglesFor(unit, point);
    const auto clear = [&](const AxisAngles& s) {
      return SampledDistance(ArmAt(unit, s), other_arm) > needed + 0.05;
    };
    const auto touches = [&](const AxisAngles& s) {
      return DistanceMm(ArmAt(unit, s), other_arm) < needed - 0.05;
    };
    if (solutions.size() != 2 || !touches(solutions[0]) || !clear(solutions[1])) continue;
    ++cases;
    const UnitKnowledge at_the_first =
        Exactly(Witness::kReported, {NearestVectors(solutions[0].theta_deg, unit.theta(), {}),
                                     NearestVectors(solutions[0].phi_deg, unit.phi(), {})});
    const auto poses =
        ResolveTargets({"t.csv", {Row(1, point)}}, layout, fleet.drives,
                       std::vector{at_the_first, Exactly(Witness::kReported, other)});
    ASSERT_TRUE(poses);
    EXPECT_NEAR(AnglesOf(unit, {}, *(*poses)[0]).phi_deg, solutions[1].phi_deg, 0.01);
  }
  EXPECT_EQ(cases, 20);
}

// Places of a drawn configuration, which is clear, on plates where an arm reaches over the
// neighbours' bases and phi goes both ways. Whatever side each place was drawn with, a clear choice
// of sides is found for all together.
TEST(ResolveTargets, FindsSidesForAllWhereThereAreAny) {
  auto units = MakeHexLayout({.count = 200, .pitch_mm = 25, .theta_arm_mm = 8, .phi_arm_mm = 17});
  for (Unit& unit : units) unit.axis[1].min_deg = -180;
  const Fleet fleet = FleetOf(units);
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    FOCALFLEET_TRACE_SEED(seed);
    const auto drawn = DrawConfiguration(fleet.layout, fleet.drives, {}, Rng(seed));
    ASSERT_TRUE(drawn) << drawn.error().text;
    Targets targets{"t.csv", {}};
    for (std::uint32_t i = 0; i < fleet.layout.size(); ++i) {
      const Unit& unit = fleet.layout.unit({i});
      targets.rows.push_back(Row(unit.id.value,
                                 FibreAt(unit, AnglesOf(unit, fleet.drives[i], (*drawn)[i])),
                                 static_cast<int>(i) + 2));
    }
    const auto poses = ResolveTargets(targets, fleet.layout, fleet.drives, {});
    ASSERT_TRUE(poses) << poses.error().text;
    std::vector<Pose> taken;
    for (const std::optional<Pose>& pose : *poses) taken.push_back(*pose);
    ExpectAllClear(fleet, taken);
  }
}

TEST(ResolveTargets, NamesFileLineUnitAndReason) {
  const Fleet fleet = Hex(7);
  EXPECT_EQ(ErrorOf(fleet, {Row(99, PointFp{0, 0}, 5)}),
            "night.csv:5: unit 99: unknown unit, the layout has none such");
  EXPECT_EQ(ErrorOf(fleet, {Row(1, PointFp{0, 1}, 2), Row(1, PointFp{0, 1}, 9)}),
            "night.csv:9: unit 1: named twice, first in line 2");
  EXPECT_EQ(ErrorOf(fleet, {Row(1, PointFp{17.25, 0}, 3)}),
            "night.csv:3: unit 1: x_mm 17.2500, y_mm 0.0000 is 17.2500 mm from its base (out of "
            "patrol, its fibre reaches 0.0000..16.5000 mm)");
  EXPECT_EQ(ErrorOf(fleet, {Row(1, TargetAngles{0, 180.5}, 3)}),
            "night.csv:3: unit 1: phi_deg 180.5000 is out of its range 0.0000..180.0000 deg");
  EXPECT_THAT(ErrorOf(fleet, {Row(1, PointFp{std::nan(""), 0}, 3)}),
              HasSubstr("night.csv:3: unit 1"));
  EXPECT_THAT(ErrorOf(fleet, {Row(1, TargetAngles{0, std::nan("")}, 3)}), HasSubstr("not finite"));
  EXPECT_EQ(ErrorOf(fleet, {Row(1, TargetAngles{1e300, 90}, 3)}),
            "night.csv:3: unit 1: theta_deg 1e+300 is not an angle within 36000");
  EXPECT_THAT(ErrorOf(fleet, {Row(1, TargetAngles{0, -36'001}, 3)}),
              HasSubstr("phi_deg -36001.0000 is not an angle within"));
  EXPECT_EQ(ErrorOf(fleet, {Row(1, TargetAngles{-36'000, 90}, 3)}), "");
  auto units = MakeHexLayout({.count = 1});
  units[0].axis[0].min_deg = -90;
  units[0].axis[0].max_deg = 90;
  const Fleet half = FleetOf(units);
  EXPECT_THAT(
      ErrorOf(half, {Row(1, TargetAngles{120, 10}, 4)}),
      HasSubstr("night.csv:4: unit 1: theta_deg 120.0000, whole turns added, is out of its range"));
  EXPECT_THAT(ErrorOf(half, {Row(1, PointFp{-16, 0}, 4)}),
              HasSubstr("in a direction out of range"));
}

TEST(ResolveTargets, RefusesTwoTargetsThatTouchUnlessOneIsPassedOver) {
  auto units = MakeHexLayout({.count = 2});
  const double toward = std::atan2(units[1].base_fp.y_mm, units[1].base_fp.x_mm) * 57.29578;
  const std::vector<TargetRow> rows = {Row(2, TargetAngles{toward + 180, 0}, 2),
                                       Row(1, TargetAngles{toward, 0}, 3)};
  EXPECT_THAT(ErrorOf(FleetOf(units), rows),
              HasSubstr("night.csv:3: unit 1: its target collides with that of unit 2 in line 2: "
                        "their arms would be 0.0000 mm apart, 4.4032 mm are needed"));
  units[1].enabled = false;
  EXPECT_EQ(ErrorOf(FleetOf(units), rows), "");
}

TEST(ResolveTargets, TellsAllBadRowsAtOnce) {
  const Fleet fleet = Hex(7);
  const Unit& other = fleet.layout.unit({1});
  const double toward = std::atan2(other.base_fp.y_mm, other.base_fp.x_mm) * 57.29578;
  const std::string reported =
      ErrorOf(fleet, {Row(99, PointFp{0, 0}, 2), Row(3, PointFp{300, 0}, 3),
                      Row(2, TargetAngles{toward + 180, 0}, 4), Row(2, PointFp{0, 0}, 5),
                      Row(1, TargetAngles{toward, 0}, 6), Row(4, TargetAngles{0, 270}, 7)});
  EXPECT_THAT(reported,
              ::testing::MatchesRegex(
                  "night.csv:2: unit 99: unknown unit[^\n]*\n"
                  "  night.csv:3: unit 3: x_mm 300.0000[^\n]*out of patrol[^\n]*\n"
                  "  night.csv:5: unit 2: named twice, first in line 4\n"
                  "  night.csv:7: unit 4: phi_deg 270.0000 is out of its range[^\n]*\n"
                  "  night.csv:6: unit 1: its target collides with that of unit 2 in line "
                  "4[^\n]*"));
}

TEST(ResolveTargets, CountsWhatItDoesNotTellByItsReason) {
  const Fleet fleet = Hex(37);
  std::vector<TargetRow> rows;
  for (std::uint32_t unit = 1; unit <= 37; ++unit)
    rows.push_back(Row(unit, PointFp{-999, -999}, static_cast<int>(unit) + 1));
  for (std::uint32_t unit = 101; unit <= 103; ++unit)
    rows.push_back(Row(unit, PointFp{0, 0}, static_cast<int>(unit)));
  EXPECT_THAT(ErrorOf(fleet, rows),
              HasSubstr("\n  and 20 more rows; all 40: out of patrol (37), unknown unit (3)"));
}

TEST(DrawConfiguration, IsClearInRangeAndTheSameForTheSameSeed) {
  const std::uint64_t seed = test::TestSeed(20240611);
  FOCALFLEET_TRACE_SEED(seed);
  const Fleet fleet = Hex(400);
  const auto poses = DrawConfiguration(fleet.layout, fleet.drives, {}, Rng(seed));
  ASSERT_TRUE(poses) << poses.error().text;
  ExpectAllClear(fleet, *poses);
  EXPECT_EQ(*poses, *DrawConfiguration(fleet.layout, fleet.drives, {}, Rng(seed)));
  EXPECT_NE(*poses, *DrawConfiguration(fleet.layout, fleet.drives, {}, Rng(seed + 1)));
}

TEST(DrawConfiguration, FiveThousandUnitsFindTheirPlaces) {
  const std::uint64_t seed = test::TestSeed(20240611);
  FOCALFLEET_TRACE_SEED(seed);
  const Fleet fleet = Hex(5000);
  for (std::uint64_t k = 0; k < 5; ++k)
    EXPECT_TRUE(DrawConfiguration(fleet.layout, fleet.drives, {}, Rng(seed + k)));
}

TEST(DrawConfiguration, CoversThePatrolAreaEvenly) {
  // Units too far apart to touch: the same share of fibres falls within each ring of equal area.
  constexpr int kUnits = 3000;
  constexpr int kRings = 10;
  auto units = MakeHexLayout({.count = kUnits, .pitch_mm = 100, .theta_arm_mm = 8.25});
  for (Unit& unit : units) unit.axis[1].min_deg = -40;  // two elbow sides for the outer part
  const Fleet fleet = FleetOf(units);
  const auto poses = DrawConfiguration(fleet.layout, fleet.drives, {}, Rng(20));
  ASSERT_TRUE(poses);
  std::array<int, kRings> ring{};
  std::array<int, 4> quadrant{};
  for (std::uint32_t i = 0; i < fleet.layout.size(); ++i) {
    const Unit& unit = fleet.layout.unit({i});
    const PointFp fibre = FibreAt(unit, fleet.drives[i], (*poses)[i]);
    const double r = DistanceMm(fibre, unit.base_fp) / 16.5;
    ++ring[std::min<std::size_t>(kRings - 1, static_cast<std::size_t>(r * r * kRings))];
    ++quadrant[(fibre.x_mm > unit.base_fp.x_mm ? 1u : 0u) +
               (fibre.y_mm > unit.base_fp.y_mm ? 2u : 0u)];
  }
  // 5 sigma of a binomial share.
  for (const int n : ring) EXPECT_NEAR(n, kUnits / kRings, 5 * std::sqrt(kUnits * 0.1 * 0.9));
  for (const int n : quadrant) EXPECT_NEAR(n, kUnits / 4, 5 * std::sqrt(kUnits * 0.25 * 0.75));
}

TEST(DrawConfiguration, KeepsStandingUnitsFoldsDisabledOnesAndAvoidsObstacles) {
  auto units = MakeHexLayout({.count = 200});
  for (std::size_t i = 0; i < units.size(); i += 7) units[i].enabled = false;
  std::vector<Obstacle> obstacles;
  for (std::uint32_t k = 0; k < 20; ++k)
    obstacles.push_back(
        {k, {units[k * 9 + 3].base_fp.x_mm + 12.8, units[k * 9 + 3].base_fp.y_mm}, 1.5});
  const Fleet fleet = FleetOf(units, obstacles);
  std::vector<std::optional<Pose>> standing(units.size());
  standing[5] = Pose{1000, 20'000};
  const auto poses = DrawConfiguration(fleet.layout, fleet.drives, standing, Rng(5));
  ASSERT_TRUE(poses) << poses.error().text;
  ExpectAllClear(fleet, *poses);
  EXPECT_EQ((*poses)[5], *standing[5]);
  for (std::uint32_t i = 0; i < units.size(); ++i)
    if (!units[i].enabled) {
      EXPECT_GE(AnglesOf(fleet.layout.unit({i}), fleet.drives[i], (*poses)[i]).phi_deg, 120 - 0.01);
    }
}

TEST(DrawConfiguration, NamesTheUnitWithoutAPlace) {
  const auto units = MakeHexLayout({.count = 1});
  const Fleet fleet = FleetOf(units, {{1, {0, 0}, 30}});
  const auto poses = DrawConfiguration(fleet.layout, fleet.drives, {}, Rng(1));
  ASSERT_FALSE(poses);
  EXPECT_EQ(poses.error().code, ErrorCode::kRefused);
  EXPECT_THAT(poses.error().text, HasSubstr("unit 1 finds no place"));
}

TEST(FoldedConfiguration, FoldsAsFarAsEachUnitGoes) {
  auto units = MakeHexLayout({.count = 61});
  units[3].axis[1].max_deg = 150;
  units[4].axis[1].zero_deg = 20;
  units[5].enabled = false;
  const Fleet fleet = FleetOf(units);
  const auto poses = FoldedConfiguration(fleet.layout, fleet.drives);
  ExpectAllClear(fleet, poses);
  const auto phi = [&](std::uint32_t i) {
    return AnglesOf(fleet.layout.unit({i}), fleet.drives[i], poses[i]).phi_deg;
  };
  EXPECT_NEAR(phi(0), 180, 0.01);
  EXPECT_NEAR(phi(3), 150, 0.01);
  EXPECT_NEAR(phi(4), 160, 0.01);
  EXPECT_GE(phi(5), 120 - 0.01);
  EXPECT_EQ(poses, FoldedConfiguration(fleet.layout, fleet.drives));
}

}  // namespace
}  // namespace focalfleet
