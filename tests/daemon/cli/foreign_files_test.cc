// Files as other programs write them. Known columns are read, others are passed over and reported
// once, and a refusal names all that is wrong.
#include <gmock/gmock.h>

#include <algorithm>
#include <functional>
#include <sstream>

#include "daemon/control/messages.h"
#include "tests/daemon/cli/program.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using test::Focalfleet;
using test::ProgramResult;
using test::ScratchFolder;
using test::Slurp;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

std::vector<std::string> Lines(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

/// Returns the text with each line as `change` makes it; line 0 is the header.
std::string Changed(const std::string& csv,
                    const std::function<std::string(std::size_t, const std::string&)>& change) {
  std::string text;
  std::size_t k = 0;
  for (const std::string& line : Lines(csv)) text += change(k++, line) + "\n";
  return text;
}

std::string WithIndex(const std::string& csv) {
  return Changed(csv, [](std::size_t k, const std::string& line) {
    return (k == 0 ? "" : std::to_string(k - 1)) + "," + line;
  });
}

class ForeignFiles : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_EQ(Focalfleet({"layout", "hex", "--count", "60", "--out", units_}).exit, 0);
    ASSERT_EQ(Draw("1", {"--as", "state", "--out", state_}).exit, 0);
    ASSERT_EQ(Draw("2", {"--out", targets_}).exit, 0);
  }
  [[nodiscard]] ProgramResult Draw(const std::string& seed, std::vector<std::string> more) const {
    std::vector<std::string> words = {"targets", "--units", units_, "--seed", seed};
    words.insert(words.end(), more.begin(), more.end());
    return Focalfleet(words);
  }
  [[nodiscard]] ProgramResult Plan(std::vector<std::string> more = {}) const {
    std::vector<std::string> words = {"plan",   "--units", units_,  "--targets", targets_,
                                      "--from", state_,    "--out", plan_};
    words.insert(words.end(), more.begin(), more.end());
    return Focalfleet(words);
  }
  void Put(std::string* file, const std::string& text) { *file = scratch_.Put("changed", text); }

  ScratchFolder scratch_;
  std::string units_ = scratch_ / "units.csv";
  std::string state_ = scratch_ / "state.csv";
  std::string targets_ = scratch_ / "targets.csv";
  std::string plan_ = scratch_ / "plan.csv";
};

TEST_F(ForeignFiles, AnIndexWithoutANameIsReportedOnce) {
  for (std::string* file : {&units_, &targets_}) {
    const std::string before = *file;
    Put(file, WithIndex(Slurp(before)));
    const auto result = Plan();
    EXPECT_EQ(result.exit, 0) << result.err;
    EXPECT_EQ(result.err, "focalfleet: " + *file + ": columns passed over: column 1 (no name)\n");
    EXPECT_THAT(Plan({"-q"}).err, IsEmpty());
    EXPECT_THAT(Plan({"--json"}).err, IsEmpty());
    *file = before;
  }
  state_ = scratch_.Put("s.csv", WithIndex(Slurp(state_)));
  EXPECT_EQ(Plan().exit, 0);
}

TEST_F(ForeignFiles, PassedOverColumnsAreOneLineHoweverManyThereAre) {
  Put(&targets_, Changed(Slurp(targets_), [](std::size_t k, std::string line) {
    for (int column = 0; column < 900; ++column)
      line += k == 0 ? ",mag_" + std::to_string(column) : ",1";
    return line;
  }));
  const auto result = Plan();
  EXPECT_EQ(result.exit, 0) << result.err;
  const auto lines = Lines(result.err);
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_THAT(lines[0], HasSubstr("mag_0, mag_1, "));
  EXPECT_THAT(lines[0], HasSubstr("mag_19 and 880 more"));
}

TEST_F(ForeignFiles, FlagsAreReadAsPandasAndAstropyWriteThem) {
  const std::string good = Slurp(units_);
  const auto header = Lines(good)[0];
  const auto column = static_cast<std::size_t>(
      std::count(header.begin(), header.begin() + static_cast<long>(header.find("enabled")), ','));
  Put(&units_, Changed(good, [&](std::size_t k, std::string line) {
    if (k == 0) return line;
    std::size_t at = 0;
    for (std::size_t c = 0; c < column; ++c) at = line.find(',', at) + 1;
    return line.replace(at, 1, k % 7 == 0 ? "False" : "True");
  }));
  const auto result = Plan({"--json"});
  EXPECT_EQ(result.exit, 3) << result.err;  // every seventh is disabled and has a target
  const Json reported = Json::parse(result.out);
  const Json& unserved = reported["unserved"];
  EXPECT_EQ(std::count_if(unserved.begin(), unserved.end(),
                          [](const Json& one) { return one["why"] == "disabled"; }),
            8);
}

