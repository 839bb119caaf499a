// The disk under the store fails: an error at the n-th operation for every n, a full disk, kill -9,
// a power cut. Acknowledged batches stay, refused ones leave no trace, and the store works again
// when the disk does.
#include <fcntl.h>
#include <sys/wait.h>

#include <atomic>
#include <fstream>
#include <iterator>

#include "daemon/store/store.h"
#include "tests/daemon/store/faulty_disk.h"
#include "tests/daemon/store/store_fixture.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

using test::Batch;
using test::BatchIn;
using test::FaultyDisk;
using test::StoreTest;

constexpr WallTime kNow{1'700'000'000'000'000'000};

struct Failure {
  const char* name;
  int sqlite_code;
  bool lasting;
  ErrorCode reported;
};

class StoreFaults : public StoreTest, public ::testing::WithParamInterface<Failure> {
 protected:
  FaultyDisk disk_;
};

TEST_P(StoreFaults, EveryOperationOfACommitMayFail) {
  constexpr std::uint32_t kSerials = 60;
  auto store = OpenStore(FaultyDisk::kVfsName);
  test::ExpectDone(store->Commit(Batch(1, kSerials), kNow));
  std::uint32_t held = 1;
  std::uint64_t n = 1;
  for (;; ++n) {
    ASSERT_LT(n, 1000u);
    disk_.FailAt(n, GetParam().sqlite_code, GetParam().lasting);
    const Status status = store->Commit(Batch(held + 1, kSerials), kNow);
    const bool failed = disk_.has_failed();
    disk_.Heal();
    if (!failed) break;
    ASSERT_FALSE(status) << "operation " << n;  // every one of them matters
    EXPECT_EQ(status.error().code, GetParam().reported) << status.error().text;
    EXPECT_EQ(BatchIn(*store->Load(), kSerials), held) << "operation " << n;
    // The disk works again, and so does the store.
    ++held;
    test::ExpectDone(store->Commit(Batch(held, kSerials), kNow));
    EXPECT_EQ(BatchIn(*store->Load(), kSerials), held);
  }
  EXPECT_GT(n, 3u);
  ++held;
  store.reset();
  EXPECT_EQ(BatchIn(*OpenStore()->Load(), kSerials), held);
}

// With 2000 serials a batch, the run reaches the 1000 pages at which SQLite moves the WAL into the
// file.
TEST_P(StoreFaults, ACheckpointMayFail) {
  constexpr std::uint32_t kSerials = 2000;
  const std::uint64_t seed = test::TestSeed(2);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  auto store = OpenStore(FaultyDisk::kVfsName);
  std::uint32_t held = 0;
  int failures = 0;
  for (int round = 0; round < 20; ++round) {
    disk_.FailAt(1 + rng.Below(250), GetParam().sqlite_code, GetParam().lasting);
    for (int i = 0; i < 5; ++i) {
      const Status status = store->Commit(Batch(held + 1, kSerials), kNow);
      if (status) ++held;
      failures += status ? 0 : 1;
    }
    disk_.Heal();
    ASSERT_EQ(BatchIn(*store->Load(), kSerials), held);
  }
  EXPECT_GT(failures, 4);
  disk_.Heal();
  store.reset();
  EXPECT_EQ(BatchIn(*OpenStore()->Load(), kSerials), held);
}

INSTANTIATE_TEST_SUITE_P(
    Disk, StoreFaults,
    ::testing::Values(Failure{"Once", SQLITE_IOERR_WRITE, false, ErrorCode::kUnavailable},
                      Failure{"UntilMended", SQLITE_IOERR_WRITE, true, ErrorCode::kUnavailable},
                      Failure{"Full", SQLITE_FULL, true, ErrorCode::kFull}),
    [](const auto& failure) { return failure.param.name; });

