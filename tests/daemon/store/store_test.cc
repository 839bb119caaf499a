#include "daemon/store/store.h"

#include <gmock/gmock.h>

#include <cmath>
#include <iterator>

#include "tests/daemon/store/store_fixture.h"

namespace focalfleet {
namespace {

using test::Intent;
using test::kEight;
using test::kNine;
using test::StoreTest;
using test::Tuned;
using test::Vector;
using ::testing::HasSubstr;

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

TEST_F(StoreTest, AlarmsKeepTheirNamesAndStayOpenUntilTheyAreOver) {
  const OpenAlarmRow open{.id = 9,
                          .name = AlarmName::kUnitSilent,
                          .severity = Severity::kError,
                          .unit = UnitId{12},
                          .text = "unit 12 does not answer",
                          .count = 3,
                          .state = OpenAlarmRow::State::kAcknowledged,
                          .first_unix_ns = 5,
                          .last_unix_ns = 7,
                          .acknowledged_unix_ns = 8,
                          .acknowledged_by = "uid 7"};
  const MuteRow mute{.name = AlarmName::kBusDown,
                     .until_unix_ns = 90,
                     .since_unix_ns = 80,
                     .reason = "repair",
                     .by = "uid 7"};
  const AlarmRow alarm{9, Severity::kError, UnitId{12}, {}, "silent", AlarmName::kUnitSilent};
  test::ExpectDone(OpenStore()->Commit(
      std::vector<Row>{alarm, open, mute, AlarmEndRow{AlarmName::kBusDown, {}, BusId{1}}}, kEight));
  auto fleet = OpenStore()->Load();
  ASSERT_TRUE(fleet) << fleet.error().text;
  EXPECT_EQ(fleet->open_alarms, std::vector{open});
  EXPECT_EQ(fleet->mutes, std::vector{mute});
  EXPECT_EQ(OpenReader()->Alarms(9)->at(0).row.name, AlarmName::kUnitSilent);
  EXPECT_TRUE(OpenReader()->EarlierAlarms(9)->empty());
  OpenAlarmRow over = open;
  over.state = OpenAlarmRow::State::kOver;
  over.ended_unix_ns = 11;
  MuteRow ended = mute;
  ended.until_unix_ns = 0;
  test::ExpectDone(OpenStore()->Commit(std::vector<Row>{over, ended}, kNine));
  fleet = OpenStore()->Load();
  EXPECT_TRUE(fleet->open_alarms.empty());
  EXPECT_EQ(fleet->mutes, std::vector{ended});
  EXPECT_EQ(*OpenReader()->EarlierAlarms(9), std::vector{over});
  EXPECT_TRUE(OpenReader()->EarlierAlarms(9, {.since = {8}})->empty());
  Sql("UPDATE mute SET name = 'UnitQuiet'");
  fleet = OpenStore()->Load();
  ASSERT_TRUE(fleet) << fleet.error().text << ": the name may be a later version's";
  EXPECT_EQ(fleet->mutes.at(0).name, AlarmName::kUnnamed);
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
      ConfigurationRow{5,
                       "night.csv",
                       ConfigurationState::kMoving,
                       {5000, 3, 2, 1},
                       22.5,
                       std::nan(""),
                       1.25,
                       9.0},
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

TEST_F(StoreTest, VectorAndTurnsAreThePositionByTheSubdivision) {
  auto store = OpenStore();
  test::ExpectDone(store->Commit(std::vector<Row>{Vector(1, Witness::kReported, -1, 193)}, kEight));
  Sql("CREATE TEMP TABLE t(ok INTEGER CHECK(ok)); INSERT INTO t SELECT vector = 95 AND turns = -1 "
      "FROM axis_state WHERE axis = 0; INSERT INTO t SELECT vector = 1 AND turns = 2 FROM "
      "axis_state "
      "WHERE axis = 1;");
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
      Tuned(55, 0.5),  // chosen n below the critical one
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
  // The store can still write after the failed read.
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
        Garbage{"INSERT INTO meta(key, value) VALUES('next_mood', 1)", "next_mood: nobody reads"}));

TEST_F(StoreTest, AnEmptyBatchIsNoTransaction) {
  auto store = OpenStore();
  test::ExpectDone(store->Commit({}, kEight));
  EXPECT_EQ(store->counters().transactions, 0u);
}

}  // namespace
}  // namespace focalfleet
