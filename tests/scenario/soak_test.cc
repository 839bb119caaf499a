// A few nights of the soak, so that each change meets some kills and faults. `focalfleet-sim soak`
// runs as many as one likes. A seed that found a fault of the daemon stays here.
#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <vector>

#include "daemon/journal/fields.h"
#include "daemon/journal/step_record.h"
#include "daemon/soak/memory_disk.h"
#include "daemon/soak/night.h"
#include "daemon/store/store.h"

namespace focalfleet::soak {
namespace {

NightResult RunSeed(std::uint64_t seed, std::uint32_t units = 0,
                    DrawKinds kinds = DrawKinds::kAll) {
  DrawLimits limits{.units = {}, .kinds = kinds};
  if (units > 0) limits.units = units;
  return Night(DrawSeed(seed, limits), {.replay = true}).Run();
}

void ExpectKept(std::uint64_t seed, const NightResult& result) {
  for (const std::string& broken : result.broken) ADD_FAILURE() << "seed " << seed << " " << broken;
  EXPECT_GT(result.commits, 10u) << "seed " << seed << " stored nothing";
}

/// A night as it was when the seed was found: later kinds of draws would make it another one.
void ExpectKept(std::uint64_t seed, std::uint32_t units = 0) {
  ExpectKept(seed, RunSeed(seed, units, DrawKinds::kFirst));
}

TEST(Soak, KeepsEveryRuleOverAFewSeeds) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) ExpectKept(seed, RunSeed(seed, 19));
}

TEST(Soak, OneSeedIsOneRun) {
  const NightResult once = RunSeed(3, 13), again = RunSeed(3, 13), other = RunSeed(4, 13);
  EXPECT_EQ(once.digest, again.digest);
  EXPECT_EQ(once.frames, again.frames);
  EXPECT_NE(once.digest, other.digest);
}

TEST(Regression, Seed3_AMarkThatIsLostWithThePowerIsNotBelieved) { ExpectKept(3); }

// A kernel dropped a batch that it could not write. The next process read it in the log and put
// others behind it, which a power cut then lost.
TEST(Regression, Seed45_ABatchThatTheKernelDroppedTakesNoOtherWithIt) { ExpectKept(45); }

// A unit that restarted in mid-move answered a stop with the place where the move began.
TEST(Regression, Seed68_AUnitThatRestartedIsNotWhereItsMoveBegan) { ExpectKept(68); }

// A unit of a wave of homing was lost while the store wrote its intent, and the daemon ended.
TEST(Regression, Seed15_AUnitThatIsLostBeforeItHomesIsLeftOut) { ExpectKept(15); }

// A unit of unknown place, whose homing was cut short unheard, counted from anywhere.
TEST(Regression, Seed17_HomingThatWasCutShortLeavesNoPlace) { ExpectKept(17); }

// A unit that makes way and comes back restarted on the way.
TEST(Regression, Seed119_AMoveThatEndsWhereItBeganIsNotOverAtItsBeginning) { ExpectKept(119, 12); }

// The camera found a lost unit with its arm folded, and theta was anything.
TEST(Regression, Seed121_AFoldedArmIsNotMeasured) { ExpectKept(121); }

// A unit restarted at rest with counts of an earlier copy of its FLASH, and got a move before it
// was polled.
TEST(Regression, Seed42_AUnitThatCountsFromElsewhereDoesNotBegin) { ExpectKept(42); }

// A round kept a number of a plan that was over, and the daemon ended with it. Later the same seed
// showed a foreign unit at the place of the unit that it had replaced.
TEST(Regression, Seed9_ANumberOfAPlanThatIsOverIsNoPlan) { ExpectKept(9); }

// A unit lost its FLASH in the instant after it had begun a move, and the judge read the move
// there.
TEST(Regression, Seed556_TheMoveThatBeganIsNotReadInALostFlash) {
  ExpectKept(556, RunSeed(556, 0, DrawKinds::kPower));
}

