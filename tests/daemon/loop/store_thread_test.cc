#include "daemon/loop/store_thread.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>

#include <condition_variable>
#include <mutex>

#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

using ::testing::HasSubstr;

/// A record of the thread's calls, in order, and a disk that can be broken.
class Disk {
 public:
  StoreThread::Sinks Sinks() {
    return {.commit = [this](std::span<const Row> rows, WallTime, std::size_t* refused) -> Status {
              std::unique_lock lock(mutex_);
              ++attempts_;
              answers_.wait(lock, [this] { return !hangs_; });
              if (broken_) return Fail(ErrorCode::kFull, "no space");
              for (*refused = 0; *refused < rows.size(); ++*refused)
                if (TextOf(rows[*refused]) == "poison")
                  return Fail(ErrorCode::kInvalid, "it contradicts what is stored");
              std::string text = "commit";
              for (const Row& row : rows) text += " " + TextOf(row);
              Log(std::move(text));
              return {};
            },
            .publish =
                [this](StatusBatch* status) {
                  const std::lock_guard lock(mutex_);
                  const bool failing = status->fleet && status->fleet->store_failing;
                  if (behind_) return false;
                  if (!status->units.empty() || status->fleet)
                    Log("publish " + std::to_string(status->units.size()) +
                        (failing ? " failing" : ""));
                  return true;
                },
            .alarm =
                [this](const AlarmValue& alarm) {
                  const std::lock_guard lock(mutex_);
                  Log("alarm " + alarm.row.text);
                },
            .log_error = [](const std::string&) {},
            .retry_period = std::chrono::milliseconds(5)};
  }
  void Break(bool broken) {
    const std::lock_guard lock(mutex_);
    broken_ = broken;
  }
  /// A commit waits for as long.
  void Hang(bool hangs) {
    const std::lock_guard lock(mutex_);
    hangs_ = hangs;
    answers_.notify_all();
  }
  /// The publisher takes nothing more.
  void HoldUp(bool behind) {
    const std::lock_guard lock(mutex_);
    behind_ = behind;
  }
  std::vector<std::string> log() {
    const std::lock_guard lock(mutex_);
    return log_;
  }
  int attempts() {
    const std::lock_guard lock(mutex_);
    return attempts_;
  }

 private:
  static std::string TextOf(const Row& row) {
    if (const auto* alarm = std::get_if<AlarmRow>(&row)) return alarm->text;
    if (const auto* enable = std::get_if<EnableRow>(&row)) return enable->reason;
    return "?";
  }
  void Log(std::string text) { log_.push_back(std::move(text)); }

  std::mutex mutex_;
  std::condition_variable answers_;
  bool broken_ = false;
  bool hangs_ = false;
  bool behind_ = false;
  int attempts_ = 0;
  std::vector<std::string> log_;
};

std::vector<Row> Named(const std::string& name) {
  return {EnableRow{.unit = UnitId{1}, .enabled = true, .reason = name}};
}
StatusBatch UnitsAfter(std::uint64_t batch, std::size_t units, bool with_fleet = false) {
  StatusBatch status{.after_batch = batch};
  status.units.resize(units);
  if (with_fleet) status.fleet.emplace();
  return status;
}

/// Sleeps until the thread raises its signal, as the event loop does. A hang ends as a failure.
template <class Predicate>
bool Await(const EventSignal& progressed, const Predicate& done) {
  for (int i = 0; i < 1000; ++i) {
    if (done()) return true;
    pollfd poller{progressed.fd(), POLLIN, 0};
    ::poll(&poller, 1, 10);
    progressed.Clear();
  }
  return done();
}

TEST(StoreThread, CommitsInOrderAndReportsTheLastBatch) {
  Disk disk;
  const auto progressed = EventSignal::Create().value();
  const auto thread = StoreThread::Create(disk.Sinks(), &progressed).value();
  EXPECT_EQ(thread->committed_through(), 0u);
  for (std::uint64_t b = 1; b <= 100; ++b) thread->Commit(b, Named(std::to_string(b)));
  EXPECT_TRUE(Await(progressed, [&] { return thread->committed_through() == 100; }));
  ASSERT_TRUE(thread->Finish());
  std::string all;
  for (const std::string& line : disk.log()) all += line.substr(6);
  std::string expected;
  for (int b = 1; b <= 100; ++b) expected += " " + std::to_string(b);
  EXPECT_EQ(all, expected);
}

