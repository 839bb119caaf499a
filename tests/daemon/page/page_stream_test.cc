// The page's routes through a server: what a browser gets, as bytes on a socket.
#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <fstream>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "daemon/access/token.h"
#include "daemon/http/http_server.h"
#include "daemon/page/page_routes.h"
#include "fleet/hex_layout.h"
#include "tests/support/process.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using std::chrono::milliseconds;
using test::WaitUntil;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

constexpr int kPatienceMs = 30'000;  // limit for a hang; nothing is timed

/// A connection on which a request was sent.
class Client {
 public:
  Client(std::uint16_t port, const std::string& request, int buffer_bytes = 0)
      : fd_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    if (buffer_bytes > 0)
      ::setsockopt(fd_, SOL_SOCKET, SO_RCVBUF, &buffer_bytes, sizeof buffer_bytes);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(::connect(fd_, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
    EXPECT_GE(::send(fd_, request.data(), request.size(), MSG_NOSIGNAL), 0);
  }
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;
  ~Client() { ::close(fd_); }

  /// Reads until the text is there, or to the end, or for as long as patience lasts. All that came
  /// so far.
  const std::string& ReadUntil(const std::string& text) {
    std::array<char, 4096> chunk{};
    pollfd watched{.fd = fd_, .events = POLLIN, .revents = 0};
    const auto until = std::chrono::steady_clock::now() + milliseconds(kPatienceMs);
    while (read_.find(text) == std::string::npos && std::chrono::steady_clock::now() < until &&
           ::poll(&watched, 1, kPatienceMs) > 0) {
      const ssize_t got = ::recv(fd_, chunk.data(), chunk.size(), 0);
      if (got <= 0) break;
      read_.append(chunk.data(), static_cast<std::size_t>(got));
    }
    return read_;
  }
  const std::string& ReadToTheEnd() { return ReadUntil("(this is never sent)"); }

 private:
  int fd_;
  std::string read_;
};

class PageStreamTest : public ::testing::Test {
 protected:
  PageStreamTest() {
    const std::int64_t now_s = WallTime::Now().ns / 1'000'000'000;
    viewer_ = *AddToken("look", Role::kViewer, now_s, now_s + 3600, &tokens_);
    operator_ = *AddToken("olga", Role::kOperator, now_s, now_s + 3600, &tokens_);
    Keep();
  }
  void Keep() {
    std::ofstream(folder_ / "t.new") << FormatTokens(tokens_);
    ::chmod((folder_ / "t.new").c_str(), 0640);
    ::rename((folder_ / "t.new").c_str(), (folder_ / "tokens.csv").c_str());
  }
  void Serve(HttpLimits limits = {}, bool viewer_without_token = false) {
    limits.streams = 2;
    auto router = std::make_shared<HttpRouter>(HttpRouter::Options{
        .tokens =
            std::make_shared<TokenRegister>(TokenRegister::Options{.path = folder_ / "tokens.csv"}),
        .viewer_without_token = viewer_without_token});
    AddPageRoutes({.layout = &layout_,
                   .feed = &feed_,
                   .plans = &plans_,
                   .night = &night_,
                   .diagnosis = &diagnosis_,
                   .store = folder_ / "none.db"},
                  router.get());
    server_ = std::make_unique<HttpServer>(
        HttpServer::Options{.address = "127.0.0.1", .router = std::move(router), .limits = limits});
    ASSERT_TRUE(WaitUntil([&] { return server_->port() != 0; }, kPatienceMs));
  }
  Client Ask(const std::string& path, const std::string& token, const std::string& more = "",
             int buffer_bytes = 0) const {
    return {server_->port(),
            "GET " + path + " HTTP/1.1\r\nHost: localhost\r\n" +
                (token.empty() ? "" : "Authorization: Bearer " + token + "\r\n") + more + "\r\n",
            buffer_bytes};
  }

  Client Post(const std::string& path, const std::string& token, const std::string& body) const {
    return {server_->port(),
            "POST " + path + " HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer " + token +
                "\r\nContent-Type: application/json\r\nContent-Length: " +
                std::to_string(body.size()) + "\r\nConnection: close\r\n\r\n" + body};
  }

