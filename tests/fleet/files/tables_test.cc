#include <gtest/gtest.h>

#include <cmath>

#include "fleet/files/obstacles_file.h"
#include "fleet/files/state_file.h"
#include "fleet/files/targets_file.h"
#include "fleet/hex_layout.h"
#include "fleet/kinematics.h"
#include "protocol/base/rng.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

struct Fleet {
  Layout layout;
  std::vector<UnitDrive> drives;
};

Fleet Hex(std::uint32_t count) {
  auto units = MakeHexLayout({.count = count});
  return {*Layout::Create(units, {}), std::vector<UnitDrive>(count)};
}

// ---- targets.csv

std::string TargetsError(const std::string& text) {
  const auto targets = ReadTargets(text, "night.csv");
  return targets ? "" : targets.error().text;
}

TEST(TargetsFile, ReadsPlacesAnglesAndWhatIsCarriedAlong) {
  const auto targets = ReadTargets(
      "unit_id,x_mm,y_mm,theta_deg,phi_deg,priority,target_id\n"
      "3,1.5,-2,,,7,NGC 224\n# angles\n4,,,10,20,,\n",
      "night.csv");
  ASSERT_TRUE(targets) << targets.error().text;
  ASSERT_EQ(targets->rows.size(), 2u);
  EXPECT_EQ(std::get<PointFp>(targets->rows[0].place).y_mm, -2);
  EXPECT_EQ(targets->rows[0].priority, 7);
  EXPECT_EQ(targets->rows[0].target_id, "NGC 224");
  EXPECT_EQ(std::get<TargetAngles>(targets->rows[1].place).phi_deg, 20);
  EXPECT_EQ(targets->rows[1].line, 4);
  EXPECT_EQ(targets->source, "night.csv");
}

TEST(TargetsFile, KeepsTheNamesOfUnreadColumns) {
  const auto targets =
      ReadTargets("unit_id,x_mm,y_mm,prioritty,target_id\n3,1.5,-2,7,NGC 224\n", "night.csv");
  ASSERT_TRUE(targets) << targets.error().text;
  EXPECT_EQ(targets->ignored_columns, std::vector<std::string>{"prioritty"});
}

TEST(TargetsFile, NamesFileLineAndReason) {
  EXPECT_EQ(TargetsError(""), "night.csv: empty, a header line is expected");
  EXPECT_EQ(TargetsError("unit_id,x_mm,y_mm\n"), "night.csv: a header, but no targets");
  EXPECT_EQ(TargetsError("unit_id,x,y\n1,2,3\n"),
            "night.csv:1: column x_mm, y_mm is missing; there are: unit_id, x, y");
  EXPECT_EQ(TargetsError("unit,x_mm,y_mm\n1,2,3\n"),
            "night.csv:1: column unit_id is missing; there are: unit, x_mm, y_mm");
  EXPECT_EQ(TargetsError("unit_id,theta_deg\n1,2\n"),
            "night.csv:1: column phi_deg is missing; there are: unit_id, theta_deg");
  EXPECT_EQ(TargetsError("unit_id,x_mm,y_mm\n1,2,3\n2,1,1\n1,5,6\n"),
            "night.csv:4: unit 1: named twice, first in line 2");
  EXPECT_EQ(TargetsError("unit_id,x_mm,y_mm\n1,nan,3\n"),
            "night.csv:2: column x_mm: the value is missing (empty or nan)");
  EXPECT_EQ(TargetsError("unit_id,x_mm,y_mm\n1,2,3\n2,4\n"),
            "night.csv:3: 2 cells, but the header has 3 columns: cut short?");
  EXPECT_EQ(TargetsError("unit_id,x_mm,y_mm,theta_deg,phi_deg\n1,2,3,4,5\n"),
            "night.csv:2: column x_mm: a place and angles in one row; give one of them");
  EXPECT_EQ(TargetsError("unit_id,x_mm,y_mm,theta_deg,phi_deg\n1,,,4,\n"),
            "night.csv:2: column phi_deg: the value is missing (empty or nan)");
  EXPECT_EQ(TargetsError("unit_id,x_mm,y_mm\none,2,3\n"),
            "night.csv:2: column unit_id: 'one' is not a number");
}

TEST(TargetsFile, TellsAllBadRows) {
  EXPECT_EQ(TargetsError("unit_id,x_mm,y_mm\n1,nan,3\n2,1,1\n3,x,1\n2,5,6\n"),
            "night.csv:2: column x_mm: the value is missing (empty or nan)\n"
            "  night.csv:4: column x_mm: 'x' is not a number\n"
            "  night.csv:5: unit 2: named twice, first in line 3");
}

