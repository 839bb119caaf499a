#include "daemon/metrics/process_facts.h"

#include <gtest/gtest.h>

#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

TEST(ProcessFacts, AreThoseOfThisProcess) {
  const ProcessFacts facts = ReadProcessFacts();
  EXPECT_GE(facts.cpu_s, 0);
  EXPECT_GT(facts.resident_bytes, 1'000'000u);
  EXPECT_GT(facts.virtual_bytes, facts.resident_bytes);
  EXPECT_GE(facts.open_descriptors, 3u);
  EXPECT_GE(facts.descriptors_max, facts.open_descriptors);
  EXPECT_GE(facts.threads, 1u);
}

TEST(ProcessFacts, StoreIsAsLargeAsItsFiles) {
  const test::ScratchFolder scratch;
  const std::string path = scratch / "f.db";
  EXPECT_EQ(StoreBytes(path), 0u);
  scratch.Put("f.db", std::string(1000, 'x'));
  EXPECT_EQ(StoreBytes(path), 1000u);
  scratch.Put("f.db-wal", std::string(50, 'x'));
  EXPECT_EQ(StoreBytes(path), 1050u);
}

}  // namespace
}  // namespace focalfleet
