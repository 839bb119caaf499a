#include "daemon/store/store.h"

#include <gmock/gmock.h>
#include <sys/wait.h>

#include <cmath>
#include <fstream>
#include <iterator>

#include "daemon/store/schema.h"
#include "tests/daemon/store/store_fixture.h"

namespace focalfleet {
namespace {

using test::Intent;
using test::StoreTest;
using test::Vector;
using ::testing::HasSubstr;

// The error of what should have failed; a success reads as one that no test expects.
template <class T>
Error ErrorOf(const Result<T>& result) {
  return result ? Error{static_cast<ErrorCode>(99), "success"} : result.error();
}

constexpr WallTime kEight{1'700'000'000'000'000'000};
constexpr WallTime kNine{1'700'003'600'000'000'000};

std::string Bytes(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

TEST(WallTime, PrintsIso8601InUtc) {
  EXPECT_EQ(ToIso8601(kEight), "2023-11-14T22:13:20.000Z");
  EXPECT_EQ(ToIso8601({0}), "1970-01-01T00:00:00.000Z");
  EXPECT_EQ(ToIso8601({-1'000'000}), "1969-12-31T23:59:59.999Z");
}

TEST_F(StoreTest, NewStoreIsEmpty) {
  auto store = OpenStore();
  const auto fleet = store->Load();
  ASSERT_TRUE(fleet) << fleet.error().text;
  EXPECT_TRUE(fleet->units.empty());
  EXPECT_TRUE(fleet->vectors.empty());
  EXPECT_TRUE(fleet->open_intents.empty());
  EXPECT_EQ(fleet->next_move.value, 1);
  EXPECT_EQ(fleet->next_configuration, 1u);
  EXPECT_EQ(fleet->next_alarm, 1u);
}

TEST_F(StoreTest, LoadGivesBackWhatWasCommitted) {
  VectorRow half_known = Vector(7001, Witness::kMeasured, -1, 96, 12, Origin::kCampaign);
  half_known.knowledge[1] = {Witness::kInterval, -500, 700};
  half_known.subdivision = {96, 64};
  const VectorRow unknown{{7002}, {}, {}, {}, {}, Origin::kFactory};
  const IntentRow intent = Intent(12, 7001, 13, {5, -6}, {-7, 8});
  const std::vector<Row> rows = {
      BindingRow{{12}, {7001}},
      EnableRow{{13}, false, "arm bent"},
      half_known,
      unknown,
      intent,
      ParameterRow{{7001}, Axis::kPhi, Parameter::kRepeat, 37, Origin::kTuning},
      NextMoveRow{{14}},
      ConfigurationRow{5, "night.csv", ConfigurationState::kMoving, 5000, 3, 2, 1, 22.5,
                       std::nan(""), 1.25, 9.0},
      AlarmRow{9, Severity::kError, UnitId{12}, BusId{3}, "over_temperature"}};
  test::ExpectDone(OpenStore()->Commit(rows, kEight));

  const auto fleet = OpenStore()->Load();
  ASSERT_TRUE(fleet) << fleet.error().text;
  ASSERT_EQ(fleet->units.size(), 2u);
  EXPECT_EQ(fleet->units[0].serial.value, 7001u);
  EXPECT_TRUE(fleet->units[0].enabled);
  EXPECT_EQ(fleet->units[1].unit.value, 13u);
  EXPECT_FALSE(fleet->units[1].enabled);
  EXPECT_EQ(fleet->units[1].reason, "arm bent");
  ASSERT_EQ(fleet->vectors.size(), 2u);
  EXPECT_EQ(fleet->vectors[0].knowledge, half_known.knowledge);
  EXPECT_EQ(fleet->vectors[0].subdivision, half_known.subdivision);
  EXPECT_EQ(fleet->vectors[0].move.value, 12);
  EXPECT_EQ(fleet->vectors[0].origin, Origin::kCampaign);
  EXPECT_EQ(fleet->vectors[1].knowledge[0].witness, Witness::kUnknown);
  ASSERT_EQ(fleet->open_intents.size(), 1u);
  EXPECT_EQ(fleet->open_intents[0].from, intent.from);
  EXPECT_EQ(fleet->open_intents[0].to, intent.to);
  EXPECT_EQ(fleet->open_intents[0].hull, intent.hull);
  EXPECT_EQ(fleet->open_intents[0].unit.value, 12u);
  ASSERT_EQ(fleet->parameters.size(), 1u);
  EXPECT_EQ(fleet->parameters[0].value, 37);
  EXPECT_EQ(fleet->next_move.value, 14);
  EXPECT_EQ(fleet->next_configuration, 6u);
  EXPECT_EQ(fleet->next_alarm, 10u);
}

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
  // What could not be read back is not written.
  EXPECT_FALSE(store->Commit(std::vector<Row>{ModelRow{.entry = 0}}, kNine));
  ModelRow later = back;
  later.entry = 4;
  later.restores = 4;
  EXPECT_FALSE(store->Commit(std::vector<Row>{later}, kNine));
  EXPECT_EQ(OpenReader()->Models(10)->size(), 3u);
}

TEST_F(StoreTest, TellsWhoseCountBeganAnewSince) {
  auto store = OpenStore();
  const auto home = [&](std::uint32_t unit, std::uint32_t serial, IntentEnd end, WallTime at) {
    test::ExpectDone(store->Commit(
        std::vector<Row>{Intent(unit, serial, 3, {0, 0}, {5, 5}), IntentEndRow{{serial}, {3}, end}},
        at));
  };
  home(12, 7001, IntentEnd::kHomed, kEight);
  home(13, 7002, IntentEnd::kHomed, kNine);
  home(14, 7003, IntentEnd::kArrived, kNine);
  // Set by hand, found by the camera, corrected by it (no new count), bound first, replaced.
  const auto stands = [](std::uint32_t serial, Origin origin) {
    return test::Vector(serial, Witness::kReported, 5, 5, 1, origin);
  };
  test::ExpectDone(store->Commit(
      std::vector<Row>{BindingRow{{15}, {7004}}, BindingRow{{16}, {7005}}, BindingRow{{17}, {7006}},
                       BindingRow{{19}, {7008}}, BindingRow{{20}, {7009}}},
      kEight));
  test::ExpectDone(store->Commit(
      std::vector<Row>{stands(7004, Origin::kOperator), stands(7005, Origin::kFound),
                       stands(7006, Origin::kCamera), BindingRow{{18}, {7007}},
                       BindingRow{{19}, {7999}}, BindingRow{{20}, {0}}, BindingRow{{20}, {7009}}},
      kNine));
  const auto since = OpenReader()->CountedAnewSince(kEight);
  ASSERT_TRUE(since) << since.error().text;
  std::vector<std::uint32_t> units;
  for (const UnitId unit : *since) units.push_back(unit.value);
  EXPECT_EQ(units, (std::vector<std::uint32_t>{13, 15, 16, 19}));
  const auto bound = OpenReader()->Bindings();
  ASSERT_TRUE(bound) << bound.error().text;
  EXPECT_EQ(bound->size(), 6u);
}

TuningRow Tuned(std::uint16_t critical, double margin) {
  return {.serial = {7},
          .axis = Axis::kPhi,
          .critical = critical,
          .repeat = 54,
          .margin = margin,
          .load_uNm = 4.07,
          .v_bus_V = 1.8,
          .counter1 = 500,
          .subdivision = 96,
          .mode = WaveMode::kSevenSegment};
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

TEST_F(StoreTest, VectorAndTurnsAreThePositionByTheSubdivision) {
  auto store = OpenStore();
  test::ExpectDone(store->Commit(std::vector<Row>{Vector(1, Witness::kReported, -1, 193)}, kEight));
  Sql("CREATE TEMP TABLE t(ok INTEGER CHECK(ok)); INSERT INTO t SELECT vector = 95 AND turns = -1 "
      "FROM axis_state WHERE axis = 0; INSERT INTO t SELECT vector = 1 AND turns = 2 FROM "
      "axis_state "
      "WHERE axis = 1;");
}

TEST_F(StoreTest, AnEndedIntentIsHistoryWithThePlaceItEndedAt) {
  auto store = OpenStore();
  test::ExpectDone(store->Commit(std::vector<Row>{Intent(4, 40, 1, {0, 0}, {10, 20})}, kEight));
  // The end stands before the vectors in the batch, and still tells where they are.
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

TEST_F(StoreTest, ASerialNumberSitsAtOnePlace) {
  auto store = OpenStore();
  test::ExpectDone(
      store->Commit(std::vector<Row>{BindingRow{{1}, {11}}, BindingRow{{2}, {22}}}, kEight));
  test::ExpectDone(
      store->Commit(std::vector<Row>{BindingRow{{1}, {22}}, BindingRow{{2}, {11}}}, kNine));
  const auto units = store->Load()->units;
  ASSERT_EQ(units.size(), 2u);
  EXPECT_EQ(units[0].serial.value, 22u);
  EXPECT_EQ(units[1].serial.value, 11u);
  const auto history = OpenReader()->Units(UnitId{2}, 10);
  ASSERT_EQ(history->size(), 3u);  // bound, taken away, bound
  EXPECT_EQ((*history)[0].serial.value, 11u);
  EXPECT_EQ((*history)[1].serial.value, 0u);
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

TEST_F(StoreTest, PruneTakesOldHistoryAndNoNextIds) {
  auto store = OpenStore();
  test::ExpectDone(store->Commit(
      std::vector<Row>{Intent(1, 1, 1, {0, 0}, {1, 1}), Intent(2, 2, 1, {0, 0}, {1, 1}),
                       IntentEndRow{{1}, {1}, IntentEnd::kArrived},
                       ConfigurationRow{.id = 8, .source = "", .state = ConfigurationState::kDone},
                       AlarmRow{9, Severity::kInfo, {}, {}, ""}},
      kEight));
  EXPECT_EQ(store->Prune(kEight, 100), 0u);
  EXPECT_EQ(store->Prune(kNine, 100), 3u);
  const auto fleet = store->Load();
  EXPECT_EQ(fleet->open_intents.size(), 1u);
  EXPECT_EQ(fleet->next_configuration, 9u);
  EXPECT_EQ(fleet->next_alarm, 10u);
}

TEST_F(StoreTest, ARowThatCouldNotBeReadBackIsNotWritten) {
  auto store = OpenStore();
  VectorRow two_places = Vector(1, Witness::kReported, 5, 5);
  two_places.knowledge[0].high = 6;
  VectorRow turned = Vector(1, Witness::kInterval, 5, 5);
  turned.knowledge[1] = {Witness::kInterval, 3, 2};
  VectorRow no_witness = Vector(1, static_cast<Witness>(5), 5, 5);
  IntentRow turned_hull = Intent(1, 1, 1, {0, 0}, {1, 1});
  turned_hull.hull[0] = {Witness::kInterval, 3, 2};
  const std::vector<Row> wrong = {
      two_places,
      turned,
      no_witness,
      turned_hull,
      Vector(0, Witness::kReported, 5, 5),
      Vector(1, Witness::kReported, 5, 5, 1, static_cast<Origin>(9)),
      IntentEndRow{{1}, {1}, static_cast<IntentEnd>(6)},
      ParameterRow{{1}, Axis::kTheta, static_cast<Parameter>(kParameterCount), 1, Origin::kTuning},
      Tuned(0, 0.5),   // no n at all
      Tuned(55, 0.5),  // chosen below what starts the load
      Tuned(37, std::nan("")),
      ConfigurationRow{.id = 1, .source = "", .state = static_cast<ConfigurationState>(6)},
      AlarmRow{1, static_cast<Severity>(3), {}, {}, ""},
      AlarmRow{UINT64_MAX, Severity::kInfo, {}, {}, ""}};
  for (const Row& row : wrong) {
    const Status status =
        store->Commit(std::vector<Row>{Vector(77, Witness::kReported, 1, 1), row}, kEight);
    ASSERT_FALSE(status);
    EXPECT_EQ(status.error().code, ErrorCode::kInvalid);
  }
  EXPECT_TRUE(store->Load()->vectors.empty());  // not even the good rows beside them
  EXPECT_EQ(store->counters().failed, std::size(wrong));
  test::ExpectDone(store->Commit(std::vector<Row>{Vector(77, Witness::kReported, 1, 1)}, kEight));
  EXPECT_EQ(store->Load()->vectors.size(), 1u);
}

struct Garbage {
  const char* sql;
  const char* reported;
};

class StoreGarbage : public StoreTest, public ::testing::WithParamInterface<Garbage> {};

TEST_P(StoreGarbage, IsAnErrorThatNamesTableAndRow) {
  test::ExpectDone(OpenStore()->Commit(
      std::vector<Row>{BindingRow{{12}, {7}}, Vector(7, Witness::kReported, 10, 20),
                       Intent(12, 7, 3, {0, 0}, {1, 1}),
                       ParameterRow{{7}, Axis::kPhi, Parameter::kRepeat, 37, Origin::kTuning},
                       Tuned(37, 0.5), NextMoveRow{{4}}},
      kEight));
  Sql(GetParam().sql);
  auto store = OpenStore();
  const auto fleet = store->Load();
  ASSERT_FALSE(fleet);
  EXPECT_EQ(fleet.error().code, ErrorCode::kInvalid);
  EXPECT_THAT(fleet.error().text, HasSubstr(GetParam().reported));
  // The store is not stuck in the read.
  test::ExpectDone(store->Commit(std::vector<Row>{Vector(8, Witness::kReported, 1, 1)}, kEight));
}

INSTANTIATE_TEST_SUITE_P(
    Rows, StoreGarbage,
    ::testing::Values(
        Garbage{"UPDATE axis_state SET witness = 9 WHERE axis = 1",
                "axis_state, row serial 7, axis 1: witness is 9, not in 0..4"},
        Garbage{"UPDATE axis_state SET low = 9 WHERE axis = 0", "row serial 7, axis 0"},
        Garbage{"UPDATE axis_state SET low = 11, high = 11 WHERE axis = 0",
                "vector and turns disagree with low"},
        Garbage{"UPDATE axis_state SET low = 99999999999, high = 99999999999",
                "low is 99999999999"},
        Garbage{"UPDATE axis_state SET vector = NULL", "vector and turns do not belong"},
        Garbage{"UPDATE axis_state SET vector = 96", "vector is 96"},
        Garbage{"UPDATE axis_state SET subdivision = 70000", "subdivision is 70000"},
        Garbage{"UPDATE axis_state SET origin = 9", "origin is 9"},
        Garbage{"UPDATE axis_state SET move = 65536", "move is 65536"},
        Garbage{"UPDATE axis_state SET axis = 2 WHERE axis = 1", "axis is 2"},
        Garbage{"UPDATE axis_state SET move = 7 WHERE axis = 1", "of different moves"},
        Garbage{"DELETE FROM axis_state WHERE axis = 1", "no phi"},
        Garbage{"DELETE FROM axis_state WHERE axis = 0", "no theta"},
        Garbage{"UPDATE unit SET serial = -1", "unit, row unit_id 12: serial is -1"},
        Garbage{"UPDATE unit SET enabled = 2", "enabled is 2"},
        Garbage{"UPDATE unit SET unit_id = 4294967296", "unit_id is 4294967296"},
        Garbage{"UPDATE intent SET theta_low = 5", "intent, row entry 1: low is above high"},
        Garbage{"UPDATE intent SET serial = 0", "serial is 0"},
        Garbage{"UPDATE intent SET configuration = -3", "configuration is -3"},
        Garbage{"UPDATE parameter SET parameter = 9", "parameter is 9"},
        Garbage{"UPDATE parameter SET value = 2147483648", "value is 2147483648"},
        Garbage{"UPDATE tuning SET critical = 55", "tuning, row serial 7, axis 1: its n are not"},
        Garbage{"UPDATE tuning SET load_uNm = 0", "load"},
        Garbage{"UPDATE tuning SET mode = 3", "mode is 3"},
        Garbage{"UPDATE tuning SET origin = 9", "origin is 9"},
        Garbage{"UPDATE meta SET value = 65536 WHERE key = 'next_move'", "value is 65536"},
        Garbage{"INSERT INTO meta VALUES('next_mood', 1)", "next_mood: nobody reads"}));

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

TEST_F(StoreTest, AnOrientationIsReadBackToTheBitWithWhoeverMeasured) {
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

TEST_F(StoreTest, ASecondWriterIsRefusedAndTheFirstNamed) {
  auto store = OpenStore();
  const auto second = Store::Open(Path());
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::kRefused);
  EXPECT_THAT(second.error().text, HasSubstr("process " + std::to_string(getpid())));
  // By another name of the same file, too.
  std::filesystem::create_symlink(Path(), folder_ / "link.db");
  EXPECT_EQ(ErrorOf(Store::Open(folder_ / "link.db")).code, ErrorCode::kRefused);
  test::ExpectDone(store->Commit(std::vector<Row>{Vector(1, Witness::kReported, 1, 1)}, kEight));
  store.reset();
  EXPECT_EQ(OpenStore()->Load()->vectors.size(), 1u);
}

TEST_F(StoreTest, TheLockEndsWithItsProcess) {
  int ready[2];
  int hold[2];
  char end = 0;
  ASSERT_EQ(pipe(ready), 0);
  ASSERT_EQ(pipe(hold), 0);
  const pid_t child = fork();
  if (child == 0) {
    auto store = Store::Open(Path());
    const char word = store ? 'y' : 'n';
    close(hold[1]);
    // Ends with its parent at the latest.
    _exit(write(ready[1], &word, 1) == 1 && read(hold[0], &end, 1) == 0 ? 0 : 1);
  }
  char word = 0;
  ASSERT_EQ(read(ready[0], &word, 1), 1);
  EXPECT_EQ(word, 'y');
  EXPECT_THAT(ErrorOf(Store::Open(Path())).text, HasSubstr("process " + std::to_string(child)));
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  EXPECT_TRUE(Store::Open(Path()));
  for (const int descriptor : {ready[0], ready[1], hold[0], hold[1]}) close(descriptor);
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

TEST_F(StoreTest, ANewerStoreIsLeftAsItIs) {
  test::ExpectDone(OpenStore()->Commit(test::Batch(1, 3), kEight));
  Sql("PRAGMA user_version = 99");
  const std::string before = Bytes(Path());
  const auto store = Store::Open(Path());
  ASSERT_FALSE(store);
  EXPECT_EQ(store.error().code, ErrorCode::kNewer);
  EXPECT_THAT(store.error().text, HasSubstr("version 99"));
  EXPECT_EQ(Bytes(Path()), before);
  EXPECT_FALSE(std::filesystem::exists(Path() + "-wal"));
  EXPECT_EQ(ErrorOf(StoreReader::Open(Path())).code, ErrorCode::kNewer);
  EXPECT_EQ(Bytes(Path()), before);
}

TEST_F(StoreTest, ANewerStoreIsSeenInItsWalToo) {
  test::ExpectDone(OpenStore()->Commit(test::Batch(1, 3), kEight));
  // A later version that was killed before its WAL reached the file.
  const pid_t child = fork();
  if (child == 0) {
    sqlite3* db = nullptr;
    sqlite3_open(Path().c_str(), &db);
    sqlite3_exec(db, "PRAGMA user_version = 99", nullptr, nullptr, nullptr);
    _exit(0);
  }
  waitpid(child, nullptr, 0);
  const std::string before = Bytes(Path());
  const std::string wal = Bytes(Path() + "-wal");
  ASSERT_FALSE(wal.empty());
  EXPECT_EQ(ErrorOf(Store::Open(Path())).code, ErrorCode::kNewer);
  EXPECT_EQ(Bytes(Path()), before);
  EXPECT_EQ(Bytes(Path() + "-wal"), wal);
}

TEST_F(StoreTest, WhatIsNoStoreIsRefusedAndLeftAlone) {
  for (const std::string& content : {std::string("unit_id,x_mm\n1,2\n"),
                                     std::string("SQLite format 3"), std::string(5000, '\xff')}) {
    std::ofstream(Path(), std::ios::binary) << content;
    const auto store = Store::Open(Path());
    ASSERT_FALSE(store);
    EXPECT_EQ(store.error().code, ErrorCode::kInvalid);
    EXPECT_THAT(store.error().text, HasSubstr("not a store"));
    EXPECT_EQ(Bytes(Path()), content);
  }
  std::filesystem::remove(Path());
  Sql("CREATE TABLE foreign_table(x)");
  const std::string before = Bytes(Path());
  EXPECT_THAT(ErrorOf(Store::Open(Path())).text, HasSubstr("not a store"));
  EXPECT_EQ(Bytes(Path()), before);
}

TEST_F(StoreTest, AnEmptyFileBecomesAStore) {
  std::ofstream(Path()).close();
  EXPECT_TRUE(OpenStore()->Load());
}

TEST_F(StoreTest, DamagedPagesAreAnError) {
  test::ExpectDone(OpenStore()->Commit(test::Batch(1, 200), kEight));
  std::string content = Bytes(Path());
  for (std::size_t i = 4096; i < content.size(); ++i) content[i] = static_cast<char>(i * 37);
  std::ofstream(Path(), std::ios::binary) << content;
  const auto store = Store::Open(Path());
  if (store) {
    EXPECT_FALSE((*store)->Load());
  } else {
    EXPECT_EQ(store.error().code, ErrorCode::kInvalid);
  }
}

TEST_F(StoreTest, ADamagedTableIsNoFaultOfTheRow) {
  const std::vector<Row> rows = {AlarmRow{.id = 1, .text = "the first"}};
  test::ExpectDone(OpenStore()->Commit(rows, kEight));
  sqlite3* db = nullptr;
  ASSERT_EQ(sqlite3_open(Path().c_str(), &db), SQLITE_OK);
  const auto number = [&](const char* sql) {
    sqlite3_stmt* statement = nullptr;
    EXPECT_EQ(sqlite3_prepare_v2(db, sql, -1, &statement, nullptr), SQLITE_OK);
    EXPECT_EQ(sqlite3_step(statement), SQLITE_ROW);
    const std::int64_t value = sqlite3_column_int64(statement, 0);
    sqlite3_finalize(statement);
    return value;
  };
  const std::int64_t page = number("SELECT rootpage FROM sqlite_master WHERE name = 'alarm'");
  const std::int64_t page_bytes = number("PRAGMA page_size");
  sqlite3_close(db);
  std::fstream file(Path(), std::ios::binary | std::ios::in | std::ios::out);
  file.seekp((page - 1) * page_bytes);
  file << std::string(static_cast<std::size_t>(page_bytes), '\xa5');
  file.close();
  const auto store = OpenStore();
  ASSERT_TRUE(store);
  const std::vector<Row> next = {AlarmRow{.id = 2, .text = "the second"}};
  EXPECT_EQ(ErrorOf(store->Commit(next, kEight)).code, ErrorCode::kUnavailable);
}

TEST_F(StoreTest, AMissingFolderIsUnavailable) {
  EXPECT_EQ(ErrorOf(Store::Open(folder_ / "none/fleet.db")).code, ErrorCode::kUnavailable);
  EXPECT_EQ(ErrorOf(StoreReader::Open(folder_ / "none.db")).code, ErrorCode::kUnavailable);
}

TEST_F(StoreTest, AnEmptyBatchIsNoTransaction) {
  auto store = OpenStore();
  test::ExpectDone(store->Commit({}, kEight));
  EXPECT_EQ(store->counters().transactions, 0u);
}

}  // namespace
}  // namespace focalfleet