TEST_F(ForeignFiles, AllBadRowsAreReportedAtOnce) {
  Put(&targets_, Changed(Slurp(targets_), [](std::size_t k, const std::string& line) {
    if (k == 0 || k % 10 != 9) return line;
    return line.substr(0, line.find(',')) + ",999,0";
  }));
  const auto result = Plan({"--json"});
  EXPECT_EQ(result.exit, 1);
  const auto lines = Lines(result.err);
  ASSERT_EQ(lines.size(), 6u) << result.err;
  for (std::size_t k = 0; k < 6; ++k) {
    EXPECT_THAT(lines[k], HasSubstr(targets_ + ":" + std::to_string(10 * (k + 1)) + ": unit "));
    EXPECT_THAT(lines[k], HasSubstr("out of patrol"));
  }
  const Json reported = Json::parse(result.out);
  EXPECT_EQ(reported["error"]["code"], "invalid");
  EXPECT_EQ(Lines(reported["error"]["text"].get<std::string>()).size(), 6u);
  EXPECT_THAT(scratch_.List(), Not(Contains("plan.csv")));
}

TEST_F(ForeignFiles, MoreThanTwentyBadRowsAreCounted) {
  Put(&targets_, Changed(Slurp(targets_), [](std::size_t k, const std::string& line) {
    return k < 31 ? line : line.substr(0, line.find(',')) + ",-999,-999";
  }));
  const auto lines = Lines(Plan().err);
  ASSERT_EQ(lines.size(), 21u);
  EXPECT_EQ(lines[20], "  and 10 more rows; all 30: out of patrol (30)");
}

TEST_F(ForeignFiles, WhatIsNoTextIsCalledByItsName) {
  using namespace std::string_literals;
  const std::pair<std::string, const char*> cases[] = {
      {"SIMPLE  =                    T" + std::string(2850, ' ') + "\0\xff"s,
       "unit 0: its header does not end"},
      {"\x1f\x8b\x08\0\0\0"s, "its gzip stream is cut short"},
      {"PK\x03\x04[Content_Types].xml"s, "this is a spreadsheet"},
      {"\xff\xfeu\0n\0"s, "this is text in UTF-16"},
  };
  for (const auto& [bytes, reported] : cases) {
    const std::string good = targets_;
    Put(&targets_, bytes);
    const auto result = Plan();
    EXPECT_EQ(result.exit, 1);
    EXPECT_THAT(result.err, HasSubstr("changed: "s + reported));
    targets_ = good;
  }
}

TEST_F(ForeignFiles, AStateThatLacksAUnitIsRefusedByWhoPlansFromIt) {
  Put(&state_, Changed(Slurp(state_), [](std::size_t k, const std::string& line) {
    return k == 5 || k == 7 ? "# gone" : line;
  }));
  const std::string complaint =
      state_ + ": no row for units 5, 7: where they stand is needed to keep clear of them";
  EXPECT_EQ(Plan().exit, 1);
  EXPECT_THAT(Plan().err, HasSubstr(complaint));
  EXPECT_THAT(scratch_.List(), Not(Contains("plan.csv")));
  const auto estimate =
      Focalfleet({"estimate", "--units", units_, "--targets", targets_, "--from", state_});
  EXPECT_EQ(estimate.exit, 1);
  EXPECT_THAT(estimate.err, HasSubstr(complaint));
  // A draw of targets needs nothing of the state but the disabled units.
  EXPECT_EQ(Draw("3", {"--from", state_, "--out", scratch_ / "t3.csv"}).exit, 0);
}

TEST_F(ForeignFiles, ACampaignWithColumnsOfWordsIsDiagnosedAndTheyAreReportedOnce) {
  const std::string folder = scratch_ / "night";
  ASSERT_EQ(Focalfleet({"simulate", "campaign", "--out", folder, "--units", "12", "--moves", "12",
                        "--seed", "1"})
                .exit,
            0);
  const std::string moves = folder + "/moves.csv";
  const std::string changed = scratch_.Put(
      "night/moves.csv",
      Changed(WithIndex(Slurp(moves)), [](std::size_t k, const std::string& line) {
        if (k == 0) return line + ",pos_id,ok,note";
        return line + ",M" + std::to_string(k % 12) + (k == 4 ? ",True,7" : ",False,arc");
      }));
  const auto result = Focalfleet({"diagnose", folder, "--out", scratch_ / "report"});
  EXPECT_EQ(result.exit, 0) << result.err;
  std::vector<std::string> reported = Lines(result.err);
  std::erase_if(reported, [](const std::string& line) {
    return line.find("columns passed over") == std::string::npos;  // the progress
  });
  EXPECT_THAT(reported,
              ElementsAre("focalfleet: " + moves +
                          ": columns passed over: column 1 (no name), pos_id, note (not all "
                          "numbers: 'arc' in line 2)"));
  EXPECT_THAT(Focalfleet({"diagnose", folder, "--out", scratch_ / "again", "-q"}).err, IsEmpty());
}

}  // namespace
}  // namespace focalfleet
