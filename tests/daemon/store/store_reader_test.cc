// The history that the store keeps, read back beside the writer.
#include "daemon/store/store_reader.h"

#include <gmock/gmock.h>

#include <cmath>

#include "tests/daemon/store/store_fixture.h"

namespace focalfleet {
namespace {

using test::ErrorOf;
using test::Intent;
using test::kEight;
using test::kNine;
using test::StoreTest;
using test::Tuned;
using test::Vector;
using ::testing::HasSubstr;

ModelRow Loaded(std::uint64_t entry, const std::string& sha256, const std::string& text) {
  return {.entry = entry,
          .sha256 = sha256,
          .restores = 0,
          .name = "night-extended",
          .campaign = "night",
          .campaign_sha256 = "c0ffee",
          .rms_before_um = 54,
          .rms_after_um = std::nan(""),
          .text = std::make_shared<const std::string>(text)};
}

TEST_F(StoreTest, ModelsAndWhenTheyHeldComeBack) {
  auto store = OpenStore();
  test::ExpectDone(store->Commit(std::vector<Row>{Loaded(1, "aa", "name = 'a'\n")}, kEight));
  test::ExpectDone(store->Commit(std::vector<Row>{ModelRow{.entry = 2}}, kNine));
  ModelRow back = Loaded(3, "aa", "");
  back.text.reset();
  back.restores = 1;
  test::ExpectDone(store->Commit(std::vector<Row>{back}, kNine));
  const auto reader = OpenReader();
  const auto changes = reader->Models(10);
  ASSERT_TRUE(changes) << changes.error().text;
  ASSERT_EQ(changes->size(), 3u);  // newest first
  EXPECT_EQ((*changes)[0].row.restores, 1u);
  EXPECT_EQ((*changes)[0].row.sha256, "aa");
  EXPECT_EQ((*changes)[1].row.sha256, "");
  const ModelRow& first = (*changes)[2].row;
  EXPECT_EQ(first.entry, 1u);
  EXPECT_EQ(first.name, "night-extended");
  EXPECT_EQ(first.campaign, "night");
  EXPECT_EQ(first.campaign_sha256, "c0ffee");
  EXPECT_EQ(first.rms_before_um, 54);
  EXPECT_TRUE(std::isnan(first.rms_after_um));
  EXPECT_EQ((*changes)[2].at.ns, kEight.ns);
  EXPECT_EQ(*reader->ModelText("aa"), "name = 'a'\n");
  const auto none = reader->ModelText("bb");
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, ErrorCode::kRefused);
  // A row that could not be read back is not written.
  EXPECT_FALSE(store->Commit(std::vector<Row>{ModelRow{.entry = 0}}, kNine));
  ModelRow later = back;
  later.entry = 4;
  later.restores = 4;
  EXPECT_FALSE(store->Commit(std::vector<Row>{later}, kNine));
  EXPECT_EQ(OpenReader()->Models(10)->size(), 3u);
}

TEST_F(StoreTest, ListsUnitsWhoseCountBeganAnewSinceAChangeOfTheModel) {
  auto store = OpenStore();
  // Time goes backwards: the order of the rows decides.
  auto commit = [&, now = kNine](std::vector<Row> rows) mutable {
    now.ns -= 60'000'000'000;
    test::ExpectDone(store->Commit(rows, now));
  };
  const auto home = [&](std::uint32_t unit, std::uint32_t serial, IntentEnd end) {
    commit({Intent(unit, serial, 3, {0, 0}, {5, 5}), IntentEndRow{{serial}, {3}, end}});
  };
  commit({BindingRow{{12}, {7001}}, BindingRow{{13}, {7002}}, BindingRow{{14}, {7003}},
          BindingRow{{15}, {7004}}, BindingRow{{16}, {7005}}, BindingRow{{17}, {7006}},
          BindingRow{{19}, {7008}}, BindingRow{{20}, {7009}}, BindingRow{{21}, {7010}},
          BindingRow{{22}, {7011}}});
  home(21, 7010, IntentEnd::kHomed);
  commit({ModelRow{.entry = 1}});
  home(12, 7001, IntentEnd::kHomed);
  commit({Intent(22, 7011, 3, {0, 0}, {5, 5})});
  commit({ModelRow{.entry = 2}});
  commit({IntentEndRow{{7011}, {3}, IntentEnd::kHomed}});  // it began before the model
  home(13, 7002, IntentEnd::kHomed);
  home(14, 7003, IntentEnd::kArrived);
  // Set by hand, found by the camera, corrected by it (no new count), bound first, replaced.
  const auto stands = [](std::uint32_t serial, Origin origin) {
    return test::Vector(serial, Witness::kReported, 5, 5, 1, origin);
  };
  commit({stands(7004, Origin::kOperator), stands(7005, Origin::kFound),
          stands(7006, Origin::kCamera), BindingRow{{18}, {7007}}, BindingRow{{19}, {7999}},
          BindingRow{{20}, {0}}, BindingRow{{20}, {7009}}});
  const auto since = [&](std::uint64_t change) {
    const auto found = OpenReader()->CountedAnewSince(change);
    EXPECT_TRUE(found) << found.error().text;
    std::vector<std::uint32_t> units;
    for (const UnitId unit : *found) units.push_back(unit.value);
    return units;
  };
  EXPECT_EQ(since(2), (std::vector<std::uint32_t>{13, 15, 16, 19, 22}));
  EXPECT_EQ(since(1), (std::vector<std::uint32_t>{12, 13, 15, 16, 19, 22}));
  EXPECT_EQ(OpenReader()->Bindings()->size(), 11u);
}

TEST_F(StoreTest, WithinABatchAHomingCountsWhereItEnds) {
  auto store = OpenStore();
  const auto begin = [&](std::uint32_t unit, std::uint32_t serial) {
    test::ExpectDone(store->Commit(
        std::vector<Row>{BindingRow{{unit}, {serial}}, Intent(unit, serial, 3, {0, 0}, {5, 5})},
        kEight));
  };
  begin(12, 7001);
  begin(13, 7002);
  test::ExpectDone(store->Commit(
      std::vector<Row>{IntentEndRow{{7001}, {3}, IntentEnd::kHomed}, ModelRow{.entry = 1},
                       IntentEndRow{{7002}, {3}, IntentEnd::kHomed}},
      kNine));
  EXPECT_EQ(OpenReader()->CountedAnewSince(1), std::vector<UnitId>{{13}});
}

TEST_F(StoreTest, ATuningIsKeptWithMarginAndOriginAndTheOneBeforeItToo) {
  auto store = OpenStore();
  test::ExpectDone(store->Commit(std::vector<Row>{Tuned(37, 0.5)}, kEight));
  test::ExpectDone(store->Commit(std::vector<Row>{Tuned(38, 0.25)}, kNine));
  const auto fleet = store->Load();
  ASSERT_TRUE(fleet) << fleet.error().text;
  ASSERT_EQ(fleet->tunings.size(), 1u);
  const TuningRow& now = fleet->tunings[0];
  EXPECT_EQ(now.serial.value, 7u);
  EXPECT_EQ(now.axis, Axis::kPhi);
  EXPECT_EQ(now.critical, 38);
  EXPECT_EQ(now.repeat, 54);
  EXPECT_EQ(now.margin, 0.25);
  EXPECT_EQ(now.load_uNm, 4.07);
  EXPECT_EQ(now.v_bus_V, 1.8);
  EXPECT_EQ(now.counter1, 500);
  EXPECT_EQ(now.subdivision, 96);
  EXPECT_EQ(now.mode, WaveMode::kSevenSegment);
  EXPECT_EQ(now.origin, Origin::kTuning);
  const auto history = OpenReader()->Tunings({7}, 10);
  ASSERT_TRUE(history) << history.error().text;
  ASSERT_EQ(history->size(), 2u);
  EXPECT_EQ((*history)[0].row.margin, 0.25);
  EXPECT_EQ((*history)[1].row.margin, 0.5);
  EXPECT_EQ((*history)[1].at, kEight);
  EXPECT_TRUE(OpenReader()->Tunings({8}, 10)->empty());
}

TEST_F(StoreTest, AnEndedIntentIsHistoryWithThePlaceItEndedAt) {
  auto store = OpenStore();
  test::ExpectDone(store->Commit(std::vector<Row>{Intent(4, 40, 1, {0, 0}, {10, 20})}, kEight));
  // The end stands before the vectors in the batch, and still has their place.
  test::ExpectDone(store->Commit(std::vector<Row>{IntentEndRow{{40}, {1}, IntentEnd::kArrived},
                                                  Vector(40, Witness::kReported, 10, 20)},
                                 kNine));
  test::ExpectDone(store->Commit(std::vector<Row>{Intent(4, 40, 2, {10, 20}, {0, 0})}, kNine));

  EXPECT_EQ(store->Load()->open_intents.size(), 1u);
  const auto moves = OpenReader()->Moves(UnitId{4}, 10);
  ASSERT_TRUE(moves) << moves.error().text;
  ASSERT_EQ(moves->size(), 2u);
  EXPECT_EQ((*moves)[0].move.value, 2);
  EXPECT_FALSE((*moves)[0].ended);
  EXPECT_EQ((*moves)[1].end, IntentEnd::kArrived);
  EXPECT_EQ((*moves)[1].began, kEight);
  EXPECT_EQ((*moves)[1].ended, kNine);
  EXPECT_EQ((*moves)[1].ended_at, Exactly(Witness::kReported, Pose{10, 20}));
  EXPECT_EQ((*moves)[1].hull[1].high, 20);
  EXPECT_TRUE(OpenReader()->Moves(UnitId{5}, 10)->empty());
  EXPECT_EQ(OpenReader()->Moves({}, 1)->size(), 1u);
}

TEST_F(StoreTest, AnIntentEndsOnceAndCanBeWrittenTwice) {
  auto store = OpenStore();
  const std::vector<Row> begin = {Intent(4, 40, 1, {0, 0}, {10, 20})};
  test::ExpectDone(store->Commit(begin, kEight));
  test::ExpectDone(store->Commit(begin, kEight));
  EXPECT_EQ(store->Load()->open_intents.size(), 1u);
  test::ExpectDone(
      store->Commit(std::vector<Row>{IntentEndRow{{40}, {1}, IntentEnd::kFault}}, kEight));
  test::ExpectDone(
      store->Commit(std::vector<Row>{IntentEndRow{{40}, {1}, IntentEnd::kArrived}}, kNine));
  const auto moves = OpenReader()->Moves({}, 10);
  ASSERT_EQ(moves->size(), 1u);
  EXPECT_EQ((*moves)[0].end, IntentEnd::kFault);
  EXPECT_FALSE((*moves)[0].ended_at);
}

TEST_F(StoreTest, ParametersAndPlacesKeepTheirHistory) {
  auto store = OpenStore();
  ParameterRow row{{7}, Axis::kTheta, Parameter::kRepeat, 108, Origin::kFactory};
  test::ExpectDone(store->Commit(std::vector<Row>{row}, kEight));
  test::ExpectDone(store->Commit(std::vector<Row>{row}, kNine));  // nothing new
  row.value = 37;
  row.origin = Origin::kTuning;
  test::ExpectDone(store->Commit(std::vector<Row>{row, EnableRow{{3}, false, "spare"}}, kNine));
  test::ExpectDone(store->Commit(std::vector<Row>{EnableRow{{3}, true, "mended"}}, kNine));

  const auto parameters = OpenReader()->Parameters({7}, 10);
  ASSERT_EQ(parameters->size(), 2u);
  EXPECT_EQ((*parameters)[0].row.value, 37);
  EXPECT_EQ((*parameters)[0].row.origin, Origin::kTuning);
  EXPECT_EQ((*parameters)[1].at, kEight);
  const auto units = OpenReader()->Units({}, 10);
  ASSERT_EQ(units->size(), 2u);
  EXPECT_EQ((*units)[0].reason, "mended");
  EXPECT_FALSE((*units)[1].enabled);
}

TEST_F(StoreTest, ConfigurationsAndAlarmsComeNewestFirst) {
  auto store = OpenStore();
  ConfigurationRow row;
  row.source = "a.csv";
  for (row.id = 1; row.id <= 3; ++row.id) {
    test::ExpectDone(store->Commit(
        std::vector<Row>{row, AlarmRow{row.id, Severity::kWarning, {}, BusId{2}, "x\0y"}}, kEight));
  }
  row.id = 3;
  row.state = ConfigurationState::kDone;
  row.makespan_s = std::nan("");
  test::ExpectDone(store->Commit(std::vector<Row>{row}, kNine));
  const auto configurations = OpenReader()->Configurations(2);
  ASSERT_EQ(configurations->size(), 2u);
  EXPECT_EQ((*configurations)[0].row.id, 3u);
  EXPECT_EQ((*configurations)[0].row.state, ConfigurationState::kDone);
  EXPECT_TRUE(std::isnan((*configurations)[0].row.makespan_s));
  EXPECT_EQ((*configurations)[0].began, kEight);
  EXPECT_EQ((*configurations)[0].changed, kNine);
  const auto alarms = OpenReader()->Alarms(10);
  ASSERT_EQ(alarms->size(), 3u);
  EXPECT_EQ((*alarms)[0].row.id, 3u);
  EXPECT_EQ((*alarms)[0].row.bus, BusId{2});
  EXPECT_FALSE((*alarms)[0].row.unit);
}

TEST_F(StoreTest, HistoryIsReadByPeriodAndState) {
  auto store = OpenStore();
  const std::vector<Row> first{
      ConfigurationRow{.id = 1, .source = "a.csv", .state = ConfigurationState::kDone},
      AlarmRow{1, Severity::kWarning, {}, BusId{2}, "x"}, EnableRow{{12}, false, "bent"},
      Intent(12, 7001, 13, {0, 0}, {1, 1}), IntentEndRow{{7001}, {13}, IntentEnd::kArrived}};
  const std::vector<Row> second{
      ConfigurationRow{.id = 2, .source = "b.csv", .state = ConfigurationState::kStopped},
      AlarmRow{2, Severity::kWarning, {}, BusId{2}, "y"}, EnableRow{{12}, true, "mended"},
      Intent(12, 7001, 14, {0, 0}, {1, 1}), IntentEndRow{{7001}, {14}, IntentEnd::kStopped}};
  test::ExpectDone(store->Commit(first, kEight));
  test::ExpectDone(store->Commit(second, kNine));
  auto reader = OpenReader();
  const Period late{.since = kNine};
  const Period early{.until = kNine};
  EXPECT_EQ(reader->Alarms(9, late)->at(0).row.id, 2u);
  EXPECT_EQ(reader->Alarms(9, early)->at(0).row.id, 1u);
  EXPECT_EQ(reader->Alarms(9, late)->size(), 1u);
  EXPECT_EQ(reader->Configurations(9, late)->at(0).row.id, 2u);
  EXPECT_EQ(reader->Configurations(9, {}, ConfigurationState::kDone)->at(0).row.id, 1u);
  EXPECT_TRUE(reader->Configurations(9, late, ConfigurationState::kDone)->empty());
  EXPECT_EQ(reader->Units(UnitId{12}, 9, early)->at(0).reason, "bent");
  EXPECT_EQ(reader->Units({}, 9, late)->size(), 1u);
  EXPECT_EQ(reader->Moves(UnitId{12}, 9, early)->at(0).move.value, 13);
  EXPECT_EQ(reader->Moves(UnitId{12}, 9, {}, IntentEnd::kStopped)->at(0).move.value, 14);
  EXPECT_EQ(reader->Moves({}, 9, late)->size(), 1u);
  EXPECT_EQ(reader->Moves(UnitId{12}, 9)->size(), 2u);
}

TEST_F(StoreTest, TheNewestTimeIsThatOfTheHistory) {
  auto store = OpenStore();
  EXPECT_EQ(store->Newest()->ns, 0);
  test::ExpectDone(
      store->Commit(std::vector<Row>{AlarmRow{1, Severity::kInfo, {}, {}, ""}}, kEight));
  EXPECT_EQ(store->Newest()->ns, kEight.ns);
  test::ExpectDone(store->Commit(std::vector<Row>{Intent(1, 1, 1, {0, 0}, {1, 1})}, kEight));
  test::ExpectDone(
      store->Commit(std::vector<Row>{IntentEndRow{{1}, {1}, IntentEnd::kArrived}}, kNine));
  EXPECT_EQ(store->Newest()->ns, kNine.ns);
}

TEST_F(StoreTest, GarbageInHistoryIsAnErrorToo) {
  test::ExpectDone(OpenStore()->Commit(std::vector<Row>{Intent(12, 7, 3, {0, 0}, {1, 1}),
                                                        IntentEndRow{{7}, {3}, IntentEnd::kArrived},
                                                        Vector(7, Witness::kReported, 1, 1),
                                                        AlarmRow{1, Severity::kInfo, {}, {}, ""}},
                                       kEight));
  Sql("UPDATE intent SET end = 77; UPDATE alarm SET severity = 3");
  auto reader = OpenReader();
  EXPECT_THAT(ErrorOf(reader->Moves({}, 9)).text, HasSubstr("end is 77"));
  EXPECT_THAT(ErrorOf(reader->Alarms(9)).text, HasSubstr("severity is 3"));
}

TEST_F(StoreTest, AMeasurementIsReadBackToTheBit) {
  MeasurementRow row{.exposure = 7,
                     .configuration = 3,
                     .serial = {7001},
                     .unit = {12},
                     .status = MeasurementStatus::kDidNotMove,
                     .other = UnitId{9},
                     .x_mm = 1.0 / 3,
                     .y_mm = -2e-7,
                     .covariance = {1e-5 / 3, -3e-6 / 7, 2e-5 / 3},
                     .place = Pose{-5, 8},
                     .target_fp = PointFp{0.1, 0.2},
                     .error_um = 12.3,
                     .target_id = "NGC 4565, \"needle\"",
                     .delay_s = 0.7};
  MeasurementRow bare{.exposure = 7,
                      .serial = {7002},
                      .unit = {13},
                      .other = {},
                      .place = {},
                      .target_fp = {},
                      .error_um = {},
                      .target_id = {},
                      .delay_s = {}};
  test::ExpectDone(OpenStore()->Commit(std::vector<Row>{row, bare}, {6}));
  const auto read = OpenReader()->Measurements(7);
  ASSERT_TRUE(read) << read.error().text;
  ASSERT_EQ(read->size(), 2u);
  const MeasurementRow& back = (*read)[0].row;
  EXPECT_EQ(back.covariance, row.covariance);
  EXPECT_EQ(back.target_id, row.target_id);
  EXPECT_EQ(back.delay_s, row.delay_s);
  EXPECT_EQ(back.x_mm, row.x_mm);
  EXPECT_EQ(back.place, row.place);
  EXPECT_EQ((*read)[1].row.target_id, "");
  EXPECT_FALSE((*read)[1].row.delay_s);
  EXPECT_FALSE(back.carrier);
  row.covariance.yy = -1;
  EXPECT_FALSE(OpenStore()->Commit(std::vector<Row>{row}, {6}));
}

TEST_F(StoreTest, AnOrientationIsReadBackToTheBitWithItsSource) {
  MeasurementRow row{.exposure = 8,
                     .serial = {7001},
                     .unit = {12},
                     .status = MeasurementStatus::kTooCoarse,
                     .other = {},
                     .place = {},
                     .target_fp = {},
                     .error_um = {},
                     .target_id = {},
                     .delay_s = {},
                     .source = MeasurementSource::kSensors};
  row.carrier = FibreCarrierReading{.angles_deg = {1.0 / 3, -20.0 / 7, 0.1},
                                    .covariance_deg2 = {1e-5 / 3, -1e-6, 2e-7, 3e-5 / 7, 0, 1e-4},
                                    .used = 0xf7,
                                    .solved = true,
                                    .trusted = true,
                                    .verdict = "missing v4"};
  MeasurementRow lying = row;
  lying.serial = {7002};
  lying.unit = {13};
  lying.status = MeasurementStatus::kSensorsDoubted;
  lying.carrier = FibreCarrierReading{.used = 0x7, .verdict = "too few sensors"};
  test::ExpectDone(OpenStore()->Commit(std::vector<Row>{row, lying}, {6}));
  const auto read = OpenReader()->Measurements(8);
  ASSERT_TRUE(read) << read.error().text;
  ASSERT_EQ(read->size(), 2u);
  EXPECT_EQ((*read)[0].row.source, MeasurementSource::kSensors);
  EXPECT_EQ((*read)[0].row.status, MeasurementStatus::kTooCoarse);
  EXPECT_EQ((*read)[0].row.carrier, row.carrier);
  EXPECT_EQ((*read)[1].row.carrier, lying.carrier);
  lying.carrier->trusted = true;
  EXPECT_FALSE(OpenStore()->Commit(std::vector<Row>{lying}, {6})) << "trusted, and there is none";
  row.carrier->covariance_deg2[3] = -1;
  EXPECT_FALSE(OpenStore()->Commit(std::vector<Row>{row}, {6}));
}

TEST_F(StoreTest, AReaderSeesWholeBatchesBesideTheWriter) {
  auto store = OpenStore();
  auto reader = OpenReader();
  for (std::uint32_t k = 1; k <= 50; ++k) {
    test::ExpectDone(store->Commit(test::Batch(k, 20), kEight));
    const auto fleet = reader->Load();
    ASSERT_TRUE(fleet) << fleet.error().text;
    EXPECT_EQ(test::BatchIn(*fleet, 20), k);
  }
  store.reset();
  EXPECT_EQ(test::BatchIn(*reader->Load(), 20), 50u);  // and after it
  EXPECT_EQ(test::BatchIn(*OpenReader()->Load(), 20), 50u);
}

}  // namespace
}  // namespace focalfleet
