#include "fleet/files/plan_file.h"

#include <gtest/gtest.h>

#include "fleet/hex_layout.h"

namespace focalfleet {
namespace {

struct Case {
  Layout layout;
  std::vector<UnitDrive> drives;
  Plan plan;
};

Case TwoMoves() {
  Case c{*Layout::Create(MakeHexLayout({.count = 3}), {}), std::vector<UnitDrive>(3), {}};
  UnitPlan first;
  first.unit = {0};
  first.from = {-100, 40'000};
  first.to = {200, 39'000};
  first.mode = WaveMode::kSevenSegment;
  first.path[0].Append({12'345, 400, 108});
  first.path[0].Append({20'000, -100, 200});
  first.path[1].Append({0, -1000, 108});
  UnitPlan second;
  second.unit = {2};
  second.path[1].Append({7, 96, 37});
  c.plan.moves = {first, second};
  return c;
}

TEST(PlanFile, RowsAreExactlyTheSegmentsThatGoOnTheBus) {
  const Case c = TwoMoves();
  const auto rows = RowsOf(c.plan, c.layout, c.drives, {});
  ASSERT_EQ(rows.size(), 4u);
  const double step = 360.0 / (96 * (337.0 * 45 / 17));
  EXPECT_EQ(rows[0].unit, UnitId{1});
  EXPECT_EQ(rows[0].axis, Axis::kTheta);
  EXPECT_EQ(rows[0].t0_s, 1.2345);
  EXPECT_NEAR(rows[0].t1_s, 1.2345 + 400 * 54'000 / 144e6, 1e-12);
  EXPECT_NEAR(rows[0].from_deg, -100 * step, 1e-12);
  EXPECT_NEAR(rows[0].to_deg, 300 * step, 1e-12);
  EXPECT_EQ(rows[1].from_deg, rows[0].to_deg);
  EXPECT_NEAR(rows[1].t1_s, 2 + 100 * 100'000 / 144e6, 1e-12);
  EXPECT_EQ(rows[2].axis, Axis::kPhi);
  EXPECT_EQ(rows[2].mode, WaveMode::kSevenSegment);
  EXPECT_EQ(rows[3].unit, UnitId{3});
  EXPECT_EQ(rows[3].power_W, SteadyPower({}, {{500, 37, 96}}).total_W());
}

TEST(PlanFile, WhatIsWrittenReadsBackEqual) {
  const Case c = TwoMoves();
  const auto rows = RowsOf(c.plan, c.layout, c.drives, {});
  const auto read = ReadPlan(WritePlan(rows), "plan.csv");
  ASSERT_TRUE(read) << read.error().text;
  ASSERT_EQ(read->size(), rows.size());
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const PlanRow& a = rows[k];
    const PlanRow& b = (*read)[k];
    EXPECT_EQ(a.unit, b.unit);
    EXPECT_EQ(a.axis, b.axis);
    EXPECT_EQ(a.t0_s, b.t0_s);
    EXPECT_EQ(a.t1_s, b.t1_s);
    EXPECT_EQ(a.from_deg, b.from_deg);
    EXPECT_EQ(a.to_deg, b.to_deg);
    EXPECT_EQ(a.mode, b.mode);
    EXPECT_EQ(a.power_W, b.power_W);
    EXPECT_EQ(b.line, static_cast<int>(k) + 2);
  }
}

TEST(PlanFile, NamesFileLineAndReason) {
  const auto error_of = [](const std::string& rows) {
    const auto r =
        ReadPlan("unit_id,axis,t0_s,t1_s,from_deg,to_deg,mode,power_W\n" + rows, "plan.csv");
    return r ? "" : r.error().text;
  };
  const std::string good = "1,theta,0,1,0,5,asymmetric,0.1\n";
  EXPECT_EQ(error_of(""), "");
  EXPECT_EQ(error_of(good + "1,theta,2,3,5,6,asymmetric,0.1\n1,phi,0,9,1,2,asymmetric,0\n"), "");
  EXPECT_EQ(error_of("1,alpha,0,1,0,5,asymmetric,0.1\n"),
            "plan.csv:2: column axis: 'alpha' is neither theta nor phi");
  EXPECT_EQ(error_of("1,theta,0,1,0,5,fast,0.1\n"),
            "plan.csv:2: column mode: 'fast' is not one of asymmetric, five_segment, "
            "seven_segment");
  EXPECT_EQ(error_of("1,theta,2,1,0,5,asymmetric,0.1\n"),
            "plan.csv:2: column t1_s: the row ends before it begins");
  EXPECT_EQ(error_of("1,theta,-1,1,0,5,asymmetric,0.1\n"),
            "plan.csv:2: column t0_s: before the start signal");
  EXPECT_EQ(error_of("1,theta,0,1,0,5,asymmetric,-1\n"), "plan.csv:2: column power_W: negative");
  EXPECT_EQ(error_of(good + "1,theta,0.5,3,5,6,asymmetric,0.1\n"),
            "plan.csv:3: unit 1 theta: begins at 0.5 s, before the end of line 2 at 1 s");
  EXPECT_EQ(error_of(good + "1,theta,1,3,6,7,asymmetric,0.1\n"),
            "plan.csv:3: unit 1 theta: begins at 6 deg, but the row of line 2 ends at 5 deg");
}

TEST(PlanFile, TellsAllBadRows) {
  const std::string head = "unit_id,axis,t0_s,t1_s,from_deg,to_deg,mode,power_W\n";
  const auto rows =
      ReadPlan(head + "1,alpha,0,1,0,5,asymmetric,0.1\n1,theta,0,1,0,5,fast,0.1\n", "plan.csv");
  ASSERT_FALSE(rows);
  EXPECT_EQ(rows.error().text,
            "plan.csv:2: column axis: 'alpha' is neither theta nor phi\n"
            "  plan.csv:3: column mode: 'fast' is not one of asymmetric, five_segment, "
            "seven_segment");
  const auto joins = ReadPlan(head +
                                  "1,theta,0,1,0,5,asymmetric,0.1\n1,theta,1,2,6,7,asymmetric,0.1\n"
                                  "1,theta,2,3,8,9,asymmetric,0.1\n",
                              "plan.csv");
  ASSERT_FALSE(joins);
  EXPECT_EQ(joins.error().text,
            "plan.csv:3: unit 1 theta: begins at 6 deg, but the row of line 2 ends at 5 deg\n"
            "  plan.csv:4: unit 1 theta: begins at 8 deg, but the row of line 3 ends at 7 deg");
}

}  // namespace
}  // namespace focalfleet
