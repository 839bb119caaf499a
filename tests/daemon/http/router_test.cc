#include "daemon/http/router.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <fstream>
#include <string>
#include <vector>

#include "daemon/access/token.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

constexpr WallTime kNow{1'700'000'000'000'000'000};
constexpr std::int64_t kNowS = kNow.ns / 1'000'000'000;

class RouterTest : public ::testing::Test {
 protected:
  RouterTest() {
    viewer_ = *AddToken("look", Role::kViewer, kNowS, kNowS + 10, &tokens_);
    operator_ = *AddToken("move", Role::kOperator, kNowS, kNowS + 10, &tokens_);
    expired_ = *AddToken("old", Role::kEngineer, kNowS - 10, kNowS, &tokens_);
    Keep();
    for (const char* verb : {"status", "apply", "stop"})
      router_.Add({.method = "POST",
                   .path = std::string("/api/") + verb,
                   .verb = verb,
                   .answer = [](const HttpRequest& request, const Caller& caller) {
                     return HttpAnswer{.body = caller.token + " says " + request.body};
                   }});
    router_.Add({.path = "/", .verb = "", .answer = [](const HttpRequest&, const Caller& caller) {
                   return HttpAnswer{.body = std::string("page for ") + Name(caller.role)};
                 }});
  }
  void Keep() {
    std::ofstream(folder_ / "tokens.csv") << FormatTokens(tokens_);
    ::chmod((folder_ / "tokens.csv").c_str(), 0640);
  }
  static HttpRequest Post(const std::string& path, const std::string& secret) {
    return {.method = "POST",
            .path = path,
            .host = "localhost:9891",
            .authorization = secret.empty() ? "" : "Bearer " + secret,
            .content_type = "application/json; charset=utf-8",
            .address = "127.0.0.1"};
  }
  int StatusOf(const HttpRequest& request) {
    const auto admission = router_.Admit(request);
    return admission.refused ? admission.refused->status : 200;
  }

  test::ScratchFolder folder_;
  std::vector<Token> tokens_;
  std::string viewer_;
  std::string operator_;
  std::string expired_;
  std::string log_;
  HttpRouter router_{{.tokens = std::make_shared<TokenRegister>(
                          TokenRegister::Options{.path = folder_ / "tokens.csv",
                                                 .attempts = {.burst = 3, .per_second = 0},
                                                 .requests = {.burst = 3, .per_second = 0}}),
                      .log = [this](const std::string& text) { log_ += text + "\n"; },
                      .now = [] { return kNow; }}};
};

TEST_F(RouterTest, AdmitsByTheTableOfRights) {
  EXPECT_EQ(StatusOf(Post("/api/status", viewer_)), 200);
  EXPECT_EQ(StatusOf(Post("/api/stop", viewer_)), 200);
  EXPECT_EQ(StatusOf(Post("/api/apply", operator_)), 200);
  EXPECT_EQ(StatusOf(Post("/api/apply", viewer_)), 403);
  EXPECT_THAT(log_, HasSubstr("token look (viewer, from 127.0.0.1) may not apply"));
}

TEST_F(RouterTest, AHandlerLearnsWhoAsks) {
  HttpRequest request = Post("/api/apply", operator_);
  const auto admission = router_.Admit(request);
  ASSERT_FALSE(admission.refused);
  request.body = "x";
  EXPECT_EQ(router_.Answer(admission, request).body, "move says x");
}

TEST_F(RouterTest, WithoutAValidTokenThereIsNothing) {
  for (const std::string& secret :
       {std::string(), std::string("x"), expired_, viewer_ + "x", std::string(9000, 'x')}) {
    const auto admission = router_.Admit(Post("/api/status", secret));
    ASSERT_TRUE(admission.refused);
    EXPECT_THAT(admission.refused->status, ::testing::AnyOf(401, 429));
    EXPECT_THAT(admission.refused->body, Not(HasSubstr("expired"))) << "the reason is no hint";
  }
  HttpRequest basic = Post("/api/status", "");
  basic.authorization = "Basic " + viewer_;
  EXPECT_EQ(StatusOf(basic), 401);
  basic.authorization = "bearer " + viewer_;
  EXPECT_EQ(StatusOf(basic), 401);
}