TEST(StoreThread, KeepsABatchThatCannotBeWrittenAndTriesAgain) {
  Disk disk;
  disk.Break(true);
  const auto progressed = EventSignal::Create().value();
  const auto thread = StoreThread::Create(disk.Sinks(), &progressed).value();
  thread->Commit(1, Named("one"));
  EXPECT_TRUE(Await(progressed, [&] { return thread->failing(); }));
  thread->Commit(2, Named("two"));
  EXPECT_TRUE(Await(progressed, [&] { return disk.attempts() >= 3; }));
  EXPECT_EQ(thread->committed_through(), 0u);
  disk.Break(false);
  EXPECT_TRUE(Await(progressed, [&] { return thread->committed_through() == 2; }));
  EXPECT_FALSE(thread->failing());
  ASSERT_TRUE(thread->Finish());
  const auto log = disk.log();
  ASSERT_EQ(log.size(), 3u);
  EXPECT_THAT(log[0], HasSubstr("alarm the store cannot be written"));
  EXPECT_THAT(log[0], HasSubstr("no space"));
  EXPECT_EQ(log[1], "commit one");
  EXPECT_EQ(log[2], "commit two");
}

StoreThread::Sinks Impatient(StoreThread::Sinks sinks) {
  sinks.hangs_after = std::chrono::milliseconds(20);
  return sinks;
}

TEST(StoreThread, ACommitThatDoesNotEndIsAFailureForAsLong) {
  Disk disk;
  const EventSignal progressed = EventSignal::Create().value();
  const auto thread = StoreThread::Create(Impatient(disk.Sinks()), &progressed).value();
  disk.Hang(true);
  EXPECT_FALSE(thread->writer().in_disk());
  thread->Commit(1, Named("a"));
  ASSERT_TRUE(Await(progressed, [&] { return thread->failing(); }));
  EXPECT_TRUE(thread->writer().in_disk());
  EXPECT_THAT(thread->failure().value().text, HasSubstr("does not answer"));
  EXPECT_EQ(thread->committed_through(), 0u);
  disk.Hang(false);
  ASSERT_TRUE(Await(progressed, [&] { return thread->committed_through() == 1; }));
  EXPECT_FALSE(thread->failing());
  EXPECT_FALSE(thread->failure());
  EXPECT_TRUE(thread->Finish());
}

TEST(StoreThread, TheEndDoesNotWaitForADiskThatDoesNotAnswer) {
  Disk disk;
  const EventSignal progressed = EventSignal::Create().value();
  const auto thread = StoreThread::Create(Impatient(disk.Sinks()), &progressed).value();
  disk.Hang(true);
  thread->Commit(1, Named("a"));
  const Status ended = thread->Finish();
  ASSERT_FALSE(ended);
  EXPECT_EQ(ended.error().code, ErrorCode::kUnavailable);
  EXPECT_FALSE(thread->ended());
  disk.Hang(false);  // the thread can end
}

TEST(StoreThread, SetsAsideARowThatCanNeverBeWrittenAndGoesOn) {
  Disk disk;
  disk.Break(true);  // so that all batches become one transaction
  const auto progressed = EventSignal::Create().value();
  const auto thread = StoreThread::Create(disk.Sinks(), &progressed).value();
  thread->Commit(1, Named("first"));
  EXPECT_TRUE(Await(progressed, [&] { return thread->failing(); }));
  std::vector<Row> rows = Named("two");
  rows.push_back(Named("poison")[0]);
  rows.push_back(VectorRow{});  // flawed: it has no serial number
  rows.push_back(Named("three")[0]);
  thread->Commit(2, rows);
  thread->Commit(3, Named("four"));
  disk.Break(false);
  EXPECT_TRUE(Await(progressed, [&] { return thread->committed_through() == 3; }));
  const std::vector<RefusedRow> refused = thread->TakeRefused();
  ASSERT_EQ(refused.size(), 2u);
  for (const RefusedRow& row : refused) {
    EXPECT_LE(row.first_batch, 2u);
    EXPECT_GE(row.last_batch, 2u);
  }
  EXPECT_TRUE(std::holds_alternative<VectorRow>(refused[0].row));
  EXPECT_TRUE(std::holds_alternative<EnableRow>(refused[1].row));
  EXPECT_TRUE(thread->TakeRefused().empty());
  EXPECT_FALSE(thread->failing());
  ASSERT_TRUE(thread->Finish());
  std::string all;
  for (const std::string& line : disk.log())
    if (line.starts_with("commit")) all += line.substr(6);
  EXPECT_EQ(all, " first two three four");
}

