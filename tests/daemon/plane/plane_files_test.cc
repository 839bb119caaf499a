// The files in which a sector and a coordinator of a plane remember what must not be lost.
#include <gtest/gtest.h>

#include <fstream>

#include "daemon/plane/plane_record_file.h"
#include "daemon/plane/sector_memory.h"
#include "fleet/hex_layout.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

Layout Twenty() { return std::move(*Layout::Create(MakeHexLayout({.count = 20}), {})); }

TEST(SectorMemory, CountsLivesAndKeepsTheEpoch) {
  const test::ScratchFolder scratch;
  const std::string path = scratch / "store.sector";
  auto first = SectorMemory::BeginLife(path);
  ASSERT_TRUE(first.has_value()) << first.error().text;
  EXPECT_EQ(first->life(), 1u);
  EXPECT_EQ(first->epoch(), PlaneEpoch{});
  ASSERT_TRUE(first->Keep({5, 77}).has_value());
  const auto second = SectorMemory::BeginLife(path);
  ASSERT_TRUE(second.has_value());
  EXPECT_EQ(second->life(), 2u);
  EXPECT_EQ(second->epoch(), (PlaneEpoch{5, 77}));
}

TEST(SectorMemory, RefusesAnotherFile) {
  const test::ScratchFolder scratch;
  std::ofstream(scratch / "f") << "unit_id,x_mm\n";
  const auto memory = SectorMemory::BeginLife(scratch / "f");
  ASSERT_FALSE(memory.has_value());
  EXPECT_EQ(memory.error().code, ErrorCode::kInvalid);
}

TEST(PlaneRecordFile, KeepsTheConfigurationUnderWay) {
  const test::ScratchFolder scratch;
  const Layout layout = Twenty();
  const std::string path = scratch / "plane.json";
  PlaneRecord record{.epoch = {6, 1234}, .next_configuration = 9, .under_way = {}};
  record.under_way =
      PlaneConfiguration{.id = 8, .source = "night \"1\".csv", .fixed = true, .targets = {}};
  record.under_way->targets.resize(20);
  record.under_way->target_ids.resize(20);
  record.under_way->targets[4] = Pose{-100, 2000};
  record.under_way->target_ids[4] = "star";
  record.under_way->changes.emplace(3, PositionerIndex{4});
  record.under_way->measure = ApplyCommand::Measure{2, 7.5, false};
  record.last = PlaneConfiguration{.id = 7, .source = "before", .targets = {}};
  record.last->targets.resize(20);
  record.last->target_ids.resize(20);
  record.last->targets[9] = Pose{3, 4};
  record.last->kind = ConfigurationKind::kHome;
  record.last->to_home = {{2}, {5}};
  record.last->unproven = true;
  record.last_state = ConfigurationState::kStopped;
  {
    auto file = PlaneRecordFile::Open(path, layout, 1234);
    ASSERT_TRUE(file.has_value()) << file.error().text;
    EXPECT_EQ((*file)->content().coordinator, 1234u);
    EXPECT_FALSE(PlaneRecordFile::Open(path, layout, 5).has_value()) << "it is locked";
    ASSERT_TRUE((*file)->Keep(record).has_value());
  }
  const auto again = PlaneRecordFile::Open(path, layout, 5);
  ASSERT_TRUE(again.has_value()) << again.error().text;
  EXPECT_EQ((*again)->content().coordinator, 1234u);
  EXPECT_EQ((*again)->content().record.epoch, record.epoch);
  EXPECT_EQ((*again)->content().record.next_configuration, 9u);
  EXPECT_EQ((*again)->content().record.under_way, record.under_way);
  EXPECT_EQ((*again)->content().record.last, record.last);
  EXPECT_EQ((*again)->content().record.last_state, ConfigurationState::kStopped);
}

TEST(PlaneRecordFile, RefusesWhatIsNone) {
  const Layout layout = Twenty();
  for (
      const char* text :
      {"", "[]", "{}", "{\"coordinator\":1,\"epoch\":-2,\"next_configuration\":1}",
       "{\"coordinator\":1,\"epoch\":2,\"next_configuration\":1,\"under_way\":{}}",
       "{\"coordinator\":1,\"epoch\":2,\"next_configuration\":1,\"under_way\":{\"id\":1,\"source\":"
       "\"s\",\"fixed\":false,\"targets\":[[999,1,1,\"\"]]}}",
       "{\"coordinator\":1,\"epoch\":2,\"next_configuration\":1,\"under_way\":{\"id\":1,\"source\":"
       "\"s\",\"fixed\":false,\"targets\":[[1,99999999999,1,\"\"]]}}",
       "{\"coordinator\":1,\"epoch\":2,\"next_configuration\":1,\"under_way\":{\"id\":1,\"source\":"
       "\"s\",\"fixed\":false,\"targets\":[[1,-9223372036854775808,1,\"\"]]}}",
       "{\"coordinator\":1,\"epoch\":2,\"next_configuration\":1,\"under_way\":{\"id\":1,\"source\":"
       "\"s\",\"fixed\":false,\"targets\":[[1,18446744073709551615,1,\"\"]]}}",
       "{\"coordinator\":1,\"epoch\":2,\"next_configuration\":1,\"under_way\":{\"id\":1,\"source\":"
       "\"s\",\"fixed\":false,\"targets\":[[4294967297,1,1,\"\"]]}}",
       "{\"coordinator\":1,\"epoch\":2,\"next_configuration\":1,\"under_way\":{\"id\":1,\"source\":"
       "\"s\",\"fixed\":false,\"targets\":[],\"kind\":\"home\",\"to_home\":[999]}}",
       "{\"coordinator\":1,\"epoch\":2,\"next_configuration\":1,\"under_way\":{\"id\":1,\"source\":"
       "\"s\",\"fixed\":false,\"targets\":[],\"kind\":\"apply\",\"changes\":[[1,2]]}}",
       "{\"coordinator\":1,\"epoch\":2,\"next_configuration\":1,\"under_way\":{\"id\":1,\"source\":"
       "\"s\",\"fixed\":false,\"targets\":[],\"kind\":\"apply\",\"measure\":{\"corrections\":-1}}}",
       "{\"coordinator\":1,\"epoch\":2,\"next_configuration\":1,\"last\":{\"id\":1,\"source\":"
       "\"s\","
       "\"fixed\":false,\"targets\":[]},\"last_state\":\"moving\"}"}) {
    const test::ScratchFolder scratch;
    std::ofstream(scratch / "plane.json") << text;
    const auto file = PlaneRecordFile::Open(scratch / "plane.json", layout, 5);
    ASSERT_FALSE(file.has_value()) << text;
    EXPECT_EQ(file.error().code, ErrorCode::kInvalid) << text;
  }
}

}  // namespace
}  // namespace focalfleet
