#include "daemon/plane/plane_codec.h"

#include <gtest/gtest.h>

#include <limits>

#include "protocol/base/limits.h"
#include "protocol/base/rng.h"

namespace focalfleet {
namespace {

PlaneOrder AnOrder() {
  PlaneOrder order;
  order.epoch = {4, 77};
  order.sector = 2;
  order.incarnation = 9;
  order.number = 31;
  order.kind = OrderKind::kRound;
  order.round = 5;
  order.job = 12;
  order.together = {1, 3};
  order.sent = HostInstant{123'456'789};
  order.ahead = DurationNs{-5};
  auto body = std::make_shared<SectorRound>();
  body->job = 12;
  UnitPlan move{.unit = {3}, .from = {10, 20}, .to = {15, 20}};
  move.path[0].Append({7, 5, 108});
  move.followers.push_back({{4}, 1.5, 2.5, 0.5});
  body->moves.push_back(move);
  body->follows.push_back({UnitId{42}, 1, {{3}, 1, 2, 0.25}});
  body->leads.push_back({{3}, 0.5, 9});
  body->refused.push_back({{6}, "blocked by unit 7"});
  order.round_body = body;
  order.change = 4;
  order.retargets.push_back({4, {{3}, {7, -8}}});
  return order;
}

PlaneOrder AHomingOrder() {
  PlaneOrder order = AnOrder();
  order.kind = OrderKind::kConfigure;
  order.round_body.reset();
  order.task = std::make_shared<const SectorTask>(SectorTask{HomeCommand{{{3}, {5}}, true}});
  return order;
}

PlaneOrder AFindingsOrder() {
  PlaneOrder order = AnOrder();
  order.kind = OrderKind::kFindings;
  order.round_body.reset();
  ExposureFindings findings{.id = 12, .measurements = {}};
  findings.measurements.push_back({.unit = {3},
                                   .status = MeasurementStatus::kMeasured,
                                   .other = {},
                                   .x_mm = 1.5,
                                   .y_mm = -2,
                                   .covariance = RoundCovariance(2),
                                   .place = Pose{5, 6}});
  order.findings = std::make_shared<const Result<ExposureFindings>>(std::move(findings));
  return order;
}

SectorReport AReport() {
  SectorReport report{.sector = 1, .incarnation = 3, .number = 8, .accepted = {4, 77}};
  report.stage = SectorStage::kAsking;
  report.counts.arrived = 5;
  report.echo = SectorReport::Echo{{1}, {2}, {3}};
  auto job = std::make_shared<SectorJob>();
  job->job = 12;
  job->start.resize(2);
  job->targets = {Pose{1, 2}, std::nullopt};
  job->frozen = {0, 1};
  job->offsets.resize(2);
  job->drives.resize(2);
  report.body = job;
  auto places = std::make_shared<SectorPlaces>();
  places->places.resize(2);
  places->drives.resize(2);
  report.places = places;
  auto exposure = std::make_shared<SectorExposure>();
  exposure->id = 4;
  exposure->expected.resize(2);
  exposure->before = {Pose{7, 8}, std::nullopt};
  exposure->reported.resize(2);
  exposure->seen = {0, 1};
  exposure->wanted = {1, 1};
  exposure->drives.resize(2);
  report.exposure = exposure;
  return report;
}

BorderNews SomeNews() {
  return {.sector = 1,
          .incarnation = 3,
          .number = 8,
          .epoch = {4, 77},
          .round = 5,
          .stage = BorderStage::kStarted,
          .start_at = {99},
          .heard = {0, 2},
          .ends = {{UnitId{8}, HostInstant{INT64_MIN}, kNever}}};
}

TEST(PlaneCodec, MessagesComeAcrossWithEveryField) {
  const auto order = DecodePlaneOrder(Encode(AnOrder()));
  ASSERT_TRUE(order.has_value()) << order.error().text;
  EXPECT_EQ(Encode(*order), Encode(AnOrder()));
  ASSERT_NE(order->round_body, nullptr);
  EXPECT_EQ(order->round_body->moves[0].path[0].segments()[0].delta, 5);
  EXPECT_EQ(order->round_body->refused[0].reason, "blocked by unit 7");
  EXPECT_EQ(order->task, nullptr);
  ASSERT_EQ(order->retargets.size(), 1u);
  EXPECT_EQ(order->retargets[0].target.pose, (Pose{7, -8}));
  const auto homes = DecodePlaneOrder(Encode(AHomingOrder()));
  ASSERT_TRUE(homes.has_value()) << homes.error().text;
  ASSERT_NE(homes->task, nullptr);
  EXPECT_EQ(std::get<HomeCommand>(homes->task->what).units.size(), 2u);
  const auto found = DecodePlaneOrder(Encode(AFindingsOrder()));
  ASSERT_TRUE(found.has_value()) << found.error().text;
  ASSERT_TRUE(found->findings != nullptr && found->findings->has_value());
  EXPECT_EQ((*found->findings)->measurements[0].place, (Pose{5, 6}));
  const auto report = DecodeSectorReport(Encode(AReport()));
  ASSERT_TRUE(report.has_value()) << report.error().text;
  EXPECT_EQ(Encode(*report), Encode(AReport()));
  EXPECT_EQ(FaultOf(*report->exposure, 2), "");
  EXPECT_NE(FaultOf(*report->exposure, 3), "");
  const auto news = DecodeBorderNews(Encode(SomeNews()));
  ASSERT_TRUE(news.has_value()) << news.error().text;
  EXPECT_EQ(Encode(*news), Encode(SomeNews()));
}

TEST(PlaneCodec, RefusesCodesAndListsBeyondTheirLimits) {
  PlaneOrder order = AnOrder();
  order.kind = static_cast<OrderKind>(8);
  EXPECT_FALSE(DecodePlaneOrder(Encode(order)).has_value());
  order = AnOrder();
  order.sector = limits::kSectors;
  EXPECT_FALSE(DecodePlaneOrder(Encode(order)).has_value());
  order = AnOrder();
  order.retargets[0].target.pose[0] = INT32_MAX;
  EXPECT_FALSE(DecodePlaneOrder(Encode(order)).has_value());
  order = AnOrder();
  order.ahead = DurationNs{INT64_MAX};
  EXPECT_FALSE(DecodePlaneOrder(Encode(order)).has_value());
  order = AnOrder();
  order.sent = HostInstant{INT64_MIN};
  EXPECT_FALSE(DecodePlaneOrder(Encode(order)).has_value());
  order = AFindingsOrder();
  ExposureFindings findings = **order.findings;
  findings.measurements[0].x_mm = std::numeric_limits<double>::quiet_NaN();
  order.findings = std::make_shared<const Result<ExposureFindings>>(findings);
  EXPECT_FALSE(DecodePlaneOrder(Encode(order)).has_value());
  SectorReport report = AReport();
  report.stage = static_cast<SectorStage>(kSectorStageCount);
  EXPECT_FALSE(DecodeSectorReport(Encode(report)).has_value());
  report = AReport();
  report.incarnation = 0;
  EXPECT_FALSE(DecodeSectorReport(Encode(report)).has_value());
  BorderNews news = SomeNews();
  news.ends.resize(limits::kBorderEnds + 1);
  EXPECT_FALSE(DecodeBorderNews(Encode(news)).has_value());
}

// Cut short anywhere, or with any byte changed, bytes are a message or an error; nothing else.
TEST(PlaneCodec, AnyBytesAreAMessageOrAnError) {
  Rng rng(1);
  for (const std::string& whole :
       {Encode(AnOrder()), Encode(AHomingOrder()), Encode(AFindingsOrder()), Encode(AReport()),
        Encode(SomeNews())}) {
    for (std::size_t n = 0; n < whole.size(); ++n) {
      const std::string cut = whole.substr(0, n);
      EXPECT_FALSE(DecodePlaneOrder(cut).has_value() && DecodeSectorReport(cut).has_value());
      std::string changed = whole;
      changed[n] = static_cast<char>(rng.Below(256));
      static_cast<void>(DecodePlaneOrder(changed));
      static_cast<void>(DecodeSectorReport(changed));
      static_cast<void>(DecodeBorderNews(changed));
    }
    EXPECT_FALSE(DecodePlaneOrder(whole + "x").has_value());
  }
}

}  // namespace
}  // namespace focalfleet
