#include "daemon/page/night_curves.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "fleet/hex_layout.h"

namespace focalfleet {
namespace {

using nlohmann::json;

constexpr std::int64_t kBeginMs = 1'900'000'000'000;

StatusBatch FleetAt(std::int64_t after_ms, double load, std::uint32_t moving = 0) {
  StatusBatch batch;
  batch.fleet.emplace();
  batch.fleet->at = {(kBeginMs + after_ms) * 1'000'000};
  batch.fleet->units = 100;
  batch.fleet->enabled = 97;
  batch.fleet->units_by_phase[static_cast<std::size_t>(UnitPhase::kMoving)] = moving;
  batch.fleet->bus_load_max = load;
  return batch;
}

json Asked(const NightCurves& night, std::int64_t since_ms = -1) {
  return json::parse(night.Text(since_ms));
}

TEST(NightCurves, ASampleIsTakenEachPeriodWithTheHighestLoadSinceTheLast) {
  NightCurves night;
  night.Take(FleetAt(0, 0.1));
  night.Take(FleetAt(3000, 0.9));
  night.Take(FleetAt(9000, 0.2));
  night.Take(FleetAt(10'000, 0.3, 42));
  const json samples = Asked(night)["samples"];
  EXPECT_EQ(samples["at_ms"], json({kBeginMs, kBeginMs + 10'000}));
  EXPECT_EQ(samples["bus_load_max"], json({0.1, 0.9}));
  EXPECT_EQ(samples["disabled"], json({3, 3}));
  EXPECT_EQ(samples["phases"][static_cast<std::size_t>(UnitPhase::kMoving)], json({0, 42}));
}

TEST(NightCurves, AClockThatWasSetBackEndsNoCurve) {
  NightCurves night;
  night.Take(FleetAt(3'600'000, 0.1));
  night.Take(FleetAt(0, 0.2));
  EXPECT_EQ(Asked(night)["samples"]["at_ms"].size(), 2u);
}

TEST(NightCurves, APageThatHasAPartAsksForTheRest) {
  NightCurves night;
  for (std::int64_t k = 0; k < 5; ++k) night.Take(FleetAt(10'000 * k, 0.1));
  const json rest = Asked(night, kBeginMs + 20'000)["samples"];
  EXPECT_EQ(rest["at_ms"], json({kBeginMs + 30'000, kBeginMs + 40'000}));
  EXPECT_EQ(rest["phases"][0].size(), 2u);
}

TEST(NightCurves, AllListsAreBounded) {
  NightCurves night(
      {.period_ns = 1'000'000, .samples_max = 10, .exposures_max = 3, .plans_max = 2});
  for (std::int64_t k = 0; k < 50; ++k) {
    StatusBatch batch = FleetAt(k, 0.1);
    batch.configuration.emplace();
    batch.configuration->view.id = static_cast<std::uint64_t>(k);
    batch.configuration->view.measured = {{.exposure = static_cast<std::uint64_t>(100 + k)}};
    night.Take(batch);
    night.Take(PlanPower{.configuration = static_cast<std::uint64_t>(k), .total_W = {1, 2}});
  }
  const json all = Asked(night);
  EXPECT_EQ(all["samples"]["at_ms"].size(), 10u);
  EXPECT_EQ(all["exposures"]["exposure"], json({147, 148, 149})) << "the newest stay";
  EXPECT_EQ(all["plans"]["configuration"], json({48, 49}));
}

TEST(NightCurves, AnExposureIsOneThoughItsConfigurationIsReportedOften) {
  NightCurves night;
  StatusBatch batch = FleetAt(0, 0.1);
  batch.configuration.emplace();
  batch.configuration->view.id = 3;
  batch.configuration->view.measured = {{.exposure = 8, .measured = 90, .median_um = 40}};
  night.Take(batch);
  batch.configuration->view.measured.push_back({.exposure = 9, .measured = 91, .median_um = 4});
  night.Take(batch);
  night.Take(batch);
  const json exposures = Asked(night)["exposures"];
  EXPECT_EQ(exposures["exposure"], json({8, 9}));
  EXPECT_EQ(exposures["median_um"], json({40.0, 4.0}));
  EXPECT_EQ(exposures["configuration"], json({3, 3}));
}

TEST(NightCurves, TheLongestPlanOfTheNewestConfigurationIsShown) {
  NightCurves night;
  night.Take(PlanPower{.configuration = 1, .end_s = 30, .total_W = {7}});
  night.Take(PlanPower{.configuration = 1, .end_s = 0.01, .total_W = {1}});
  EXPECT_EQ(Asked(night)["power"]["total_W"], json({7.0}));
  night.Take(PlanPower{.configuration = 2, .end_s = 5, .total_W = {3}});
  EXPECT_EQ(Asked(night)["power"]["total_W"], json({3.0}));
  EXPECT_EQ(Asked(night)["plans"]["configuration"], json({1, 1, 2}));
}

TEST(NightCurves, ThePowerOfAPlanKeepsItsPeaksHoweverShort) {
  const Layout layout = Layout::Create(MakeHexLayout({.count = 20}), {}).value();
  const std::vector<UnitDrive> drives(layout.size());
  Plan plan;
  UnitPlan longer{.unit = {0}};
  longer.path[0].Append({.start_ticks = 0, .delta = 20'000, .repeat = 108});
  UnitPlan brief{.unit = {1}};  // a 4000th of the time
  brief.path[0].Append({.start_ticks = 30'000, .delta = 5, .repeat = 108});
  plan.moves = {longer, brief};
  PlanJob job;
  job.options.power.rail_W = 5;
  const PlanPower power = PowerOverTime(plan, job, layout, drives);
  const double alone_W = power.total_W.back();
  EXPECT_GT(alone_W, 0);
  EXPECT_GT(*std::max_element(power.total_W.begin(), power.total_W.end()), 1.9 * alone_W);
  EXPECT_EQ(power.rail_limit_W, 5);
  NightCurves night;
  night.Take(power);
  const json shown = Asked(night)["power"];
  EXPECT_EQ(shown["total_W"].size(), power.total_W.size());
  EXPECT_EQ(shown["rail_limit_W"], 5.0);
}

}  // namespace
}  // namespace focalfleet
