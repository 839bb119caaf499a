#include "fleet/plane/plane_plan.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "fleet/hex_layout.h"
#include "fleet/targets.h"
#include "protocol/base/rng.h"

namespace focalfleet {
namespace {

/// A plate of 60 units on six buses, which three sectors share.
PlaneLayout ThreeSectors() {
  std::vector<Unit> units = MakeHexLayout({.count = 60, .units_per_bus = 10});
  std::ranges::sort(units, {}, [](const Unit& unit) { return unit.base_fp.x_mm; });
  for (std::uint32_t n = 0; n < units.size(); ++n) {
    units[n].bus = {n / 10};
    units[n].node = {static_cast<std::uint8_t>(n % 10 + 1)};
  }
  auto layout = Layout::Create(std::move(units), {});
  auto plane = PlaneLayout::Create(std::move(*layout), {{{0}, {1}}, {{2}, {3}}, {{4}, {5}}});
  EXPECT_TRUE(plane.has_value()) << plane.error().text;
  return std::move(*plane);
}

/// The jobs of all sectors: from one random configuration to another.
std::vector<std::shared_ptr<const SectorJob>> JobsOf(const PlaneLayout& plane) {
  const std::vector<UnitDrive> drives(plane.layout().size());
  const auto start = DrawConfiguration(plane.layout(), drives, {}, Rng::Stream(1, "start"));
  const auto targets = DrawConfiguration(plane.layout(), drives, {}, Rng::Stream(1, "targets"));
  std::vector<std::shared_ptr<const SectorJob>> jobs;
  for (std::uint32_t sector = 0; sector < plane.sectors(); ++sector) {
    auto job = std::make_shared<SectorJob>();
    job->job = 10 + sector;
    job->start_skew_s = 0.02;
    job->notice_s = 1;
    for (const PositionerIndex i : plane.own(sector)) {
      job->start.push_back(Exactly(Witness::kReported, (*start)[i.value]));
      job->targets.push_back((*targets)[i.value]);
      job->frozen.push_back(0);
      job->offsets.push_back({});
      job->drives.push_back({});
    }
    EXPECT_EQ(FaultOf(*job, plane.own(sector).size()), "");
    jobs.push_back(std::move(job));
  }
  return jobs;
}

TEST(PlaneLayout, KnowsItsBorders) {
  const PlaneLayout plane = ThreeSectors();
  EXPECT_EQ(plane.sectors(), 3u);
  EXPECT_EQ(plane.neighbours(0).size(), 1u);  // strips
  EXPECT_EQ(plane.neighbours(1).size(), 2u);
  for (std::uint32_t n = 0; n < plane.layout().size(); ++n) {
    const bool beyond = std::ranges::any_of(
        plane.layout().neighbours({n}),
        [&](PositionerIndex other) { return plane.SectorOf(other) != plane.SectorOf({n}); });
    EXPECT_EQ(!plane.beyond({n}).empty(), beyond) << n;
    EXPECT_EQ(plane.own(plane.SectorOf({n}))[plane.Local({n}).value], PositionerIndex{n});
  }
}

TEST(PlaneLayout, RefusesBusesThatAreInNoSectorOrInTwo) {
  std::vector<Unit> units = MakeHexLayout({.count = 20, .units_per_bus = 10});
  const auto layout = [&] { return std::move(*Layout::Create(units, {})); };
  EXPECT_FALSE(PlaneLayout::Create(layout(), {{{0}}}).has_value());
  EXPECT_FALSE(PlaneLayout::Create(layout(), {{{0}, {1}}, {{1}}}).has_value());
  EXPECT_FALSE(PlaneLayout::Create(layout(), {{{0}, {1}}, {{7}}}).has_value());
  EXPECT_FALSE(PlaneLayout::Create(layout(), {{{0}, {1}}, {}}).has_value());
  EXPECT_TRUE(PlaneLayout::Create(layout(), {{{0}}, {{1}}}).has_value());
}

TEST(PlanePlan, IsThePlanOfOneDaemon) {
  const PlaneLayout plane = ThreeSectors();
  const auto jobs = JobsOf(plane);
  const PlaneJob job = MakePlaneJob(1, plane, jobs, 0.5, 0.005);
  EXPECT_TRUE(HasWork(job));
  EXPECT_DOUBLE_EQ(job.plan.options.notice_s, 1.5);
  EXPECT_DOUBLE_EQ(job.plan.options.start_skew_s, 0.025);
  const PlanePlanDone done = RunPlaneJob(job, plane);
  ASSERT_TRUE(done.plan.has_value()) << done.plan.error().text;
  const PlanRequest request{.layout = &plane.layout(),
                            .drives = job.drives,
                            .start = job.plan.start,
                            .targets = job.plan.targets,
                            .frozen = job.plan.frozen};
  const auto alone = MakePlan(request, job.plan.options);
  ASSERT_TRUE(alone.has_value());
  EXPECT_EQ(done.plan->moves, alone->moves.size());
  EXPECT_EQ(done.plan->makespan_s, alone->makespan_s);
  std::size_t followers = 0, divided = 0;
  for (const UnitPlan& move : alone->moves) followers += move.followers.size();
  for (std::uint32_t sector = 0; sector < plane.sectors(); ++sector) {
    const SectorRound& round = done.plan->rounds[sector];
    EXPECT_EQ(FaultOf(round, plane.own(sector).size()), "");
    EXPECT_EQ(round.job, 10 + sector);
    for (const UnitPlan& move : round.moves) {
      divided += move.followers.size();
      const PositionerIndex i = plane.own(sector)[move.unit.value];
      const auto same = std::ranges::find(alone->moves, i, &UnitPlan::unit);
      ASSERT_NE(same, alone->moves.end());
      EXPECT_EQ(same->to, move.to);
    }
    divided += round.follows.size();
    for (const SectorRound::FollowsBeyond& follows : round.follows)
      EXPECT_NE(follows.sector, sector);
  }
  EXPECT_EQ(divided, followers);
  EXPECT_GT(done.plan->follows_beyond, 0u);
}

TEST(PlanePlan, LeavesTheStripBesideAnAbsentSectorStanding) {
  const PlaneLayout plane = ThreeSectors();
  auto jobs = JobsOf(plane);
  jobs[2] = nullptr;
  const PlaneJob job = MakePlaneJob(1, plane, jobs, 0.5, 0.005);
  EXPECT_EQ(job.units.size(), 40u);
  EXPECT_EQ(job.sector_jobs[2], 0u);
  const PlanePlanDone done = RunPlaneJob(job, plane);
  ASSERT_TRUE(done.plan.has_value()) << done.plan.error().text;
  EXPECT_TRUE(done.plan->rounds[2].moves.empty());
  std::size_t strip = 0;
  for (std::uint32_t sector = 0; sector < 2; ++sector)
    for (const UnitPlan& move : done.plan->rounds[sector].moves) {
      const auto beyond = plane.beyond(plane.own(sector)[move.unit.value]);
      EXPECT_EQ(std::ranges::find(beyond, 2u), beyond.end());
    }
  for (const std::uint8_t stands : job.strip) strip += stands;
  EXPECT_GT(strip, 0u);
}

TEST(PlanePlan, RefusesWhatNoSectorCanHaveAsked) {
  const PlaneLayout plane = ThreeSectors();
  const auto jobs = JobsOf(plane);
  SectorJob job = *jobs[0];
  job.start[3][0].low = job.start[3][0].high + 1;
  EXPECT_NE(FaultOf(job, job.start.size()), "");
  job = *jobs[0];
  job.notice_s = -1;
  EXPECT_NE(FaultOf(job, job.start.size()), "");
  EXPECT_NE(FaultOf(*jobs[0], jobs[0]->start.size() + 1), "");
}

}  // namespace
}  // namespace focalfleet