TEST_F(RouterTest, ARevokedTokenIsRefusedAtOnce) {
  EXPECT_EQ(StatusOf(Post("/api/status", viewer_)), 200);
  ASSERT_TRUE(RevokeToken("look", kNowS, &tokens_));
  Keep();
  EXPECT_EQ(StatusOf(Post("/api/status", viewer_)), 401);
}

TEST_F(RouterTest, PublicPagesNeedNoTokenAndGetNoRole) {
  const HttpRequest request{.method = "GET", .path = "/", .host = "localhost"};
  const auto admission = router_.Admit(request);
  ASSERT_FALSE(admission.refused);
  EXPECT_EQ(router_.Answer(admission, request).body, "page for none");
}

TEST_F(RouterTest, PagesOfOtherSitesGetNoAnswer) {
  for (const char* origin : {"http://evil.example", "https://localhost:9891", "http://localhost",
                             "null", "http://localhost:9891.evil.example"}) {
    HttpRequest request = Post("/api/stop", operator_);
    request.origin = origin;
    EXPECT_EQ(StatusOf(request), 403) << origin;
  }
  HttpRequest own = Post("/api/stop", operator_);
  own.origin = "http://localhost:9891";
  EXPECT_EQ(StatusOf(own), 200);
  own.fetch_site = "same-origin";
  EXPECT_EQ(StatusOf(own), 200);
  for (const char* site : {"cross-site", "same-site"}) {
    own.fetch_site = site;
    EXPECT_EQ(StatusOf(own), 403) << site;
  }
}

TEST_F(RouterTest, AFormIsNoRequest) {
  for (const char* type : {"", "text/plain", "application/x-www-form-urlencoded",
                           "multipart/form-data; boundary=x", "application/jsonx"}) {
    HttpRequest request = Post("/api/stop", operator_);
    request.content_type = type;
    EXPECT_EQ(StatusOf(request), 415) << type;
  }
  HttpRequest packed = Post("/api/stop", operator_);
  packed.content_encoding = "gzip";
  EXPECT_EQ(StatusOf(packed), 415);
}

TEST_F(RouterTest, PathsAreTakenAsTheyAre) {
  for (const char* path : {"/api", "/api/", "/api/../api/stop", "/API/stop", "/api/stop/",
                           "//api/stop", "/etc/passwd", "/../etc/passwd", ""})
    EXPECT_EQ(StatusOf(Post(path, operator_)), 404) << path;
  HttpRequest get = Post("/api/stop", operator_);
  for (const char* method : {"GET", "HEAD", "PUT", "DELETE", "OPTIONS", "TRACE"}) {
    get.method = method;
    const auto admission = router_.Admit(get);
    ASSERT_TRUE(admission.refused) << method;
    EXPECT_EQ(admission.refused->status, 405) << method;
  }
}

TEST_F(RouterTest, EachTokenHasABudgetButAStopHasNone) {
  for (int n = 0; n < 3; ++n) EXPECT_EQ(StatusOf(Post("/api/status", viewer_)), 200);
  EXPECT_EQ(StatusOf(Post("/api/status", viewer_)), 429);
  EXPECT_EQ(StatusOf(Post("/api/stop", viewer_)), 200);
  EXPECT_EQ(StatusOf(Post("/api/status", operator_)), 200);
}

TEST_F(RouterTest, GuessesRunOutAndHoldUpNobodyElse) {
  for (int n = 0; n < 3; ++n) EXPECT_EQ(StatusOf(Post("/api/status", "guess")), 401);
  EXPECT_EQ(StatusOf(Post("/api/status", "guess")), 429);
  EXPECT_EQ(StatusOf(Post("/api/status", viewer_)), 200) << "from the same address";
}

TEST_F(RouterTest, WithoutARegisterNobodyIsAdmitted) {
  HttpRouter router({});
  router.Add({.method = "POST",
              .path = "/api/stop",
              .verb = "stop",
              .answer = [](const HttpRequest&, const Caller&) { return HttpAnswer{}; }});
  EXPECT_EQ(router.Admit(Post("/api/stop", operator_)).refused->status, 401);
}

TEST(RouterDeathTest, ARouteNamesAVerbThatExists) {
  HttpRouter router({});
  EXPECT_DEATH(router.Add({.path = "/x", .verb = "fly", .answer = {}}), "check failed");
}

}  // namespace
}  // namespace focalfleet