TEST_F(StoreTest, AcknowledgedBatchesSurvivePowerCuts) {
  constexpr std::uint32_t kSerials = 100;
  const std::uint64_t seed = test::TestSeed(3);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  FaultyDisk disk;
  auto store = OpenStore(FaultyDisk::kVfsName);
  for (std::uint32_t k = 1; k <= 40; ++k) {
    // Half of the cuts come within a batch: its operations fail from some point on, then the power
    // is cut.
    const bool within = rng.Below(2) == 0;
    if (within) disk.FailAt(1 + rng.Below(12), SQLITE_IOERR_WRITE, true);
    const Status status = store->Commit(Batch(k, kSerials), kNow);
    const std::string copy = folder_ / ("cut" + std::to_string(k) + ".db");
    disk.PowerCut(Path(), copy, &rng);
    disk.Heal();
    {
      auto after = Store::Open(copy);
      ASSERT_TRUE(after) << after.error().text;
      const auto fleet = (*after)->Load();
      ASSERT_TRUE(fleet) << fleet.error().text;
      const std::uint32_t held = BatchIn(*fleet, kSerials);
      // A batch whose commit failed may have reached the disk all the same, whole.
      ASSERT_TRUE(held == k || (!status && held + 1 == k)) << held << " after batch " << k;
    }
    for (const char* suffix : {"", "-wal", "-shm", ".lock"}) std::filesystem::remove(copy + suffix);
    if (!status) test::ExpectDone(store->Commit(Batch(k, kSerials), kNow));
  }
}

// Linux takes pages for clean that it failed to write. A batch that a later commit acknowledges may
// not depend on them.
TEST_F(StoreTest, AcknowledgedBatchesSurviveASyncThatFailsOnceAndAPowerCut) {
  constexpr std::uint32_t kSerials = 100;
  const std::uint64_t seed = test::TestSeed(6);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  for (std::uint32_t life = 1; life <= 20; ++life) {
    FaultyDisk disk;
    disk.DropAtFailedSyncs();
    const std::string path = folder_ / ("life" + std::to_string(life) + ".db");
    auto store = Store::Open(path, {.vfs = FaultyDisk::kVfsName});
    ASSERT_TRUE(store) << store.error().text;
    std::uint32_t held = 0;
    std::uint32_t offered = 0;
    const auto commit = [&] {
      ++offered;
      if ((*store)->Commit(Batch(offered, kSerials), kNow)) held = offered;
    };
    for (int k = 0; k < 4; ++k) commit();
    disk.FailAt(1 + rng.Below(3), SQLITE_IOERR_FSYNC, false, FaultyDisk::Kind::kSyncs);
    for (int k = 0; k < 4; ++k) commit();
    disk.Heal();
    for (std::uint64_t k = rng.Below(3); k > 0; --k) commit();
    const std::string copy = path + ".cut";
    disk.PowerCut(path, copy, &rng);
    auto after = Store::Open(copy);
    ASSERT_TRUE(after) << after.error().text;
    const auto fleet = (*after)->Load();
    ASSERT_TRUE(fleet) << fleet.error().text;
    ASSERT_GE(BatchIn(*fleet, kSerials), held) << "life " << life;
  }
}

TEST_F(StoreTest, EveryReadMayFail) {
  constexpr std::uint32_t kSerials = 300;
  FaultyDisk disk;
  test::ExpectDone(OpenStore()->Commit(Batch(1, kSerials), kNow));
  std::uint32_t held = 1;
  for (const bool lasting : {false, true}) {
    std::uint64_t n = 1;
    for (;; ++n) {
      ASSERT_LT(n, 1000u);
      disk.FailAt(n, SQLITE_IOERR_READ, lasting, FaultyDisk::Kind::kReads);
      Status status;
      auto store = Store::Open(Path(), {.vfs = FaultyDisk::kVfsName});
      if (store) {
        const auto fleet = (*store)->Load();
        if (fleet) {
          EXPECT_EQ(BatchIn(*fleet, kSerials), held) << "operation " << n;
        }
        status = (*store)->Commit(Batch(held + 1, kSerials), kNow);
        if (status) ++held;
      }
      const bool failed = disk.has_failed();
      disk.Heal();
      if (store && !status) {
        EXPECT_EQ(status.error().code, ErrorCode::kUnavailable) << status.error().text;
        test::ExpectDone((*store)->Commit(Batch(++held, kSerials), kNow));
      }
      store = tl::unexpected<Error>(Error{});
      ASSERT_EQ(BatchIn(*OpenStore()->Load(), kSerials), held) << "operation " << n;
      if (!failed) break;
    }
    EXPECT_GT(n, 10u);
  }
}

