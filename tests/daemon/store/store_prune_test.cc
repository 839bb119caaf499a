// Pruning of old history: what goes, what stays, and what a piece costs.
#include <gmock/gmock.h>

#include "daemon/store/retention.h"
#include "tests/daemon/store/faulty_disk.h"
#include "tests/daemon/store/store_fixture.h"

namespace focalfleet {
namespace {

using test::Intent;
using test::kEight;
using test::kNine;
using test::StoreTest;
using test::Tuned;
using test::Vector;

/// The rows that are gone after a whole round.
std::uint64_t PruneAll(Store& store, WallTime before) {
  std::uint64_t gone = 0;
  for (;;) {
    const auto pruned = store.Prune(before, 100);
    EXPECT_TRUE(pruned) << pruned.error().text;
    if (!pruned) return gone;
    gone += pruned->rows;
    if (!pruned->more) return gone;
  }
}

TEST_F(StoreTest, PruneTakesOldHistoryAndNoNextIds) {
  auto store = OpenStore();
  test::ExpectDone(store->Commit(
      std::vector<Row>{
          Intent(1, 1, 1, {0, 0}, {1, 1}), Intent(2, 2, 1, {0, 0}, {1, 1}),
          IntentEndRow{{1}, {1}, IntentEnd::kArrived},
          ConfigurationRow{.id = 8, .source = "", .state = ConfigurationState::kDone},
          AlarmRow{9, Severity::kInfo, {}, {}, ""},
          OpenAlarmRow{.id = 8, .last_unix_ns = kEight.ns},
          OpenAlarmRow{.id = 9, .state = OpenAlarmRow::State::kOver, .last_unix_ns = kEight.ns}},
      kEight));
  EXPECT_EQ(PruneAll(*store, kEight), 0u);
  EXPECT_EQ(PruneAll(*store, kNine), 3u) << "an alarm that lasts and the newest one stay";
  const auto fleet = store->Load();
  EXPECT_EQ(fleet->open_intents.size(), 1u);
  EXPECT_EQ(fleet->next_configuration, 9u);
  EXPECT_EQ(fleet->next_alarm, 10u);
}

TEST_F(StoreTest, PruneTakesNoMoreRowsAtOnceThanAsked) {
  auto store = OpenStore();
  for (std::uint16_t move = 1; move <= 5; ++move)
    test::ExpectDone(store->Commit(
        std::vector<Row>{Intent(1, 1, move, {0, 0}, {1, 1}),
                         IntentEndRow{{1}, {move}, IntentEnd::kArrived},
                         EnableRow{{1}, move % 2 == 0, "by turns"},
                         ParameterRow{{1}, Axis::kPhi, Parameter::kRepeat, move, Origin::kTuning}},
        kEight));
  std::uint64_t gone = 0;
  bool more = true;
  while (more) {
    const auto pruned = store->Prune(kNine, 2);
    ASSERT_TRUE(pruned) << pruned.error().text;
    EXPECT_LE(pruned->rows, 2u);
    gone += pruned->rows;
    more = pruned->more;
  }
  EXPECT_EQ(gone, 5u + 4u + 4u) << "motions; changes of the unit and of a parameter but the newest";
  EXPECT_EQ(PruneAll(*store, kNine), 0u);
  EXPECT_EQ(store->Load()->parameters.size(), 1u);
  EXPECT_EQ(store->Load()->units.size(), 1u);
}

/// Two moves that have ended: their rows may go.
std::vector<Row> TwoMoves() {
  return {Intent(1, 1, 1, {0, 0}, {1, 1}), IntentEndRow{{1}, {1}, IntentEnd::kArrived},
          Intent(1, 1, 2, {0, 0}, {1, 1}), IntentEndRow{{1}, {2}, IntentEnd::kArrived}};
}

TEST_F(StoreTest, PruningTakesWhatIsOlderThanTheDaysKept) {
  auto store = OpenStore();
  test::ExpectDone(store->Commit(TwoMoves(), kEight));
  constexpr std::int64_t kDayNs = 86'400'000'000'000;
  std::int64_t monotonic_ns = 5;
  WallTime wall = kNine;
  const auto prune = PruningOf(
      store.get(),
      {.keep_days = 1, .monotonic_ns = [&] { return monotonic_ns; }, .wall = [&] { return wall; }},
      [](const std::string& reason) { ADD_FAILURE() << reason; });
  ASSERT_TRUE(prune);
  const auto rows = [&] { return OpenReader()->Moves(std::nullopt, 10)->size(); };
  while ((*prune)()) {
  }
  EXPECT_EQ(rows(), 2u) << "an hour old";
  wall.ns += 400 * kDayNs;
  while ((*prune)()) {
  }
  EXPECT_EQ(rows(), 2u) << "the wall clock stepped: no time went by";
  monotonic_ns += 2 * kDayNs;
  while ((*prune)()) {
  }
  EXPECT_EQ(rows(), 0u) << "two days old";
}

TEST_F(StoreTest, PruningSaysWhyAPieceStays) {
  test::FaultyDisk disk;
  auto store = OpenStore(test::FaultyDisk::kVfsName);
  test::ExpectDone(store->Commit(TwoMoves(), kEight));
  std::vector<std::string> reasons;
  std::int64_t monotonic_ns = 0;
  const auto prune = PruningOf(store.get(),
                               {.keep_days = 1,
                                .monotonic_ns = [&] { return monotonic_ns; },
                                .wall = [] { return WallTime{kEight.ns + 1'000'000'000'000'000}; }},
                               [&](const std::string& reason) { reasons.push_back(reason); });
  ASSERT_TRUE(prune);
  monotonic_ns = 200'000'000'000'000;  // more than two days
  disk.FailAt(1, SQLITE_IOERR, true);
  EXPECT_FALSE((*prune)());
  ASSERT_EQ(reasons.size(), 1u);
  EXPECT_THAT(reasons[0], testing::StartsWith("old history stays for now: "));
  disk.Heal();
  while ((*prune)()) {
  }
  EXPECT_EQ(reasons.size(), 1u);
  EXPECT_EQ(PruneAll(*store, kNine), 0u) << "all that is old has gone";
}

TEST_F(StoreTest, PruneKeepsWhatSaysForWhichUnitsAModelHolds) {
  auto store = OpenStore();
  const auto homed = [&](std::uint16_t move) {
    return std::vector<Row>{Intent(12, 7, move, {0, 0}, {1, 1}),
                            IntentEndRow{{7}, {move}, IntentEnd::kHomed}};
  };
  test::ExpectDone(store->Commit(std::vector<Row>{BindingRow{{12}, {7}}}, {1}));
  test::ExpectDone(store->Commit(homed(1), kEight));
  test::ExpectDone(store->Commit(homed(2), kEight));
  test::ExpectDone(store->Commit(std::vector<Row>{ModelRow{.entry = 1}}, {2}));
  test::ExpectDone(store->Commit(
      std::vector<Row>{Vector(7, Witness::kReported, 1, 1, 3, Origin::kOperator)}, kEight));
  EXPECT_EQ(PruneAll(*store, kNine), 1u) << "the first homing";
  EXPECT_EQ(OpenReader()->CountedAnewSince(1), std::vector<UnitId>{{12}});
  EXPECT_EQ(PruneAll(*store, kNine), 0u);
}

TEST_F(StoreTest, PruneKeepsTheUnitThatAPlaceHadBeforeTheFirstModel) {
  auto store = OpenStore();
  test::ExpectDone(
      store->Commit(std::vector<Row>{BindingRow{{12}, {6}}, BindingRow{{13}, {9}}}, {1}));
  test::ExpectDone(store->Commit(std::vector<Row>{BindingRow{{12}, {7}}}, {2}));
  test::ExpectDone(store->Commit(std::vector<Row>{EnableRow{{12}, false, "bent"}}, {2}));
  test::ExpectDone(store->Commit(std::vector<Row>{BindingRow{{14}, {7}}}, {3}));  // 12 has none
  EXPECT_EQ(PruneAll(*store, kEight), 2u) << "two of unit 12 before it was unbound";
  test::ExpectDone(store->Commit(std::vector<Row>{ModelRow{.entry = 1}}, {4}));
  EXPECT_EQ(PruneAll(*store, kEight), 0u);
  test::ExpectDone(
      store->Commit(std::vector<Row>{BindingRow{{12}, {8}}, EnableRow{{13}, false, "bent"}}, {5}));
  EXPECT_EQ(OpenReader()->CountedAnewSince(1), std::vector<UnitId>{{12}}) << "adopted since";
}

TEST_F(StoreTest, PruneKeepsNumbersOfChangesOfUnitsAscending) {
  auto store = OpenStore();
  test::ExpectDone(store->Commit(
      std::vector<Row>{BindingRow{{12}, {7}}, EnableRow{{12}, false, "bent"}}, kEight));
  const std::uint64_t newest = OpenReader()->NewestEntries()->unit;
  EXPECT_EQ(newest, 2u);
  PruneAll(*store, kNine);
  EXPECT_EQ(OpenReader()->NewestEntries()->unit, newest);
}

TEST_F(StoreTest, PruneKeepsWhatIsInForce) {
  auto store = OpenStore();
  for (const std::uint16_t n : std::initializer_list<std::uint16_t>{37, 38}) {
    test::ExpectDone(store->Commit(
        std::vector<Row>{ParameterRow{{7}, Axis::kPhi, Parameter::kRepeat, n, Origin::kTuning},
                         Tuned(n, 0.5), EnableRow{{1}, n == 37, "bent"}},
        {n}));
  }
  EXPECT_EQ(PruneAll(*store, kEight), 3u);
  auto reader = OpenReader();
  ASSERT_EQ(reader->Parameters({7}, 9)->size(), 1u);
  EXPECT_EQ(reader->Parameters({7}, 9)->at(0).row.value, 38);
  ASSERT_EQ(reader->Tunings({7}, 9)->size(), 1u);
  EXPECT_EQ(reader->Tunings({7}, 9)->at(0).row.critical, 38);
  EXPECT_EQ(reader->Units(UnitId{1}, 9)->at(0).reason, "bent");
}

TEST_F(StoreTest, PruneLooksAtNoMoreRowsForMotionsThatFollow) {
  const auto instructions = [this](std::uint16_t later) {
    const std::string path = folder_ / ("later" + std::to_string(later) + ".db");
    auto store = std::move(*Store::Open(path));
    constexpr std::uint32_t kUnitsHomed = 50;
    std::vector<Row> rows;
    const auto move = [&rows](std::uint32_t unit, std::uint16_t number, IntentEnd end) {
      rows.emplace_back(Intent(unit, unit, number, {0, 0}, {1, 1}));
      rows.emplace_back(IntentEndRow{{unit}, {number}, end});
    };
    for (std::uint32_t unit = 1; unit <= kUnitsHomed; ++unit) move(unit, 1, IntentEnd::kHomed);
    test::ExpectDone(store->Commit(rows, kEight));
    rows.clear();
    for (std::uint16_t number = 2; number < 2 + later; ++number)
      for (std::uint32_t unit = 1; unit <= kUnitsHomed; ++unit)
        move(unit, number, IntentEnd::kArrived);
    test::ExpectDone(store->Commit(rows, kNine));
    EXPECT_EQ(PruneAll(*store, kNine), 0u);
    return store->counters().prune_instructions;
  };
  const std::uint64_t few = instructions(2);
  EXPECT_GT(few, 0u);
  EXPECT_EQ(instructions(100), few);
}

TEST(OldBefore, AStepOfTheWallClockMakesNothingOld) {
  constexpr std::int64_t kDayNs = 86'400'000'000'000;
  const HistoryAge age{
      .now = kEight, .newest = {kEight.ns - kDayNs}, .open_s = 86'400, .keep_days = 30};
  EXPECT_EQ(OldBefore(age).ns, kEight.ns - 30 * kDayNs);
  HistoryAge stepped = age;
  stepped.now = {kEight.ns + 36'500 * kDayNs};
  EXPECT_EQ(OldBefore(stepped).ns, kEight.ns - 30 * kDayNs) << "a century ahead";
  stepped.now = {kEight.ns - 100 * kDayNs};
  EXPECT_EQ(OldBefore(stepped).ns, kEight.ns - 130 * kDayNs) << "back: less is old";
  HistoryAge kept = age;
  kept.keep_days = 0;
  EXPECT_EQ(OldBefore(kept).ns, 0);
  kept = age;
  kept.newest = {0};
  EXPECT_EQ(OldBefore(kept).ns, 0) << "there is no history";
}

}  // namespace
}  // namespace focalfleet