// A unit that did not answer went on to where its follower had been stopped for it.
TEST(Regression, Seed426_AFollowerThatIsNotHeardIsStopped) {
  ExpectKept(426, RunSeed(426, 0, DrawKinds::kPower));
}

// Somebody disables a unit that another has just enabled: both are answered after one commit.
TEST(Regression, Seed40049_TwoWhoDisagreeAreBothAnsweredTruly) { ExpectKept(40049); }

// A lost unit whose fibre was dark was given the fibre of another lost unit.
TEST(Regression, Seed201040_LostUnitsAreNotTakenForEachOther) {
  ExpectKept(201040, RunSeed(201040, 0, DrawKinds::kAll));
}

// A unit that makes way and comes back lost power before it began, and passed for out of the way.
TEST(Regression, Seed201098_AUnitThatNeverMadeWayIsInTheWay) {
  ExpectKept(201098, RunSeed(201098, 0, DrawKinds::kAll));
}

// The theta angle of a folded arm was measured by spots that tell nothing of it.
TEST(Regression, Seed203409_AFoldedArmStaysAsItIsBelieved) {
  ExpectKept(203409, RunSeed(203409, 0, DrawKinds::kAll));
}

// A unit restarted in mid-move and lost its mark, was read while the store failed, read anew and
// resumed; then the daemon was killed, and the next one did not know of the restart.
TEST(Regression, Seed205393_ARestartIsNotForgottenBeforeItsEndIsStored) {
  ExpectKept(205393, RunSeed(205393, 0, DrawKinds::kAll));
}

// A clock's answer to the life before, held up on its bus, answered this life's first question.
TEST(Regression, Seed208257_AnAnswerToTheLifeBeforeIsNone) {
  ExpectKept(208257, RunSeed(208257, 0, DrawKinds::kAll));
}

// The judge's own parts must be able to see what they look for.

StoreOptions On(const MemoryDisk& disk) { return {.vfs = disk.name(), .vfs_has_files = true}; }

std::vector<Row> RowsOf(std::uint32_t serial) {
  return {VectorRow{.serial = {serial},
                    .knowledge = Exactly(Witness::kReported, Pose{10, 20}),
                    .subdivision = {96, 96}}};
}

TEST(MemoryDisk, KeepsWhatWasAcknowledgedOverACutAndAKill) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Rng rng(seed);
    MemoryDisk disk("memory-disk-test");
    {
      auto store = Store::Open("s", On(disk));
      ASSERT_TRUE(store) << store.error().text;
      for (std::uint32_t n = 1; n <= seed; ++n)
        ASSERT_TRUE((*store)->Commit(RowsOf(n), {1'000'000}));
      if (seed % 2 == 0)
        disk.CutPower(&rng);
      else
        disk.Kill();
    }
    auto store = Store::Open("s", On(disk));
    ASSERT_TRUE(store) << store.error().text;
    EXPECT_EQ((*store)->Load()->vectors.size(), seed);
  }
}

// A kernel that drops pages it could not write goes on reading them: the next process finds a batch
// in the log that is not on the disk, and must not put others behind it.
TEST(MemoryDisk, ABatchBehindOneThatTheKernelDroppedSurvivesAPowerCut) {
  Rng rng(1);
  MemoryDisk disk("memory-disk-test");
  auto store = Store::Open("s", On(disk));
  ASSERT_TRUE(store) << store.error().text;
  ASSERT_TRUE((*store)->Commit(RowsOf(1), {1'000'000}));
  disk.drops_failed_syncs = true;
  disk.fails = [](DiskOperation operation) {
    return operation == DiskOperation::kSync ? SQLITE_IOERR_FSYNC : SQLITE_OK;
  };
  EXPECT_FALSE((*store)->Commit(RowsOf(2), {1'000'000}));
  disk.Kill();
  disk.fails = [](DiskOperation) { return SQLITE_OK; };
  auto second = Store::Open("s", On(disk));
  ASSERT_TRUE(second) << second.error().text;
  ASSERT_TRUE((*second)->Commit(RowsOf(3), {1'000'000}));
  disk.CutPower(&rng);
  auto third = Store::Open("s", On(disk));
  ASSERT_TRUE(third) << third.error().text;
  const auto fleet = (*third)->Load();
  ASSERT_TRUE(fleet) << fleet.error().text;
  EXPECT_EQ(fleet->vectors.back().serial.value, 3u) << "the acknowledged batch is there";
}

