#include "daemon/verbs/alarm_register.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <variant>

#include "daemon/verbs/alarm_requests.h"

namespace focalfleet {
namespace {

using State = OpenAlarmRow::State;

constexpr WallTime kNow{1'700'000'000'000'000'000};
constexpr WallTime Later(std::int64_t seconds) { return {kNow.ns + seconds * 1'000'000'000}; }

AlarmRow Alarm(std::uint64_t id, AlarmName name, std::optional<UnitId> unit = {},
               std::optional<BusId> bus = {}) {
  return {.id = id,
          .severity = KindOf(name).severity,
          .unit = unit,
          .bus = bus,
          .text = "text " + std::to_string(id),
          .name = name};
}

std::vector<Row> Taken(AlarmRegister* alarms, std::vector<Row> rows, WallTime now = kNow) {
  const std::size_t before = rows.size();
  alarms->Take(now, &rows);
  return {rows.begin() + static_cast<std::ptrdiff_t>(before), rows.end()};
}

TEST(AlarmRegister, EqualAlarmsAreOneWithACount) {
  AlarmRegister alarms;
  Taken(&alarms,
        {Alarm(1, AlarmName::kBusDown, {}, BusId{3}), Alarm(2, AlarmName::kBusDown, {}, BusId{4})});
  const auto rows = Taken(&alarms, {Alarm(3, AlarmName::kBusDown, {}, BusId{3})}, Later(5));
  ASSERT_EQ(rows.size(), 1u);
  const auto& row = std::get<OpenAlarmRow>(rows[0]);
  EXPECT_EQ(row.id, 1u) << "of the first";
  EXPECT_EQ(row.count, 2u);
  EXPECT_EQ(row.text, "text 3") << "of the newest";
  EXPECT_EQ(row.first_unix_ns, kNow.ns);
  EXPECT_EQ(row.last_unix_ns, Later(5).ns);
  EXPECT_EQ(alarms.Lasting().size(), 2u);
  EXPECT_EQ(alarms.Count(kNow).open, 2u);
  EXPECT_EQ(alarms.Count(kNow).worst, Severity::kError);
}

TEST(AlarmRegister, AnAlarmIsOpenUntilItsConditionEnds) {
  AlarmRegister alarms;
  Taken(&alarms, {Alarm(1, AlarmName::kUnitSilent, UnitId{7})});
  EXPECT_TRUE(Taken(&alarms, {AlarmEndRow{AlarmName::kUnitSilent, UnitId{8}, {}}}).empty());
  EXPECT_EQ(alarms.Count(kNow).open, 1u) << "another unit answers";
  const auto rows = Taken(&alarms, {AlarmEndRow{AlarmName::kUnitSilent, UnitId{7}, {}}}, Later(9));
  ASSERT_EQ(rows.size(), 1u);
  EXPECT_EQ(std::get<OpenAlarmRow>(rows[0]).state, State::kOver);
  EXPECT_EQ(std::get<OpenAlarmRow>(rows[0]).ended_unix_ns, Later(9).ns);
  EXPECT_TRUE(alarms.Lasting().empty());
}

TEST(AlarmRegister, ANoteIsNeverOpen) {
  AlarmRegister alarms;
  EXPECT_TRUE(Taken(&alarms, {Alarm(1, AlarmName::kBusUp, {}, BusId{3})}).empty());
  EXPECT_TRUE(alarms.Lasting().empty());
}

TEST(AlarmRegister, AnAcknowledgedEventIsOverAndAnAcknowledgedConditionLasts) {
  AlarmRegister alarms;
  Taken(&alarms, {Alarm(1, AlarmName::kUnitNeverBegan, UnitId{7}),
                  Alarm(2, AlarmName::kUnitSilent, UnitId{8})});
  const auto rows = alarms.Acknowledge({1}, {"UnitSilent"}, "uid 7", Later(3));
  ASSERT_TRUE(rows) << rows.error().text;
  ASSERT_EQ(rows->size(), 2u);
  EXPECT_EQ(std::get<OpenAlarmRow>((*rows)[0]).state, State::kOver);
  EXPECT_EQ(std::get<OpenAlarmRow>((*rows)[0]).acknowledged_by, "uid 7");
  EXPECT_EQ(std::get<OpenAlarmRow>((*rows)[1]).state, State::kAcknowledged);
  EXPECT_EQ(alarms.Count(kNow).open, 0u);
  Taken(&alarms, {Alarm(3, AlarmName::kUnitSilent, UnitId{8})});
  EXPECT_EQ(alarms.Count(kNow).open, 0u) << "somebody knows of it";
  Taken(&alarms, {Alarm(4, AlarmName::kUnitNeverBegan, UnitId{7})});
  EXPECT_EQ(alarms.Count(kNow).open, 1u) << "it happened again";
  Taken(&alarms, {AlarmEndRow{AlarmName::kUnitSilent, UnitId{8}, {}}});
  Taken(&alarms, {Alarm(5, AlarmName::kUnitSilent, UnitId{8})});
  EXPECT_EQ(alarms.Count(kNow).open, 2u) << "silent anew";
}

TEST(AlarmRegister, OnlyWhatIsOpenCanBeAcknowledged) {
  AlarmRegister alarms;
  Taken(&alarms, {Alarm(1, AlarmName::kUnitSilent, UnitId{7})});
  for (const auto& [ids, names] :
       {std::pair<std::vector<std::uint64_t>, std::vector<std::string>>{{2}, {}},
        {{1}, {"BusDown"}},
        {{}, {"busdown"}},
        {{}, {"unnamed"}},
        {{}, {}}}) {
    EXPECT_EQ(alarms.Acknowledge(ids, names, "", kNow).error().code, ErrorCode::kInvalid);
    EXPECT_EQ(alarms.Count(kNow).open, 1u) << "nothing has changed";
  }
}

TEST(AlarmRegister, AMuteEndsByItself) {
  AlarmRegister alarms;
  Taken(&alarms,
        {Alarm(1, AlarmName::kUnitSilent, UnitId{7}), Alarm(2, AlarmName::kBusDown, {}, BusId{3})});
  const auto rows = alarms.Mute("UnitSilent", Later(60), "repair", "uid 7", kNow);
  ASSERT_TRUE(rows);
  EXPECT_EQ(std::get<MuteRow>(rows->front()).until_unix_ns, Later(60).ns);
  EXPECT_EQ(alarms.Count(Later(59)).open, 1u);
  EXPECT_EQ(alarms.Count(Later(59)).muted, 1u);
  EXPECT_EQ(alarms.Mutes(Later(59)).size(), 1u);
  EXPECT_EQ(alarms.Count(Later(60)).open, 2u);
  EXPECT_TRUE(alarms.Mutes(Later(60)).empty());
  const auto more = Taken(&alarms, {Alarm(3, AlarmName::kUnitSilent, UnitId{9})}, Later(1));
  EXPECT_EQ(more.size(), 1u) << "muted alarms are stored as ever";
  EXPECT_TRUE(alarms.Unmute("UnitSilent", "", Later(2)));
  EXPECT_EQ(alarms.Count(Later(2)).muted, 0u);
  EXPECT_EQ(alarms.Unmute("UnitSilent", "", Later(2)).error().code, ErrorCode::kRefused);
}

TEST(AlarmRegister, WhatBeginsAfterAMuteIsMutedAndCounted) {
  AlarmRegister alarms;
  Taken(&alarms, {Alarm(1, AlarmName::kUnitSilent, UnitId{7})});
  ASSERT_TRUE(alarms.Mute("UnitSilent", Later(60), "repair", "uid 7", Later(1)));
  Taken(&alarms,
        {Alarm(2, AlarmName::kUnitSilent, UnitId{7}), Alarm(3, AlarmName::kUnitSilent, UnitId{9}),
         Alarm(4, AlarmName::kBusDown, {}, BusId{3})},
        Later(2));
  const auto reading = AskAlarms({.verb = "alarms"}, alarms, Later(3));
  ASSERT_TRUE(reading);
  const auto answer = (*reading)(nullptr);
  ASSERT_TRUE(answer);
  ASSERT_EQ((*answer)["mutes"].size(), 1u);
  EXPECT_EQ((*answer)["mutes"][0]["open"], 2);
  EXPECT_EQ((*answer)["mutes"][0]["open_since"], 1) << "unit 9; unit 7 stood then";
}

TEST(AlarmRegister, AMuteWantsANameAnEndAndAReason) {
  AlarmRegister alarms;
  EXPECT_FALSE(alarms.Mute("UnitQuiet", Later(60), "repair", "", kNow));
  EXPECT_FALSE(alarms.Mute("UnitSilent", kNow, "repair", "", kNow));
  EXPECT_FALSE(alarms.Mute("UnitSilent", Later(60), "", "", kNow));
  EXPECT_TRUE(alarms.Mutes(kNow).empty());
}

TEST(AlarmRegister, AlarmsOfTheStoreItselfAreOpenWhileItFails) {
  AlarmRegister alarms;
  alarms.NoteStore(kNow, Error{ErrorCode::kFull, "no space"});
  ASSERT_EQ(alarms.Lasting().size(), 1u);
  EXPECT_EQ(alarms.Lasting()[0].name, AlarmName::kStoreFull);
  const auto rows = alarms.Acknowledge({}, {"StoreFull"}, "", kNow);
  ASSERT_TRUE(rows);
  EXPECT_TRUE(rows->empty()) << "there is no store to keep it";
  alarms.NoteStore(kNow, std::nullopt);
  EXPECT_TRUE(alarms.Lasting().empty());
}

TEST(AlarmRegister, ANewDaemonGoesOnWithWhatTheStoreHolds) {
  AlarmRegister before;
  Taken(&before, {Alarm(1, AlarmName::kUnitSilent, UnitId{7}),
                  Alarm(2, AlarmName::kUnitNeverBegan, UnitId{8})});
  StoredFleet stored;
  const auto acknowledged = before.Acknowledge({1}, {}, "uid 7", kNow);
  ASSERT_TRUE(acknowledged);
  stored.open_alarms = before.Lasting();
  const auto muted = before.Mute("UnitNeverBegan", Later(60), "repair", "", kNow);
  ASSERT_TRUE(muted);
  stored.mutes = {std::get<MuteRow>(muted->front())};
  AlarmRegister after(stored);
  EXPECT_EQ(after.Lasting(), before.Lasting());
  EXPECT_EQ(after.Count(kNow).open, 0u);
  EXPECT_EQ(after.Count(kNow).muted, 1u);
  Taken(&after, {Alarm(3, AlarmName::kUnitSilent, UnitId{7})});
  EXPECT_EQ(after.Count(kNow).open, 0u) << "still acknowledged";
}

}  // namespace
}  // namespace focalfleet