TEST_F(StoreTest, AWalCutOrGarbledAnywhereHoldsAWholeBatch) {
  constexpr std::uint32_t kSerials = 100;
  const std::uint64_t seed = test::TestSeed(4);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  auto store = OpenStore();
  for (std::uint32_t k = 1; k <= 40; ++k) test::ExpectDone(store->Commit(Batch(k, kSerials), kNow));
  std::ifstream in(Path() + "-wal", std::ios::binary);
  const std::string wal{std::istreambuf_iterator<char>(in), {}};
  const std::string copy = folder_ / "copy.db";
  std::uint32_t versions_below = 0;
  for (int i = 0; i < 60; ++i) {
    for (const char* suffix : {"", "-wal", "-shm"}) std::filesystem::remove(copy + suffix);
    std::filesystem::copy_file(Path(), copy);
    std::string damaged = wal;
    const std::size_t at = rng.Below(wal.size());
    if (i % 2 == 0) {
      damaged.resize(at);
    } else {
      damaged[at] = static_cast<char>(damaged[at] ^ static_cast<char>(1 + rng.Below(255)));
    }
    std::ofstream(copy + "-wal", std::ios::binary) << damaged;
    auto after = Store::Open(copy);
    ASSERT_TRUE(after) << after.error().text;
    const auto fleet = (*after)->Load();
    ASSERT_TRUE(fleet) << fleet.error().text;
    versions_below += BatchIn(*fleet, kSerials) < 40 ? 1u : 0u;
  }
  EXPECT_GT(versions_below, 30u);
}

// A child commits batch after batch and writes the number of each acknowledged one.
[[noreturn]] void CommitForEver(const std::string& path, std::uint32_t k, std::uint32_t serials,
                                int acknowledge) {
  auto store = Store::Open(path);
  if (!store) _exit(2);
  for (;; ++k) {
    if (!(*store)->Commit(Batch(k, serials), kNow)) _exit(3);
    if (write(acknowledge, &k, sizeof k) != static_cast<ssize_t>(sizeof k)) _exit(4);
  }
}

TEST_F(StoreTest, AcknowledgedBatchesSurviveKill) {
  constexpr std::uint32_t kSerials = 500;
  const std::uint64_t seed = test::TestSeed(5);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  std::uint32_t held = 0;
  for (int round = 0; round < 25; ++round) {
    int pipe_ends[2];
    ASSERT_EQ(pipe2(pipe_ends, O_CLOEXEC), 0);
    const pid_t child = fork();
    if (child == 0) CommitForEver(Path(), held + 1, kSerials, pipe_ends[1]);
    close(pipe_ends[1]);
    std::uint32_t acknowledged = held;
    for (std::uint64_t n = rng.Below(20); n > 0; --n) {
      ASSERT_EQ(read(pipe_ends[0], &acknowledged, sizeof acknowledged),
                static_cast<ssize_t>(sizeof acknowledged));
    }
    // The kill comes somewhere within the next batch.
    std::atomic<std::uint64_t> spin = 1 + rng.Below(2'000'000);
    while (spin.fetch_sub(1) > 1) {
    }
    kill(child, SIGKILL);
    waitpid(child, nullptr, 0);
    while (read(pipe_ends[0], &acknowledged, sizeof acknowledged) ==
           static_cast<ssize_t>(sizeof acknowledged)) {
    }
    close(pipe_ends[0]);
    auto store = OpenStore();
    const auto fleet = store->Load();
    ASSERT_TRUE(fleet) << fleet.error().text;
    held = BatchIn(*fleet, kSerials);
    // The next batch may be durable, too: killed between its commit and its acknowledgement.
    ASSERT_TRUE(held == acknowledged || held == acknowledged + 1)
        << "holds " << held << ", acknowledged " << acknowledged;
  }
  EXPECT_GT(held, 25u);
}

}  // namespace
}  // namespace focalfleet
