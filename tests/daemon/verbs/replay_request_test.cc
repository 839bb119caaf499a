// The traces of a past configuration, as a page asks for it.
#include "daemon/verbs/replay_request.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "daemon/status/history_json.h"
#include "daemon/store/store.h"
#include "tests/daemon/verbs/small_fleet.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using test::ScratchFolder;
using test::SmallFleet;

constexpr WallTime kBegan{1'900'000'000'000'000'000};

WallTime After(std::int64_t seconds) { return {kBegan.ns + seconds * 1'000'000'000}; }

class ReplayRequest : public ::testing::Test {
 protected:
  void Commit(const std::vector<Row>& rows, WallTime at) {
    const Status done = store_->Commit(rows, at);
    ASSERT_TRUE(done) << done.error().text;
  }
  /// A configuration that moves units 1 to `count` from 100 to 200 vectors of theta within 30 s.
  /// Unit 1 ends with a fault at 150 where `faulty`, all others arrive.
  void Move(std::uint64_t configuration, std::uint32_t count, WallTime began, bool faulty = false) {
    ConfigurationRow row;
    row.id = configuration;
    row.source = "night-" + std::to_string(configuration) + ".csv";
    std::vector<Row> rows{row};
    for (std::uint32_t unit = 1; unit <= count; ++unit) {
      IntentRow intent;
      intent.configuration = configuration;
      intent.unit = {unit};
      intent.serial = {7000 + unit};
      intent.move = {static_cast<std::uint16_t>(configuration)};
      intent.from = {100, 0};
      intent.to = {200, 0};
      intent.hull = {AxisKnowledge{Witness::kInterval, 100, 200},
                     AxisKnowledge{Witness::kInterval, 0, 0}};
      rows.emplace_back(intent);
    }
    Commit(rows, began);
    rows.clear();
    for (std::uint32_t unit = 1; unit <= count; ++unit) {
      const bool fails = faulty && unit == 1;
      rows.emplace_back(VectorRow{{7000 + unit},
                                  Exactly(Witness::kReported, Pose{fails ? 150 : 200, 0}),
                                  {},
                                  {96, 96},
                                  {static_cast<std::uint16_t>(configuration)},
                                  Origin::kMove});
      rows.emplace_back(IntentEndRow{{7000 + unit},
                                     {static_cast<std::uint16_t>(configuration)},
                                     fails ? IntentEnd::kFault : IntentEnd::kArrived});
    }
    row.state = ConfigurationState::kDone;
    rows.emplace_back(row);
    Commit(rows, {began.ns + 30'000'000'000});
  }
  void Measure(std::uint64_t configuration, std::uint64_t exposure, double error_um) {
    MeasurementRow row;
    row.exposure = exposure;
    row.configuration = configuration;
    row.serial = {7001};
    row.unit = {1};
    row.status = MeasurementStatus::kMeasured;
    row.covariance = {1e-6, 0, 1e-6};
    row.error_um = error_um;
    Commit({row}, After(1000 + static_cast<std::int64_t>(exposure)));
  }
  Result<Json> TryAsk(const Json& args) {
    const auto reading = AskReplay({.id = 1, .verb = "replay", .args = args}, fleet_->View());
    if (!reading) return tl::unexpected<Error>(reading.error());
    const auto reader = StoreReader::Open(scratch_ / "s.db");
    EXPECT_TRUE(reader) << reader.error().text;
    return (*reading)(reader->get());
  }
  Json Ask(const Json& args) {
    const auto answer = TryAsk(args);
    EXPECT_TRUE(answer) << answer.error().text;
    return answer.value_or(Json{});
  }

  const ScratchFolder scratch_;
  std::unique_ptr<SmallFleet> fleet_ = std::make_unique<SmallFleet>(4);
  std::unique_ptr<Store> store_ = Store::Open(scratch_ / "s.db").value();
};

TEST_F(ReplayRequest, HasWhatEachUnitSaidOfTheConfigurationThatIsAsked) {
  Move(1, 3, After(0));
  Move(2, 2, After(100), true);
  Move(3, 4, After(200));
  const Json answer = Ask({{"configuration", 2}});
  EXPECT_EQ(answer["configuration"]["source"], "night-2.csv");
  const Json& moves = answer["moves"];
  EXPECT_EQ(moves["unit_id"], Json({1, 2}));
  EXPECT_EQ(moves["end"], Json({"fault", "arrived"}));
  EXPECT_EQ(moves["round_began_s"], Json({0.0, 0.0}));
  EXPECT_EQ(moves["ended_s"], Json({30.0, 30.0}));
  EXPECT_EQ(moves["witness"], Json({"reported", "reported"}));
  EXPECT_TRUE(answer["next"].is_null());
  EXPECT_EQ(answer["moves_of_gone_units"], 0);
}

TEST_F(ReplayRequest, AnglesAreDirectionsOnThePlate) {
  Move(1, 2, After(0), true);
  const Json moves = Ask({{"configuration", 1}})["moves"];
  const Unit& unit = fleet_->layout().unit({0});
  const UnitDrive drive;
  const double per_vector = DegreesPerVector(unit.theta(), drive.axis[0]);
  EXPECT_NEAR(moves["theta_from_deg"][0].get<double>(), unit.theta().zero_deg + 100 * per_vector,
              6e-4);
  EXPECT_NEAR(moves["theta_to_deg"][0].get<double>(), unit.theta().zero_deg + 200 * per_vector,
              6e-4);
  EXPECT_NEAR(moves["theta_end_deg"][0].get<double>(), unit.theta().zero_deg + 150 * per_vector,
              6e-4);
}

TEST_F(ReplayRequest, PagesFollowEachOtherWithoutGapOrOverlap) {
  Move(1, 4, After(0));
  Move(2, 4, After(100));
  Move(3, 4, After(200));
  Json args{{"configuration", 2}, {"limit", 3}};
  Json answer = Ask(args);
  EXPECT_EQ(answer["moves"]["unit_id"], Json({1, 2, 3}));
  ASSERT_FALSE(answer["next"].is_null());
  args["after"] = answer["next"];
  answer = Ask(args);
  EXPECT_EQ(answer["moves"]["unit_id"], Json({4}));
  EXPECT_TRUE(answer["next"].is_null());
  EXPECT_FALSE(answer.contains("configuration")) << "the first page has it";
}

TEST_F(ReplayRequest, FindsEachOfManyConfigurations) {
  for (std::uint64_t id = 1; id <= 37; ++id)
    Move(id, 1 + static_cast<std::uint32_t>(id % 4), After(static_cast<std::int64_t>(id) * 100));
  for (std::uint64_t id = 1; id <= 37; ++id)
    EXPECT_EQ(Ask({{"configuration", id}})["moves"]["unit_id"].size(), 1 + id % 4) << id;
}

TEST_F(ReplayRequest, ErrorsAreThoseOfItsOwnLastExposure) {
  for (std::uint64_t id = 1; id <= 3; ++id) Move(id, 1, After(static_cast<std::int64_t>(id) * 100));
  Measure(1, 5, 50);
  Measure(1, 6, 7);
  Measure(3, 9, 30);
  const Json errors = Ask({{"configuration", 1}})["errors"];
  EXPECT_EQ(errors["exposure"], 6);
  EXPECT_EQ(errors["unit_id"], Json({1}));
  EXPECT_EQ(errors["error_um"], Json({7.0}));
  EXPECT_EQ(Ask({{"configuration", 2}})["errors"]["exposure"], 0) << "it was never measured";
  EXPECT_EQ(Ask({{"configuration", 3}})["errors"]["error_um"], Json({30.0}));
}

TEST_F(ReplayRequest, AUnitIsFoundInTheExposuresOfOneConfiguration) {
  for (std::uint64_t id = 1; id <= 3; ++id) Move(id, 1, After(static_cast<std::int64_t>(id) * 100));
  Measure(1, 5, 50);
  Measure(2, 6, 40);
  Measure(2, 8, 7);
  Measure(3, 9, 30);
  const auto reader = StoreReader::Open(scratch_ / "s.db").value();
  const auto found = [&](std::uint32_t unit, std::uint64_t configuration) {
    return HistoryJson(reader->MeasurementsOf({unit}, configuration).value());
  };
  const Json second = found(1, 2);
  ASSERT_EQ(second.size(), 2u);
  EXPECT_EQ(second[0]["exposure"], 8) << "the newest first";
  EXPECT_EQ(second[0]["error_um"], 7.0);
  EXPECT_EQ(second[0]["configuration"], 2);
  EXPECT_EQ(second[0]["status"], "measured");
  EXPECT_EQ(second[1]["exposure"], 6);
  EXPECT_EQ(found(1, 3).size(), 1u);
  EXPECT_TRUE(found(1, 4).empty());
  EXPECT_TRUE(found(2, 2).empty());
}

TEST_F(ReplayRequest, AlarmsAreThoseOfItsTime) {
  Move(1, 1, After(0));
  Move(2, 1, After(100));
  Commit({AlarmRow{1, Severity::kError, UnitId{1}, {}, "before"}}, After(-5));
  Commit({AlarmRow{2, Severity::kError, UnitId{1}, {}, "during"}}, After(15));
  Commit({AlarmRow{3, Severity::kError, UnitId{1}, {}, "of the next"}}, After(110));
  const Json alarms = Ask({{"configuration", 1}})["alarms"];
  ASSERT_EQ(alarms.size(), 1u);
  EXPECT_EQ(alarms[0]["text"], "during");
}

TEST_F(ReplayRequest, UnitsThatTheLayoutNoLongerHasAreCounted) {
  Move(1, 4, After(0));
  fleet_ = std::make_unique<SmallFleet>(2);
  const Json answer = Ask({{"configuration", 1}});
  EXPECT_EQ(answer["moves"]["unit_id"], Json({1, 2}));
  EXPECT_EQ(answer["moves_of_gone_units"], 2);
}

TEST_F(ReplayRequest, RefusesWhatIsNotThere) {
  Move(1, 1, After(0));
  EXPECT_EQ(TryAsk({{"configuration", 2}}).error().code, ErrorCode::kRefused);
  EXPECT_EQ(TryAsk(Json::object()).error().code, ErrorCode::kInvalid);
  EXPECT_EQ(TryAsk({{"configuration", "1"}}).error().code, ErrorCode::kInvalid);
  EXPECT_EQ(TryAsk({{"configuration", 1}, {"limit", 0}}).error().code, ErrorCode::kInvalid);
  EXPECT_EQ(TryAsk({{"configuration", UINT64_MAX}}).error().code, ErrorCode::kInvalid);
  EXPECT_EQ(TryAsk({{"configuration", 1}, {"after", UINT64_MAX}}).error().code,
            ErrorCode::kInvalid);
  EXPECT_TRUE(Ask({{"configuration", 1}, {"after", 1'000'000}})["moves"]["unit_id"].empty());
}

}  // namespace
}  // namespace focalfleet