TEST(MemoryDisk, LosesWhatWasNotSyncedAndDoesNothingForTheDead) {
  MemoryDisk disk("memory-disk-test");
  auto store = Store::Open("s", On(disk));
  ASSERT_TRUE(store);
  ASSERT_TRUE((*store)->Commit(RowsOf(1), {1'000'000}));
  disk.fails = [](DiskOperation operation) {
    return operation == DiskOperation::kSync ? SQLITE_IOERR_FSYNC : SQLITE_OK;
  };
  EXPECT_FALSE((*store)->Commit(RowsOf(2), {1'000'000}));
  disk.fails = [](DiskOperation) { return SQLITE_OK; };
  disk.Kill();
  EXPECT_FALSE((*store)->Commit(RowsOf(3), {1'000'000}));
}

// A small week: what grows with the number of configurations would show. The audit alone is kept
// for ever.
TEST(Week, MemoryStoreAndDescriptorsDoNotGrow) {
  constexpr std::size_t kAuditOfACommand = 1000;
  std::vector<WeekSizes> sizes;
  const NightResult result =
      Night(DrawSeed(2, {.units = 3, .faults = false}), {.keep_days = 2})
          .RunWeek({.configurations = 70}, [&](const WeekSizes& each) { sizes.push_back(each); });
  for (const std::string& broken : result.broken) ADD_FAILURE() << broken;
  ASSERT_EQ(sizes.size(), 70u);
  EXPECT_EQ(sizes.back().night, 7u);
  EXPECT_EQ(result.lives, 7u);
  const WeekSizes& middle = sizes[39];  // the end of the fourth night: two nights are pruned
  EXPECT_LT(sizes.back().memory, middle.memory * 5 / 4);
  EXPECT_LT(sizes.back().store, middle.store + 30 * kAuditOfACommand);
  EXPECT_LE(sizes.back().descriptors, middle.descriptors);
  EXPECT_GT(middle.store, sizes[9].store);
}

TEST(StepRecord, ReadsBackWhatItWrote) {
  const std::vector<Row> rows = {
      MeasurementRow{.exposure = 7, .unit = {3}, .place = Pose{1, -2}, .target_id = "a"},
      OpenAlarmRow{.id = 4, .text = "t"}, ModelRow{.entry = 1, .name = "m"}};
  std::string bytes;
  journal::WriteFields(rows, &bytes);
  std::vector<Row> read;
  journal::ByteReader reader{bytes};
  journal::ReadFields(&reader, &read);
  ASSERT_TRUE(reader.good && reader.left.empty());
  std::string again;
  journal::WriteFields(read, &again);
  EXPECT_EQ(again, bytes);
  EXPECT_EQ(std::get<MeasurementRow>(read[0]).target_id, "a");
  EXPECT_EQ(std::get<OpenAlarmRow>(read[1]), std::get<OpenAlarmRow>(rows[1]));
}

TEST(StepRecord, BytesThatAreNoneAreRefused) {
  std::string bytes;
  journal::WriteFields(std::vector<Row>{EnableRow{.unit = {3}, .reason = "why"}}, &bytes);
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    std::vector<Row> read;
    journal::ByteReader reader{std::string_view(bytes).substr(0, size)};
    journal::ReadFields(&reader, &read);
    EXPECT_FALSE(reader.good) << size;
  }
}

}  // namespace
}  // namespace focalfleet::soak