TEST(StoreThread, ABatchOfRefusedRowsAloneIsOverToo) {
  Disk disk;
  const auto progressed = EventSignal::Create().value();
  const auto thread = StoreThread::Create(disk.Sinks(), &progressed).value();
  thread->Commit(1, Named("poison"));
  EXPECT_TRUE(Await(progressed, [&] { return thread->committed_through() == 1; }));
  EXPECT_EQ(thread->TakeRefused().size(), 1u);
  EXPECT_TRUE(thread->Finish());
}

TEST(StoreThread, PublishesStatusOnlyAfterTheCommitOfItsRows) {
  Disk disk;
  disk.Break(true);
  const auto progressed = EventSignal::Create().value();
  const auto thread = StoreThread::Create(disk.Sinks(), &progressed).value();
  thread->Commit(1, Named("one"));
  StatusBatch status = UnitsAfter(1, 3, /*with_fleet=*/true);
  ASSERT_TRUE(thread->Publish(&status));
  EXPECT_TRUE(Await(progressed, [&] { return disk.log().size() >= 2; }));
  disk.Break(false);
  EXPECT_TRUE(Await(progressed, [&] { return thread->committed_through() == 1; }));
  ASSERT_TRUE(thread->Finish());
  const auto log = disk.log();
  ASSERT_EQ(log.size(), 4u);
  EXPECT_EQ(log[1], "publish 0 failing") << "the failure of the store is published at once";
  EXPECT_EQ(log[2], "commit one");
  EXPECT_EQ(log[3], "publish 3");
}

TEST(StoreThread, AnAlarmIsReportedOnceAfterItIsStored) {
  Disk disk;
  const auto progressed = EventSignal::Create().value();
  const auto thread = StoreThread::Create(disk.Sinks(), &progressed).value();
  thread->Commit(
      1, {AlarmRow{.id = 4, .severity = Severity::kError, .unit = {}, .bus = {}, .text = "hot"}});
  ASSERT_TRUE(thread->Finish());
  EXPECT_EQ(disk.log(), (std::vector<std::string>{"commit hot", "alarm hot"}));
}

TEST(StoreThread, MoreBatchesThanTheQueueHoldsAreAllWritten) {
  Disk disk;
  disk.Break(true);
  const auto progressed = EventSignal::Create().value();
  const auto thread = StoreThread::Create(disk.Sinks(), &progressed).value();
  constexpr std::uint64_t kMany = 3000;
  thread->Commit(1, Named("x"));
  EXPECT_TRUE(Await(progressed, [&] { return thread->failing(); }));
  for (std::uint64_t b = 2; b <= kMany; ++b) thread->Commit(b, Named("x"));
  EXPECT_EQ(thread->waiting(), kMany - 1) << "the thread takes nothing more while it fails";
  disk.Break(false);
  EXPECT_TRUE(Await(progressed, [&] {
    thread->HandOver();
    return thread->committed_through() == kMany;
  }));
  ASSERT_TRUE(thread->Finish());
}