TEST(TargetsFile, WhatIsWrittenReadsBackEqual) {
  const auto targets = ReadTargets(
      "unit_id,x_mm,y_mm,theta_deg,phi_deg,priority,target_id\n"
      "3,0.1,-2,,,7,\"a, \"\"b\"\"\"\n4,,,10,0.3,,\n",
      "night.csv");
  ASSERT_TRUE(targets);
  const auto again = ReadTargets(WriteTargets(*targets), "night.csv");
  ASSERT_TRUE(again) << again.error().text;
  ASSERT_EQ(again->rows.size(), 2u);
  EXPECT_EQ(std::get<PointFp>(again->rows[0].place).x_mm, 0.1);
  EXPECT_EQ(again->rows[0].target_id, "a, \"b\"");
  EXPECT_EQ(std::get<TargetAngles>(again->rows[1].place).phi_deg, 0.3);
}

TEST(TargetsFile, DrawnPosesComeBackAsTheSamePoses) {
  const Fleet fleet = Hex(200);
  const auto drawn = DrawConfiguration(fleet.layout, fleet.drives, {}, Rng(8));
  ASSERT_TRUE(drawn);
  std::vector<std::optional<Pose>> poses(drawn->begin(), drawn->end());
  poses[17].reset();
  Targets targets = TargetsOf(fleet.layout, fleet.drives, poses);
  const auto read = ReadTargets(WriteTargets(targets), "night.csv");
  ASSERT_TRUE(read) << read.error().text;
  const auto resolved = ResolveTargets(*read, fleet.layout, fleet.drives, {});
  ASSERT_TRUE(resolved) << resolved.error().text;
  const double turn_vectors = 360 / DegreesPerVector(fleet.layout.unit({0}).theta(), {});
  for (std::size_t i = 0; i < poses.size(); ++i) {
    ASSERT_EQ((*resolved)[i].has_value(), poses[i].has_value());
    if (!poses[i]) continue;
    EXPECT_EQ((*(*resolved)[i])[1], (*poses[i])[1]);
    const double turns = ((*(*resolved)[i])[0] - (*poses[i])[0]) / turn_vectors;
    EXPECT_NEAR(turns, std::round(turns), 1 / turn_vectors) << "theta is a direction";
  }
}

// ---- state.csv

TEST(StateFile, WhatIsWrittenReadsBackEqual) {
  const std::uint64_t seed = test::TestSeed(12);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  const Fleet fleet = Hex(500);
  std::vector<std::optional<Pose>> poses(500);
  for (std::uint32_t i = 0; i < 500; ++i) {
    const VectorRange theta = RangeOf(fleet.layout.unit({i}).theta(), fleet.drives[i].axis[0]);
    const VectorRange phi = RangeOf(fleet.layout.unit({i}).phi(), fleet.drives[i].axis[1]);
    const auto within = [&](const VectorRange& r) {
      return r.low +
             static_cast<std::int32_t>(rng.Below(static_cast<std::uint64_t>(r.high - r.low) + 1));
    };
    if (rng.Below(5) > 0) poses[i] = Pose{within(theta), within(phi)};
  }
  const auto read = ReadState(WriteState(fleet.layout, fleet.drives, poses), "state.csv",
                              fleet.layout, fleet.drives);
  ASSERT_TRUE(read) << read.error().text;
  EXPECT_EQ(*read, poses);
}

TEST(StateFile, NamesFileLineAndReason) {
  const Fleet fleet = Hex(3);
  const auto error_of = [&](const std::string& text) {
    const auto state = ReadState(text, "state.csv", fleet.layout, fleet.drives);
    return state ? "" : state.error().text;
  };
  const std::string head = "unit_id,theta_deg,phi_deg\n";
  EXPECT_EQ(error_of(head), "");
  EXPECT_EQ(error_of("unit_id,theta,phi\n"),
            "state.csv:1: column theta_deg, phi_deg is missing; there are: unit_id, theta, phi");
  EXPECT_EQ(error_of(head + "9,1,1\n"),
            "state.csv:2: unit 9: unknown unit, the layout has none such");
  EXPECT_EQ(error_of(head + "1,1,1\n1,1,1\n"), "state.csv:3: unit 1: named twice, first in line 2");
  EXPECT_EQ(error_of(head + "1,190.1,1\n"),
            "state.csv:2: column theta_deg: unit 1: 190.1 is out of its range -190..190 deg");
  EXPECT_EQ(error_of(head + "1,,1\n"),
            "state.csv:2: column theta_deg: the value is missing (empty or nan)");
  EXPECT_NE(error_of(head + "1,1e300,1\n"), "");
}

