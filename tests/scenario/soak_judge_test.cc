// The judge of the soak must be able to see what it looks for.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "daemon/soak/blame_judge.h"
#include "daemon/soak/fault_injector.h"
#include "daemon/soak/judge.h"
#include "daemon/soak/memory_disk.h"
#include "daemon/soak/operators.h"
#include "daemon/soak/plant.h"
#include "daemon/soak/virtual_time.h"
#include "daemon/store/store.h"

namespace focalfleet::soak {
namespace {

StoreOptions On(const MemoryDisk& disk) { return {.vfs = disk.name(), .vfs_has_files = true}; }

std::vector<Row> RowsOf(std::uint32_t serial) {
  return {VectorRow{.serial = {serial},
                    .knowledge = Exactly(Witness::kReported, Pose{10, 20}),
                    .subdivision = {96, 96}}};
}

/// Two units without faults, and all that a judge looks at.
class JudgeTest : public testing::Test {
 protected:
  JudgeTest() {
    t_virtual_time = {.host_ns = Seconds(1000).ns};
    const std::size_t units = plant_.layout().size();
    troubles_.buses.assign(plant_.layout().buses().size(), Troubles::kLongAgo);
    troubles_.deaf.assign(units, Troubles::kLongAgo);
    troubles_.units.assign(units, Troubles::kLongAgo);
    troubles_.counts_lost.assign(units, Troubles::kLongAgo);
    troubles_.jumps.resize(units);
  }
  [[nodiscard]] std::string First() const {
    return judge_.broken().empty() ? "" : judge_.broken()[0];
  }

