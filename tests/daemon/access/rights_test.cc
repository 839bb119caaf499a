#include "daemon/access/rights.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <set>
#include <string>

#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

using ::testing::HasSubstr;

Caller Of(Role role) { return {.role = role, .peer = Peer{.pid = 7, .uid = 1000}}; }

TEST(Rights, EachRoleMayDoAllThatTheOnesBeforeItMay) {
  EXPECT_TRUE(CheckRight(Of(Role::kViewer), "status", {}));
  EXPECT_FALSE(CheckRight(Of(Role::kViewer), "apply", {}));
  EXPECT_TRUE(CheckRight(Of(Role::kOperator), "apply", {}));
  EXPECT_FALSE(CheckRight(Of(Role::kOperator), "adopt", {}));
  for (const Right& right : Rights()) {
    EXPECT_TRUE(CheckRight(Of(Role::kEngineer), right.verb, {})) << right.verb;
    EXPECT_FALSE(CheckRight(Of(Role::kNone), right.verb, {})) << right.verb;
  }
}

TEST(Rights, StopIsForEveryRole) {
  for (const Role role : {Role::kViewer, Role::kOperator, Role::kEngineer})
    EXPECT_TRUE(CheckRight(Of(role), "stop", {})) << Name(role);
}

TEST(Rights, AViewerChangesNothingButAStop) {
  for (const Right& right : Rights())
    EXPECT_EQ(right.changes && CheckRight(Of(Role::kViewer), right.verb, {}),
              std::string(right.verb) == "stop")
        << right.verb;
}

TEST(Rights, ALineIsAsLongAsItsCallersLongestRequest) {
  EXPECT_EQ(LineBytesMaxOf(Role::kViewer), limits::kViewerLineBytes);
  EXPECT_EQ(LineBytesMaxOf(Role::kOperator), limits::kControlLineBytes);
  EXPECT_EQ(LineBytesMaxOf(Role::kEngineer), limits::kModelLineBytes);
}

TEST(Rights, AFlagMayTakeMoreThanItsVerb) {
  const Caller caller = Of(Role::kOperator);
  EXPECT_TRUE(CheckRight(caller, "home", {{"not_known", true}}));
  EXPECT_TRUE(CheckRight(caller, "home", {{"unproven", false}}));
  for (const nlohmann::json& given : {nlohmann::json(true), nlohmann::json(1), nlohmann::json("")})
    EXPECT_FALSE(CheckRight(caller, "home", {{"unproven", given}})) << given;
  EXPECT_TRUE(CheckRight(Of(Role::kEngineer), "home", {{"unproven", true}}));
}

TEST(Rights, ARefusalNamesCallerVerbAndRole) {
  const Status refused = CheckRight(Of(Role::kViewer), "apply", {});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kRefused);
  EXPECT_EQ(refused.error().text,
            "uid 1000 (viewer, pid 7) may not apply: it takes the role operator");
  const Status unknown = CheckRight(Of(Role::kEngineer), "fly", {});
  ASSERT_FALSE(unknown);
  EXPECT_EQ(unknown.error().code, ErrorCode::kInvalid);
}

TEST(Rights, VerbsAreUniqueAndAscendByRole) {
  std::set<std::string> verbs;
  Role before = Role::kViewer;
  for (const Right& right : Rights()) {
    EXPECT_TRUE(verbs.insert(right.verb).second) << right.verb;
    EXPECT_GE(right.least, before) << right.verb;
    before = right.least;
  }
}

TEST(Rights, ACallerLearnsWhatItMayDo) {
  const nlohmann::json access =
      AccessJson({.role = Role::kOperator, .door = Door::kHttp, .token = "night"});
  EXPECT_EQ(access["name"], "token night");
  EXPECT_EQ(access["door"], "http");
  EXPECT_EQ(access["role"], "operator");
  EXPECT_EQ(access["verbs"].size(), Rights().size());
  for (const auto& verb : access["verbs"]) {
    EXPECT_EQ(verb["allowed"], verb["least"] != "engineer") << verb;
    if (verb["verb"] == "home") {
      EXPECT_EQ(verb["flag_allowed"], false);
    }
  }
}

/// The rows of the table of verbs in docs/access.md: | `verb` | role |
TEST(Rights, ThePageHasTheSameTable) {
  std::ifstream page(std::string(FOCALFLEET_SOURCE_DIR) + "/docs/access.md");
  ASSERT_TRUE(page);
  std::set<std::string> shown;
  for (std::string line; std::getline(page, line);)
    if (line.starts_with("| `"))
      shown.insert(line.substr(0, line.find('|', line.find('|', 2) + 1)));
  std::set<std::string> rows;
  for (const Right& right : Rights()) {
    rows.insert("| `" + std::string(right.verb) + "` | " + Name(right.least) + " ");
    if (right.flag_least > right.least)
      rows.insert("| `" + std::string(right.verb) + " " + right.flag + "` | " +
                  Name(right.flag_least) + " ");
  }
  EXPECT_EQ(shown, rows);
}

}  // namespace
}  // namespace focalfleet
