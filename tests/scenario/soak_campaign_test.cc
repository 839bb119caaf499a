// Lines of seeds: what a killed task leaves behind, seeds that ran twice, and the table of all.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "daemon/soak/campaign.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet::soak {
namespace {

TEST(Soak, SeedsAreReadAsRangeOrNumber) {
  EXPECT_EQ(ParseSeeds("7")->last, 7u);
  EXPECT_EQ(ParseSeeds("2..9")->last, 9u);
  for (const char* wrong : {"", "a", "9..2", "1..", "..3", "1-3"})
    EXPECT_FALSE(ParseSeeds(wrong)) << wrong;
}

Json LineOf(std::uint64_t seed, std::uint64_t digest, const std::string& program,
            const std::string& broken = {}) {
  NightResult result{.seed = seed, .broken = {}, .digest = digest};
  if (!broken.empty()) result.broken = {broken};
  Json line = JsonOf(result, DrawSeed(seed, {.units = 12}));
  line["program"] = program;
  return line;
}

TEST(SoakSummary, NamesFailedSeedsAndTakesEachOnce) {
  const Draws draws = DrawSeed(5, {});
  NightResult result{.seed = 5, .broken = {"1.0 s: place: unit 3 is elsewhere"}};
  Summary summary;
  for (int n = 0; n < 2; ++n) ASSERT_TRUE(summary.Take(JsonOf(result, draws)));
  EXPECT_EQ(summary.seeds(), 1u);
  EXPECT_EQ(summary.Failed().at(5), result.broken[0]);
  EXPECT_TRUE(summary.differing().empty());
  EXPECT_FALSE(summary.Take(Json{{"seed", 6}}));
}

TEST(SoakSummary, TheNewestLineOfASeedCounts) {
  Summary summary;
  ASSERT_TRUE(summary.Take(LineOf(5, 1, "0.1.0+gaaaa", "1.0 s: place: unit 3 is elsewhere")));
  ASSERT_TRUE(summary.Take(LineOf(5, 2, "0.1.0+gbbbb")));
  EXPECT_TRUE(summary.Failed().empty()) << "the fault is mended";
  EXPECT_EQ(summary.differing().at(5), false) << "by two programs";
  EXPECT_TRUE(summary.Good());
}

TEST(SoakSummary, TwoRunsOfOneProgramMustNotDiffer) {
  for (const char* program : {"0.1.0+gaaaa", "0.1.0+gaaaa-changed", "0.1.0"}) {
    Summary summary;
    for (const std::uint64_t digest : {1u, 2u})
      ASSERT_TRUE(summary.Take(LineOf(5, digest, program)));
    const bool one_program = std::string(program) == "0.1.0+gaaaa";
    EXPECT_EQ(summary.Good(), !one_program) << program;
    EXPECT_NE(summary.Table().find("seed 5: its lines differ"), std::string::npos);
  }
}

class SoakFolder : public testing::Test {
 protected:
  void Append(const std::string& file, const std::string& text) const {
    std::ofstream(scratch_ / file, std::ios::app) << text;
  }
  [[nodiscard]] Summary Merged(const SeedRange& seeds) const {
    auto merged = MergeFolder(scratch_.path(), seeds);
    EXPECT_TRUE(merged) << merged.error().text;
    return merged ? std::move(*merged) : Summary();
  }
  [[nodiscard]] bool RunsAgain(std::uint64_t seed) const {
    return RunCampaign({.seeds = {seed, seed},
                        .minutes = {},
                        .units = 2,
                        .json_folder = scratch_.path(),
                        .print = [](const std::string&) {}})
        .has_value();
  }

  test::ScratchFolder scratch_;
};

TEST_F(SoakFolder, ASeedWhoseLineWasCutRunsAgain) {
  const std::string line = LineOf(9, 1, "0.1.0").dump();
  for (const std::size_t size : {std::size_t{1}, line.size() / 2, line.size() - 1}) {
    Append("seeds-9-9.jsonl", line.substr(0, size));
    EXPECT_FALSE(Merged({1, 9}).has(9));
    ASSERT_TRUE(RunsAgain(9));
    EXPECT_TRUE(Merged({1, 9}).has(9));
    std::filesystem::remove(scratch_ / "seeds-9-9.jsonl");
  }
}

TEST_F(SoakFolder, AWholeLineWithoutItsEndCountsToo) {
  Append("seeds-9-9.jsonl", LineOf(9, 1, "0.1.0").dump());
  EXPECT_TRUE(Merged({9, 9}).has(9));
  ASSERT_TRUE(RunsAgain(9));
  EXPECT_NE(Merged({9, 9}).Table().find("seed 9: its lines differ"), std::string::npos);
}

TEST_F(SoakFolder, LinesOfOtherSeedsCountForNothing) {
  for (const std::uint64_t seed : {3u, 4u, 5u})
    Append("seeds-3-5.jsonl", LineOf(seed, 1, "0.1.0", "1.0 s: place").dump() + "\n");
  const Summary merged = Merged({4, 4});
  EXPECT_EQ(merged.seeds(), 1u);
  EXPECT_EQ(merged.Failed().size(), 1u);
}

TEST_F(SoakFolder, AFileThatIsNoListOfSeedsIsRefused) {
  Append("other.jsonl", "seed 3 passed\n");
  EXPECT_FALSE(MergeFolder(scratch_.path(), {1, 9}));
}

}  // namespace
}  // namespace focalfleet::soak