  const Draws draws_ = DrawSeed(1, {.units = 2, .faults = false});
  const Plant plant_{draws_};
  const MemoryDisk disk_{"judge-test"};
  Troubles troubles_;
  Judge judge_{&plant_, &disk_, &troubles_, draws_};
};

// A batch stands in pages that the kernel could not write, and a process reads it there. The batch
// counts as stored where that process has begun, which writes the log once more before, and not
// where the process could not start.
TEST(Judge, NothingIsAcknowledgedByAProcessThatDoesNotStart) {
  for (const bool begins : {false, true}) {
    Rng rng(1);
    MemoryDisk disk("judge-test");
    const Draws draws = DrawSeed(1, {.units = 2, .faults = false});
    const Plant plant(draws);
    const Troubles troubles;
    Judge judge(&plant, &disk, &troubles, draws);
    auto store = Store::Open("store.sqlite", On(disk));
    ASSERT_TRUE(store) << store.error().text;
    const auto commit = [&](const std::vector<Row>& rows) {
      judge.Commits(rows);
      judge.Committed(rows, (*store)->Commit(rows, {1'000'000}).has_value());
    };
    commit(RowsOf(1));
    disk.drops_failed_syncs = true;
    disk.fails = [](DiskOperation operation) {
      return operation == DiskOperation::kSync ? SQLITE_IOERR_FSYNC : SQLITE_OK;
    };
    commit(RowsOf(2));
    disk.fails = [](DiskOperation) { return SQLITE_OK; };
    disk.Kill();
    judge.LifeBegins();
    if (begins) judge.LifeHasBegun();
    disk.CutPower(&rng);
    EXPECT_TRUE(judge.broken().empty()) << judge.broken()[0];
    judge.LifeBegins();
    EXPECT_EQ(judge.broken().empty(), !begins);
  }
}

// A row that is acknowledged and not stored is missed at the next start, in whatever table.
TEST(Judge, EveryTableSurvivesAKill) {
  const std::vector<Row> rows = {
      BindingRow{.unit = {1}, .serial = {7}},
      EnableRow{.unit = {1}, .enabled = false, .reason = "dusty"},
      ParameterRow{.serial = {7}, .value = 110},
      TuningRow{.serial = {7},
                .critical = 40,
                .repeat = 60,
                .margin = 0.25,
                .load_uNm = 1,
                .v_bus_V = 1.8,
                .counter1 = 500,
                .subdivision = 96},
      MuteRow{.name = AlarmName::kUnitFault, .until_unix_ns = 9, .by = "somebody"},
      ModelRow{.entry = 1, .sha256 = "ab", .name = "m"},
      NextMoveRow{{77}},
      ConfigurationRow{.id = 3, .source = "night"},
      AlarmRow{.id = 4, .text = "t"},
      OpenAlarmRow{.id = 4, .text = "t"},
      MeasurementRow{.exposure = 5, .serial = {7}, .unit = {1}, .x_mm = 0.1},
      AuditRow{.door = "socket", .verb = "stop"}};
  for (std::size_t lost = 0; lost <= rows.size(); ++lost) {
    MemoryDisk disk("judge-test");
    std::string broken;
    StoreJudge judge(&disk, Extent::kAll,
                     [&](const std::string&, const std::string& what) { broken = what; });
    auto store = Store::Open("store.sqlite", On(disk));
    ASSERT_TRUE(store) << store.error().text;
    std::vector<Row> stored = rows;
    if (lost < rows.size()) stored.erase(stored.begin() + static_cast<std::ptrdiff_t>(lost));
    judge.Commits(rows);
    const Status done = (*store)->Commit(stored, {1'000'000});
    ASSERT_TRUE(done) << done.error().text;
    judge.Committed(rows, true);
    disk.Kill();
    judge.LifeBegins();
    EXPECT_EQ(broken.empty(), lost == rows.size()) << lost << " " << broken;
  }
}

TEST_F(JudgeTest, MoreFramesThanAnUploadOfTheBusAreTooMany) {
  const std::size_t most = 2 * (1 + 2 * 8 + 2);
  std::vector<ShellFacts::Bus> buses(plant_.layout().buses().size());
  buses[0].waiting = most;
  judge_.Queues(100, buses);
  EXPECT_EQ(First(), "");
  buses[0].waiting = most + 1;
  judge_.Queues(100, buses);
  EXPECT_NE(First().find("bound"), std::string::npos);
}

TEST_F(JudgeTest, AUnitIsNotBlamedForWhatTheHostDid) {
  const UnitId unit = plant_.layout().units()[0].id;
  for (const AlarmName name : {AlarmName::kUnitSilent, AlarmName::kUnitClockOff}) {
    std::string broken;
    const std::vector<Row> rows = {AlarmRow{.id = 1, .unit = unit, .text = "t", .name = name}};
    BlameJudge judge(&plant_, &troubles_,
                     [&](const std::string& rule, const std::string&) { broken = rule; });
    const HostInstant now{ReadVirtualNs()};
    troubles_.host = troubles_.away = now;
    judge.Committed(rows, now);
    EXPECT_EQ(broken, "blame") << Name(name);
    broken.clear();
    troubles_.units[0] = now;
    judge.Committed(rows, now);
    EXPECT_EQ(broken, "") << "it has a fault of its own";
    troubles_.units[0] = Troubles::kLongAgo;
  }
}

TEST_F(JudgeTest, ARequestWithoutAnAnswerIsNoticed) {
  FaultCounts reached{};
  Operators operators({.draws = &draws_,
                       .plant = &plant_,
                       .judge = &judge_,
                       .troubles = &troubles_,
                       .reached = &reached,
                       .put = [](std::uint64_t, const std::string&) {},
                       .is_busy = [] { return false; }});
  operators.Ask("status", Json::object());
  const HostInstant asked{ReadVirtualNs()};
  operators.LookForUnanswered(asked + Seconds(29));
  EXPECT_EQ(First(), "");
  troubles_.away = asked + Seconds(10);
  operators.LookForUnanswered(asked + Seconds(39));
  EXPECT_EQ(First(), "") << "the host was away";
  operators.LookForUnanswered(asked + Seconds(41));
  EXPECT_NE(First().find("answer"), std::string::npos);
}

TEST_F(JudgeTest, NothingMayBeLeftUnansweredAtTheEnd) {
  FaultCounts reached{};
  Operators operators({.draws = &draws_,
                       .plant = &plant_,
                       .judge = &judge_,
                       .troubles = &troubles_,
                       .reached = &reached,
                       .put = [](std::uint64_t, const std::string&) {},
                       .is_busy = [] { return false; }});
  operators.Ask("apply", Json::object());
  operators.LookAtEnd(HostInstant{ReadVirtualNs()} + Seconds(3));
  EXPECT_NE(First().find("never answered"), std::string::npos);
}

// A full disk that nobody writes to, a silent unit that nobody asks, and an end of a daemon that
// does not live are not reached.
TEST(FaultInjector, CountsAFaultWhereItActs) {
  Draws draws = DrawSeed(1, {.units = 2, .faults = false});
  for (const FaultSite site : {FaultSite::kDiskFull, FaultSite::kDiskSlow, FaultSite::kUnitSilent,
                               FaultSite::kUnitMarkLost, FaultSite::kHostEnds}) {
    draws.armed[Index(site)] = true;
    draws.period[Index(site)] = Seconds(1);
  }
  t_virtual_time = {.host_ns = Seconds(1).ns};
  Plant plant(draws);
  MemoryDisk disk("injector-test");
  Troubles troubles;
  troubles.buses.assign(1, Troubles::kLongAgo);
  troubles.deaf.assign(2, Troubles::kLongAgo);
  troubles.units.assign(2, Troubles::kLongAgo);
  troubles.counts_lost.assign(2, Troubles::kLongAgo);
  troubles.jumps.resize(2);
  FaultCounts reached{};
  FaultInjector faults({.draws = &draws,
                        .plant = &plant,
                        .disk = &disk,
                        .troubles = &troubles,
                        .reached = &reached,
                        .host = [](FaultSite) { return false; },
                        .daemon_lives = [] { return false; },
                        .tell = [](const std::string&) {}},
                       HostInstant{ReadVirtualNs()});
  for (int second = 2; second < 100; ++second) {
    t_virtual_time.host_ns = Seconds(second).ns;
    plant.Advance(HostInstant{ReadVirtualNs()});
    faults.Apply(HostInstant{ReadVirtualNs()});
  }
  EXPECT_EQ(reached, FaultCounts{});
  disk.bytes_max = 0;
  EXPECT_FALSE(Store::Open("store.sqlite", On(disk)));
  EXPECT_GT(reached[Index(FaultSite::kDiskFull)], 0u);
}

}  // namespace
}  // namespace focalfleet::soak
