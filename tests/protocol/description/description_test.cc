#include "protocol/description/description.h"

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <set>

#include "protocol/wire/codec.h"
#include "tests/protocol/random_messages.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

std::string Read(const std::string& path) {
  std::ifstream in(FOCALFLEET_SOURCE_DIR "/" + path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

TEST(Description, TheCommittedDbcFileIsWhatTheTablesSay) {
  EXPECT_EQ(Read("protocol/focalfleet.dbc"), DbcText()) << "build the target write_descriptions";
}

TEST(Description, TheCommittedDissectorIsWhatTheTablesSay) {
  EXPECT_EQ(Read("protocol/focalfleet.lua"), DissectorText())
      << "build the target write_descriptions";
}

TEST(Description, TheProtocolsPageHasTheFramesOfTheTables) {
  const std::string page = Read("docs/protocol.md");
  const std::string begin = "<!-- frames: begin (describe_protocol frames) -->\n\n";
  const std::size_t from = page.find(begin);
  const std::size_t to = page.find("<!-- frames: end -->");
  ASSERT_NE(from, std::string::npos);
  ASSERT_NE(to, std::string::npos);
  EXPECT_EQ(page.substr(from + begin.size(), to - from - begin.size()), FramesPage())
      << "paste what `describe_protocol frames` prints";
}

TEST(Description, EveryFrameHasOneNameAndOneIdentifier) {
  std::set<std::string> names;
  std::set<std::uint32_t> ids;
  for (const DescribedFrame& frame : DescribedFrames()) {
    EXPECT_TRUE(names.insert(frame.name).second) << frame.name;
    EXPECT_TRUE(ids.insert(frame.id).second) << frame.name;
    EXPECT_EQ(frame.id & ~kDescribedIdentifierBits, 0u) << frame.name;
  }
}

TEST(MessageRows, FieldsOfARowLieWithinItAndApart) {
  for (const MessageRow& row : MessageRows()) {
    std::uint64_t taken = 0;
    for (const FieldRow& field : row.fields) {
      EXPECT_LE(field.min, field.max) << row.name << "." << field.name;
      if (field.in_detail) {
        EXPECT_LE(field.max, 7) << row.name << "." << field.name;
        continue;
      }
      ASSERT_LE(field.first_bit + field.bits, 8 * row.length) << row.name << "." << field.name;
      const std::uint64_t mask = ((std::uint64_t{1} << field.bits) - 1) << field.first_bit;
      EXPECT_EQ(taken & mask, 0u) << row.name << "." << field.name;
      taken |= mask;
    }
  }
}

TEST(MessageRows, TheRowOfAFrameIsItsMessages) {
  const std::uint64_t seed = test::TestSeed(5);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  for (int i = 0; i < 5000; ++i) {
    const HostMessage host = test::RandomHost(rng);
    const UnitMessage unit = test::RandomUnit(rng);
    const CanFrame from_host = Encode(host, {{1}, 2});
    const CanFrame from_unit = Encode(unit, {{1}, 2});
    ASSERT_NE(RowOf(from_host), nullptr) << test::Show(host);
    EXPECT_FALSE(RowOf(from_host)->from_unit);
    ASSERT_NE(RowOf(from_unit), nullptr) << test::Show(unit);
    EXPECT_TRUE(RowOf(from_unit)->from_unit);
    for (const CanFrame& frame : {from_host, from_unit}) {
      for (const FieldRow& field : RowOf(frame)->fields) {
        EXPECT_GE(ValueOf(field, frame), field.min) << field.name;
        EXPECT_LE(ValueOf(field, frame), field.max) << field.name;
      }
    }
  }
}

}  // namespace
}  // namespace focalfleet
