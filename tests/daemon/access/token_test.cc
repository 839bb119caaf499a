#include "daemon/access/token.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>
#include <string>
#include <utility>
#include <vector>

#include "daemon/access/token_register.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr WallTime kNow{1'700'000'000'000'000'000};
constexpr std::int64_t kNowS = kNow.ns / 1'000'000'000;
constexpr std::int64_t kDayS = 86'400;

void Write(const std::string& path, const std::string& text, mode_t mode = 0640) {
  const std::string beside = path + ".new";
  std::ofstream(beside) << text;
  ::chmod(beside.c_str(), mode);
  ASSERT_EQ(::rename(beside.c_str(), path.c_str()), 0);
}

TEST(Token, TheFileDoesNotHaveTheSecret) {
  std::vector<Token> tokens;
  const auto secret = AddToken("page", Role::kViewer, kNowS, kNowS + kDayS, &tokens);
  ASSERT_TRUE(secret);
  EXPECT_EQ(secret->size(), 4u + 64u);
  const std::string text = FormatTokens(tokens);
  EXPECT_THAT(text, Not(HasSubstr(secret->substr(4))));
  const auto again = ParseTokens(text, "tokens.csv");
  ASSERT_TRUE(again) << again.error().text;
  EXPECT_EQ(*again, tokens);
}

TEST(Token, SecretsDiffer) {
  std::vector<Token> tokens;
  const auto one = AddToken("a", Role::kViewer, 0, 1, &tokens);
  const auto other = AddToken("b", Role::kViewer, 0, 1, &tokens);
  EXPECT_NE(*one, *other);
}

TEST(Token, ANameIsGivenOnce) {
  std::vector<Token> tokens;
  ASSERT_TRUE(AddToken("page", Role::kViewer, 1, 2, &tokens));
  EXPECT_FALSE(AddToken("page", Role::kViewer, 1, 2, &tokens));
  ASSERT_TRUE(RevokeToken("page", 5, &tokens));
  EXPECT_FALSE(AddToken("page", Role::kViewer, 1, 2, &tokens)) << "the audit has that name";
  EXPECT_FALSE(RevokeToken("page", 6, &tokens));
  EXPECT_FALSE(RevokeToken("other", 6, &tokens));
}

TEST(Token, NamesAreHarmless) {
  std::vector<Token> tokens;
  for (const std::string& name :
       {std::string(""), std::string("a,b"), std::string("a\nb"), std::string("<b>"),
        std::string("\x1b[2J"), std::string("../x"), std::string(65, 'x')})
    EXPECT_FALSE(AddToken(name, Role::kViewer, 1, 2, &tokens)) << name;
}

TEST(Token, AFaultOfTheFileIsNamedWithItsRow) {
  const std::string head = "name,role,made_s,expires_s,revoked_s,sha256\n";
  const std::string hash(64, 'a');
  const std::pair<std::string, const char*> faults[] = {
      {"", "t.csv:0"},
      {"x\n", "t.csv:1: the first row"},
      {head + "a,viewer,1,2,0\n", "t.csv:2: a row has 6"},
      {head + "a,root,1,2,0," + hash + "\n", "t.csv:2: role"},
      {head + "a b,viewer,1,2,0," + hash + "\n", "t.csv:2: name"},
      {head + "a,viewer,x,2,0," + hash + "\n", "t.csv:2: made_s"},
      {head + "a,viewer,1,-2,0," + hash + "\n", "t.csv:2: made_s"},
      {head + "a,viewer,1,2,0,zz\n", "t.csv:2: sha256"},
      {head + "a,viewer,1,2,0," + hash + "\na,viewer,1,2,0," + hash + "\n", "t.csv:3: name"}};
  for (const auto& [text, fault] : faults) {
    const auto tokens = ParseTokens(text, "t.csv");
    ASSERT_FALSE(tokens) << text;
    EXPECT_THAT(tokens.error().text, HasSubstr(fault));
  }
}

