// Memory ends within SQLite: at the n-th allocation of a commit, for every n, once and lasting. A
// program of its own, because SQLite takes its allocator once a process.
#include <sqlite3.h>

#include "daemon/store/store.h"
#include "tests/daemon/store/store_fixture.h"

namespace focalfleet {
namespace {

using test::Batch;
using test::BatchIn;
using test::StoreTest;

/// SQLite's own allocator, which fails at the n-th allocation from Arm on.
struct Memory {
  static inline sqlite3_mem_methods real;
  static inline std::uint64_t fail_at = 0;  // 0: never
  static inline std::uint64_t count = 0;
  static inline bool lasting = false;
  static inline bool has_failed = false;

  static bool Fails() {
    ++count;
    const bool fails = fail_at != 0 && (lasting ? count >= fail_at : count == fail_at);
    has_failed = has_failed || fails;
    return fails;
  }
  static void Arm(std::uint64_t n, bool for_ever) {
    fail_at = n;
    count = 0;
    lasting = for_ever;
    has_failed = false;
  }
  static void Install() {
    ASSERT_EQ(sqlite3_config(SQLITE_CONFIG_GETMALLOC, &real), SQLITE_OK);
    sqlite3_mem_methods faulty = real;
    faulty.xMalloc = [](int size) { return Fails() ? nullptr : real.xMalloc(size); };
    faulty.xRealloc = [](void* old, int size) {
      return Fails() ? nullptr : real.xRealloc(old, size);
    };
    ASSERT_EQ(sqlite3_config(SQLITE_CONFIG_MALLOC, &faulty), SQLITE_OK);
    // Otherwise most allocations come from pools that never fail.
    ASSERT_EQ(sqlite3_config(SQLITE_CONFIG_LOOKASIDE, 0, 0), SQLITE_OK);
  }
};

class StoreMemory : public StoreTest, public ::testing::WithParamInterface<bool> {
 protected:
  static void SetUpTestSuite() {
    static const bool once = [] {
      Memory::Install();
      return true;
    }();
    ASSERT_TRUE(once);
  }
};

TEST_P(StoreMemory, EveryAllocationOfACommitMayFail) {
  constexpr std::uint32_t kSerials = 20;
  std::uint32_t held = 0;
  std::uint64_t n = 1;
  for (;; ++n) {
    ASSERT_LT(n, 5000u);
    // A new connection has the most to allocate.
    auto store = OpenStore();
    if (held == 0) test::ExpectDone(store->Commit(Batch(++held, kSerials), test::kEight));
    Memory::Arm(n, GetParam());
    const Status status = store->Commit(Batch(held + 1, kSerials), test::kEight);
    const bool failed = Memory::has_failed;
    Memory::Arm(0, false);
    if (status) ++held;
    const auto fleet = store->Load();
    ASSERT_TRUE(fleet) << "allocation " << n << ": " << fleet.error().text;
    EXPECT_EQ(BatchIn(*fleet, kSerials), held) << "allocation " << n;
    // The first attempt with memory succeeds.
    const Status next = store->Commit(Batch(held + 1, kSerials), test::kEight);
    ASSERT_TRUE(next) << "allocation " << n << ": " << next.error().text;
    ++held;
    if (!failed) break;
  }
  EXPECT_GT(n, 5u);
}

INSTANTIATE_TEST_SUITE_P(Fails, StoreMemory, ::testing::Bool(),
                         [](const auto& lasting) { return lasting.param ? "ForEver" : "Once"; });

}  // namespace
}  // namespace focalfleet