TEST(StoreThread, RowsThatWaitForAFullDiskAreBoundedAndNoneIsLost) {
  Disk disk;
  disk.Break(true);
  const auto progressed = EventSignal::Create().value();
  const auto thread = StoreThread::Create(disk.Sinks(), &progressed).value();
  thread->Commit(1, Named("x"));
  EXPECT_TRUE(Await(progressed, [&] { return thread->failing(); }));
  const std::string text(std::size_t{1} << 20, 'r');
  constexpr std::uint64_t kMost = limits::kRowBytesWaiting >> 20;
  std::uint64_t batch = 1;
  while (thread->RoomForRows() && batch < 2 * kMost) thread->Commit(++batch, Named(text));
  EXPECT_EQ(batch - 1, kMost) << "a few bytes of each row come on top";
  const Status room = thread->RoomForRows();
  ASSERT_FALSE(room);
  EXPECT_EQ(room.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(room.error().text, HasSubstr("64 MiB of rows wait for the store already"));
  EXPECT_THAT(room.error().text, HasSubstr("no space"));
  thread->Commit(++batch, Named("stop"));  // it is kept all the same
  disk.Break(false);
  EXPECT_TRUE(Await(progressed, [&] { return thread->committed_through() == batch; }));
  EXPECT_TRUE(thread->RoomForRows());
  EXPECT_EQ(thread->writer().bytes_waiting(), 0u);
  ASSERT_TRUE(thread->Finish());
  std::size_t bytes = 0;
  for (const std::string& line : disk.log()) bytes += line.starts_with("commit") ? line.size() : 0;
  EXPECT_GE(bytes, kMost << 20);
}

TEST(StoreThread, RefusesStatusWhenItIsBehind) {
  Disk disk;
  const auto progressed = EventSignal::Create().value();
  const auto thread = StoreThread::Create(disk.Sinks(), &progressed).value();
  int taken = 0;
  for (int i = 0; i < 100; ++i) {
    StatusBatch status = UnitsAfter(/*batch=*/99, 1);  // a batch that has not come yet
    taken += thread->Publish(&status) ? 1 : 0;
    if (taken < i) break;
  }
  EXPECT_LT(taken, 10);
  thread->Commit(99, Named("late"));
  ASSERT_TRUE(thread->Finish());
}

TEST(StoreThread, CommitsWhileThePublisherIsBehind) {
  Disk disk;
  disk.HoldUp(true);
  const auto progressed = EventSignal::Create().value();
  const auto thread = StoreThread::Create(disk.Sinks(), &progressed).value();
  StatusBatch status = UnitsAfter(0, 3);
  ASSERT_TRUE(thread->Publish(&status));
  thread->Commit(1, Named("one"));
  EXPECT_TRUE(Await(progressed, [&] { return thread->committed_through() == 1; }));
  disk.HoldUp(false);
  ASSERT_TRUE(thread->Finish());
  EXPECT_EQ(disk.log(), (std::vector<std::string>{"commit one", "publish 3"}));
}

TEST(StoreThread, EndsWhereThePublisherHangs) {
  Disk disk;
  disk.HoldUp(true);
  const auto progressed = EventSignal::Create().value();
  const auto thread = StoreThread::Create(disk.Sinks(), &progressed).value();
  StatusBatch status = UnitsAfter(0, 3);
  ASSERT_TRUE(thread->Publish(&status));
  thread->Commit(1, Named("one"));
  ASSERT_TRUE(thread->Finish());
  EXPECT_EQ(disk.log(), (std::vector<std::string>{"commit one"}));
}

TEST(StoreThread, KeepsUpWhereNoRowsWait) {
  Disk disk;
  const auto progressed = EventSignal::Create().value();
  StoreThread::Sinks sinks = disk.Sinks();
  std::atomic<int> pieces{0};
  sinks.upkeep = [&] {
    const bool more = ++pieces < 3;
    if (!more) progressed.Raise();
    return more;
  };
  const auto thread = StoreThread::Create(std::move(sinks), &progressed).value();
  EXPECT_TRUE(Await(progressed, [&] { return pieces == 3; }));
  thread->Commit(1, Named("one"));
  EXPECT_TRUE(Await(progressed, [&] { return thread->committed_through() == 1; }));
  ASSERT_TRUE(thread->Finish());
  EXPECT_EQ(pieces, 3) << "an hour is not over";
}

TEST(StoreThread, ABrokenDiskAtTheEndIsSaid) {
  Disk disk;
  disk.Break(true);
  const auto progressed = EventSignal::Create().value();
  const auto thread = StoreThread::Create(disk.Sinks(), &progressed).value();
  thread->Commit(1, Named("lost"));
  const auto ended = thread->Finish();
  ASSERT_FALSE(ended);
  EXPECT_EQ(ended.error().code, ErrorCode::kFull);
}

}  // namespace
}  // namespace focalfleet