class TokenRegisterTest : public ::testing::Test {
 protected:
  TokenRegisterTest() {
    valid_ = *AddToken("valid", Role::kOperator, kNowS, kNowS + kDayS, &tokens_);
    expired_ = *AddToken("expired", Role::kEngineer, kNowS - 2 * kDayS, kNowS, &tokens_);
    revoked_ = *AddToken("revoked", Role::kEngineer, kNowS, kNowS + kDayS, &tokens_);
    EXPECT_TRUE(RevokeToken("revoked", kNowS, &tokens_));
    Write(Path(), FormatTokens(tokens_));
  }
  [[nodiscard]] std::string Path() const { return folder_ / "tokens.csv"; }

  test::ScratchFolder folder_;
  std::vector<Token> tokens_;
  std::string valid_;
  std::string expired_;
  std::string revoked_;
  TokenRegister register_{{.path = Path(),
                           .attempts = {.burst = 3, .per_second = 1},
                           .requests = {.burst = 5, .per_second = 2}}};
};

TEST_F(TokenRegisterTest, FindsValidTokensAlone) {
  const auto found = register_.Find(valid_, kNow);
  ASSERT_TRUE(found) << found.error().text;
  EXPECT_EQ(found->name, "valid");
  EXPECT_EQ(found->role, Role::kOperator);
  EXPECT_THAT(register_.Find(expired_, kNow).error().text, HasSubstr("expired"));
  EXPECT_THAT(register_.Find(revoked_, kNow).error().text, HasSubstr("revoked"));
  for (const std::string& secret : {std::string(), valid_ + "0", valid_.substr(1), "x" + valid_})
    EXPECT_FALSE(register_.Find(secret, kNow)) << secret;
  EXPECT_FALSE(register_.Find(tokens_[0].sha256, kNow)) << "the hash is no token";
}

TEST_F(TokenRegisterTest, ARevocationHoldsFromTheNextRequestOn) {
  ASSERT_TRUE(register_.Find(valid_, kNow));
  ASSERT_TRUE(RevokeToken("valid", kNowS, &tokens_));
  Write(Path(), FormatTokens(tokens_));
  EXPECT_FALSE(register_.Find(valid_, kNow));
}

TEST_F(TokenRegisterTest, AFileThatCannotBeReadHasNoTokens) {
  ASSERT_TRUE(register_.Find(valid_, kNow));
  Write(Path(), "garbage");
  EXPECT_FALSE(register_.Find(valid_, kNow));
  ::unlink(Path().c_str());
  EXPECT_FALSE(register_.Find(valid_, kNow));
  Write(Path(), FormatTokens(tokens_));
  EXPECT_TRUE(register_.Find(valid_, kNow));
}

TEST_F(TokenRegisterTest, AFileThatOthersMayWriteIsNotTrusted) {
  Write(Path(), FormatTokens(tokens_), 0660);
  EXPECT_THAT(register_.Find(valid_, kNow).error().text, HasSubstr("chmod go-w"));
}

TEST_F(TokenRegisterTest, AFileThatIsNoFileHasNoTokens) {
  ::unlink(Path().c_str());
  ASSERT_EQ(::mkfifo(Path().c_str(), 0600), 0);
  EXPECT_FALSE(register_.Find(valid_, kNow)) << "and nothing waits";
}

TEST_F(TokenRegisterTest, BudgetsRunOutAndFillAgain) {
  for (int n = 0; n < 5; ++n) EXPECT_TRUE(register_.MayAsk("valid", kNow));
  EXPECT_FALSE(register_.MayAsk("valid", kNow));
  EXPECT_TRUE(register_.MayAsk("other", kNow)) << "each has its own";
  EXPECT_TRUE(register_.MayAsk("valid", WallTime{kNow.ns + 500'000'000}));
  EXPECT_FALSE(register_.MayAsk("valid", WallTime{kNow.ns + 500'000'000}));
  for (int n = 0; n < 3; ++n) EXPECT_TRUE(register_.MayTry("192.0.2.1", kNow));
  EXPECT_FALSE(register_.MayTry("192.0.2.1", kNow));
}

TEST_F(TokenRegisterTest, ManyAddressesTakeNoMemory) {
  for (int n = 0; n < 5000; ++n)
    static_cast<void>(register_.MayTry("192.0.2." + std::to_string(n), kNow));
  EXPECT_FALSE(register_.MayTry("198.51.100.1", kNow)) << "further ones share a budget";
}

}  // namespace
}  // namespace focalfleet