  test::ScratchFolder folder_;
  std::vector<Token> tokens_;
  std::string viewer_;
  std::string operator_;
  Layout layout_ = Layout::Create(MakeHexLayout({.count = 2000}), {}).value();
  PlateFeed feed_{{.layout = &layout_, .viewers_max = 2, .pause = milliseconds(0)}};
  KeptPlans plans_;
  NightCurves night_;
  DiagnosisJob diagnosis_{{.programs = {}, .folder = folder_ / "diagnosis"}};
  std::unique_ptr<HttpServer> server_;  // ends before the feed
  bool toggled_ = false;
};

TEST_F(PageStreamTest, ThePagesOwnFilesAreForEverybodyAndTheFleetForThoseWithAToken) {
  Serve();
  EXPECT_THAT(Ask("/", "").ReadToTheEnd(),
              AllOf(StartsWith("HTTP/1.1 200"), HasSubstr("<!DOCTYPE html>"),
                    HasSubstr("Content-Security-Policy: default-src 'none'; script-src 'self'")));
  EXPECT_THAT(Ask("/page/main.js", "").ReadToTheEnd(),
              AllOf(StartsWith("HTTP/1.1 200"), HasSubstr("Content-Type: text/javascript")));
  EXPECT_THAT(Ask("/page/runbook.md", "").ReadToTheEnd(), HasSubstr("### "));
  EXPECT_THAT(Ask("/page/../tokens.csv", "").ReadToTheEnd(), StartsWith("HTTP/1.1 404"));
  EXPECT_THAT(Ask("/layout", "").ReadToTheEnd(), StartsWith("HTTP/1.1 401"));
  EXPECT_THAT(Ask("/stream", "").ReadToTheEnd(), StartsWith("HTTP/1.1 401"));
  EXPECT_THAT(Ask("/layout", viewer_).ReadToTheEnd(), HasSubstr("\"count\":2000"));
}

TEST_F(PageStreamTest, AStreamBeginsWithTheFleet) {
  Serve();
  Client client = Ask("/stream", viewer_);
  EXPECT_THAT(client.ReadUntil("\"phases\""),
              AllOf(StartsWith("HTTP/1.1 200"), HasSubstr("application/octet-stream")));
  EXPECT_EQ(feed_.viewers(), 1u);
}

TEST_F(PageStreamTest, TheNextViewerGetsAClearText) {
  Serve();
  Client first = Ask("/stream", viewer_);
  Client second = Ask("/stream", viewer_);
  first.ReadUntil("\"phases\"");
  second.ReadUntil("\"phases\"");
  EXPECT_THAT(Ask("/stream", viewer_).ReadToTheEnd(),
              AllOf(StartsWith("HTTP/1.1 503"), HasSubstr("all 2 places for viewers are taken")));
  EXPECT_THAT(Ask("/layout", viewer_).ReadToTheEnd(), StartsWith("HTTP/1.1 200"))
      << "viewers take no place of other requests";
}

TEST_F(PageStreamTest, AViewerThatReadsNothingIsEnded) {
  HttpLimits limits;
  limits.stall = milliseconds(50);
  Serve(limits);
  // The snapshots are more than all buffers hold.
  Client client = Ask("/stream", viewer_, "", 4096);
  ASSERT_TRUE(WaitUntil([&] { return feed_.viewers() == 1; }, kPatienceMs));
  EXPECT_TRUE(WaitUntil(
      [&] {
        StatusBatch batch;
        for (std::uint32_t n = 0; n < layout_.size(); ++n)
          batch.units.push_back({.unit = layout_.unit({n}).id, .move = MoveId{1}});
        for (UnitStatusValue& unit : batch.units)
          unit.outcome = toggled_ ? TargetOutcome::kFailed : TargetOutcome::kArrived;
        toggled_ = !toggled_;
        feed_.Take(batch);
        return feed_.viewers() == 0;
      },
      kPatienceMs));
}

TEST_F(PageStreamTest, ARevokedTokenEndsItsStream) {
  HttpLimits limits;
  limits.recheck = milliseconds(1);
  Serve(limits);
  Client client = Ask("/stream", viewer_);
  client.ReadUntil("\"phases\"");
  ASSERT_EQ(feed_.viewers(), 1u);
  ASSERT_TRUE(RevokeToken("look", WallTime::Now().ns / 1'000'000'000, &tokens_));
  Keep();
  EXPECT_TRUE(WaitUntil([&] { return feed_.viewers() == 0; }, kPatienceMs));
}

TEST_F(PageStreamTest, MotionsOfPlansAreForThoseWhoMaySeeThem) {
  Serve();
  plans_.Put(7, "motion of seven");
  plans_.PutPreview(3, "motion of a preview");
  EXPECT_THAT(Ask("/motion?configuration=7", "").ReadToTheEnd(), StartsWith("HTTP/1.1 401"));
  EXPECT_THAT(Ask("/motion?configuration=7", viewer_).ReadToTheEnd(),
              AllOf(StartsWith("HTTP/1.1 200"), HasSubstr("motion of seven")));
  EXPECT_THAT(Ask("/motion?configuration=8", viewer_).ReadToTheEnd(),
              AllOf(StartsWith("HTTP/1.1 404"), HasSubstr("not kept")));
  for (const char* path : {"/motion", "/motion?configuration=seven", "/motion?configuration=-1",
                           "/motion?configuration=7x"})
    EXPECT_THAT(Ask(path, viewer_).ReadToTheEnd(), StartsWith("HTTP/1.1 400")) << path;
  EXPECT_THAT(Ask("/preview-motion?plan=3", viewer_).ReadToTheEnd(), StartsWith("HTTP/1.1 403"));
  EXPECT_THAT(Ask("/preview-motion?plan=3", operator_).ReadToTheEnd(),
              HasSubstr("motion of a preview"));
  EXPECT_THAT(Ask("/preview-motion?plan=7", operator_).ReadToTheEnd(), StartsWith("HTTP/1.1 404"));
}

TEST_F(PageStreamTest, ThePowerOfAPreviewIsForThoseWhoMayMakeOne) {
  Serve();
  EXPECT_THAT(Ask("/preview-power?plan=0", operator_).ReadToTheEnd(), StartsWith("HTTP/1.1 404"));
  night_.TakePreview(3,
                     {.rail_limit_W = 120, .rail_W = {{RailId{2}, {101.5}}}, .total_W = {101.5}});
  EXPECT_THAT(Ask("/preview-power?plan=3", viewer_).ReadToTheEnd(), StartsWith("HTTP/1.1 403"));
  EXPECT_THAT(Ask("/preview-power?plan=3", operator_).ReadToTheEnd(),
              AllOf(StartsWith("HTTP/1.1 200"), HasSubstr("\"rail_limit_W\":120.0"),
                    HasSubstr("\"rail_W\":{\"2\":[101.5]}")));
  EXPECT_THAT(Ask("/preview-power?plan=4", operator_).ReadToTheEnd(), StartsWith("HTTP/1.1 404"));
  EXPECT_THAT(Ask("/preview-power", operator_).ReadToTheEnd(), StartsWith("HTTP/1.1 400"));
}

TEST_F(PageStreamTest, CurvesAreThoseSinceAnInstant) {
  Serve();
  EXPECT_THAT(Ask("/curves", "").ReadToTheEnd(), StartsWith("HTTP/1.1 401"));
  EXPECT_THAT(Ask("/curves", viewer_).ReadToTheEnd(),
              AllOf(StartsWith("HTTP/1.1 200"), HasSubstr("\"bus_load_max\":[]")));
  EXPECT_THAT(Ask("/curves?since_ms=12", viewer_).ReadToTheEnd(), StartsWith("HTTP/1.1 200"));
  EXPECT_THAT(Ask("/curves?since_ms=now", viewer_).ReadToTheEnd(), StartsWith("HTTP/1.1 400"));
}

TEST_F(PageStreamTest, ADiagnosisIsBegunByOperatorsAndSeenByAll) {
  Serve();
  const std::string campaign = R"({"name":"n","moves_csv":"m","units_csv":"u"})";
  EXPECT_THAT(Ask("/diagnosis", viewer_).ReadToTheEnd(), HasSubstr("\"state\":\"none\""));
  EXPECT_THAT(Post("/diagnosis", viewer_, campaign).ReadToTheEnd(),
              AllOf(StartsWith("HTTP/1.1 403"), HasSubstr("operator")));
  EXPECT_THAT(Post("/diagnosis-cancel", viewer_, "{}").ReadToTheEnd(), StartsWith("HTTP/1.1 403"));
  for (const char* body : {"", "[]", R"({"name":"n","moves_csv":"m"})",
                           R"({"name":7,"moves_csv":"m","units_csv":"u"})"})
    EXPECT_THAT(Post("/diagnosis", operator_, body).ReadToTheEnd(), StartsWith("HTTP/1.1 400"))
        << body;
  EXPECT_THAT(Post("/diagnosis", operator_, campaign).ReadToTheEnd(),
              AllOf(StartsWith("HTTP/1.1 503"), HasSubstr("focalfleet-study")));
  EXPECT_THAT(Post("/diagnosis-cancel", operator_, "{}").ReadToTheEnd(),
              StartsWith("HTTP/1.1 409"));
  EXPECT_THAT(Ask("/diagnosis-page", viewer_).ReadToTheEnd(), StartsWith("HTTP/1.1 409"));
}

TEST_F(PageStreamTest, AServerEndsWhileViewersLookOn) {
  Serve();
  Client client = Ask("/stream", viewer_);
  client.ReadUntil("\"phases\"");
  server_.reset();
  EXPECT_EQ(feed_.viewers(), 0u);
}

TEST_F(PageStreamTest, WithoutATokenThisHostLooksOnWhereThatIsWanted) {
  Serve({}, true);
  EXPECT_THAT(Ask("/layout", "").ReadToTheEnd(), StartsWith("HTTP/1.1 200"));
  EXPECT_THAT(Ask("/layout", "fft_wrong").ReadToTheEnd(), StartsWith("HTTP/1.1 401"))
      << "a wrong token is not none";
  EXPECT_THAT(Ask("/layout", "", "X-Forwarded-For: 192.0.2.7\r\n").ReadToTheEnd(),
              StartsWith("HTTP/1.1 401"))
      << "a proxy asks for somebody elsewhere";
}

}  // namespace
}  // namespace focalfleet