TEST(StateFile, TellsAllBadRows) {
  const Fleet fleet = Hex(3);
  const auto state = ReadState("unit_id,theta_deg,phi_deg\n9,1,1\n1,200,1\n2,1,1\n2,1,1\n",
                               "state.csv", fleet.layout, fleet.drives);
  ASSERT_FALSE(state);
  EXPECT_EQ(state.error().text,
            "state.csv:2: unit 9: unknown unit, the layout has none such\n"
            "  state.csv:3: column theta_deg: unit 1: 200 is out of its range -190..190 deg\n"
            "  state.csv:5: unit 2: named twice, first in line 4");
}

TEST(StateFile, TellsTheUnitsWithoutARow) {
  auto units = MakeHexLayout({.count = 40});
  units[2].enabled = false;
  units[4].enabled = false;
  const auto layout = Layout::Create(units, {});
  std::vector<std::optional<Pose>> poses(40, Pose{});
  const auto missing = [&](WhoseState whose) {
    const Status all = RequirePoses("state.csv", *layout, poses, whose);
    return all ? "" : all.error().text;
  };
  EXPECT_EQ(missing(WhoseState::kAll), "");
  poses[0].reset();
  EXPECT_EQ(missing(WhoseState::kAll),
            "state.csv: no row for unit 1: where it stands is needed to keep clear of it");
  EXPECT_EQ(missing(WhoseState::kDisabled), "");
  poses[4].reset();
  EXPECT_EQ(missing(WhoseState::kAll),
            "state.csv: no row for units 1, 5: where they stand is needed to keep clear of them");
  EXPECT_EQ(missing(WhoseState::kDisabled),
            "state.csv: no row for disabled unit 5: where it stands is needed to keep clear of it");
  poses.assign(40, std::nullopt);
  EXPECT_EQ(missing(WhoseState::kAll),
            "state.csv: no row for units 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, "
            "17, 18, 19, 20 and 20 more: where they stand is needed to keep clear of them");
}

TEST(StateFile, ADisabledUnitStandsWhereItStands) {
  auto units = MakeHexLayout({.count = 2});
  units[1].enabled = false;
  const auto layout = Layout::Create(units, {});
  const std::vector<UnitDrive> drives(2);
  const auto read =
      ReadState("unit_id,theta_deg,phi_deg\n2,250,190\n", "state.csv", *layout, drives);
  ASSERT_TRUE(read) << read.error().text;
  EXPECT_NEAR(AnglesOf(layout->unit({1}), drives[1], *(*read)[1]).theta_deg, 250, 0.003);
  EXPECT_FALSE(ReadState("unit_id,theta_deg,phi_deg\n2,1e300,190\n", "s", *layout, drives));
}

// ---- obstacles.csv

TEST(ObstaclesFile, ReadsBackAndNamesLineAndReason) {
  const std::vector<Obstacle> obstacles = {{1, {0.1, -2}, 3.5}, {7, {100, 0}, 0}};
  const auto read = ReadObstacles(WriteObstacles(obstacles), "o.csv");
  ASSERT_TRUE(read);
  ASSERT_EQ(read->size(), 2u);
  EXPECT_EQ((*read)[0].centre_fp.x_mm, 0.1);
  EXPECT_EQ((*read)[1].id, 7u);
  const auto error_of = [](const std::string& rows) {
    const auto r = ReadObstacles("obstacle_id,x_mm,y_mm,radius_mm\n" + rows, "o.csv");
    return r ? "" : r.error().text;
  };
  EXPECT_EQ(error_of(""), "");
  EXPECT_EQ(error_of("1,2,3,-1\n"), "o.csv:2: column radius_mm: -1 is negative");
  EXPECT_EQ(error_of("1,2,3,1\n1,5,5,1\n"), "o.csv:3: obstacle 1: is there twice, first in line 2");
  EXPECT_EQ(error_of("1,2,,1\n"), "o.csv:2: column y_mm: the value is missing (empty or nan)");
}

}  // namespace
}  // namespace focalfleet
