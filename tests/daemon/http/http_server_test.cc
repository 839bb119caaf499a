#include "daemon/http/http_server.h"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <mutex>
#include <utility>

#include "tests/support/process.h"

namespace focalfleet {
namespace {

using test::WaitUntil;
using ::testing::AnyOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;
using ::testing::StartsWith;

constexpr int kPatienceMs = 30'000;  // limit for a hang; nothing is timed

sockaddr_in Loopback(std::uint16_t port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return address;
}

/// A client that sends bytes as they are.
class Client {
 public:
  explicit Client(std::uint16_t port) : fd_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    const sockaddr_in address = Loopback(port);
    connected_ = ::connect(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  }
  Client(Client&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;
  ~Client() {
    if (fd_ >= 0) ::close(fd_);
  }
  [[nodiscard]] bool connected() const { return connected_; }
  /// False: the server has closed the connection.
  bool Send(const std::string& text) const {
    return ::send(fd_, text.data(), text.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(text.size());
  }
  /// All that comes until the server closes.
  [[nodiscard]] std::string ReadAll() const {
    std::string text;
    char buffer[4096];
    pollfd watched{.fd = fd_, .events = POLLIN, .revents = 0};
    while (::poll(&watched, 1, kPatienceMs) > 0) {
      const ssize_t got = ::recv(fd_, buffer, sizeof buffer, 0);
      if (got <= 0) return text;
      text.append(buffer, static_cast<std::size_t>(got));
    }
    return text + "(the server does not close)";
  }

 private:
  int fd_;
  bool connected_ = false;
};

/// A listening socket of somebody else.
class Squatter {
 public:
  Squatter() : fd_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address = Loopback(0);
    socklen_t size = sizeof address;
    EXPECT_EQ(::bind(fd_, reinterpret_cast<sockaddr*>(&address), size), 0);
    EXPECT_EQ(::listen(fd_, 1), 0);
    EXPECT_EQ(::getsockname(fd_, reinterpret_cast<sockaddr*>(&address), &size), 0);
    port_ = ntohs(address.sin_port);
  }
  Squatter(const Squatter&) = delete;
  Squatter& operator=(const Squatter&) = delete;
  ~Squatter() { Leave(); }
  void Leave() {
    if (fd_ >= 0) ::close(std::exchange(fd_, -1));
  }
  [[nodiscard]] std::uint16_t port() const { return port_; }

 private:
  int fd_;
  std::uint16_t port_ = 0;
};

class HttpServerTest : public ::testing::Test {
 protected:
  HttpServer::Options Options() {
    return {.address = "127.0.0.1",
            .pages = {{"/page", [] { return HttpAnswer{.body = "text of the page"}; }},
                      {"/ill", [] { return HttpAnswer{.status = 503, .body = "ill"}; }},
                      {"/large", [] { return HttpAnswer{.body = std::string(10'000'000, 'x')}; }}},
            .tell =
                [this](const std::string& trouble) {
                  const std::lock_guard lock(mutex_);
                  troubles_.push_back(trouble);
                },
            .retry_period = std::chrono::milliseconds(20)};
  }
  static std::uint16_t PortOf(const HttpServer& server) {
    EXPECT_TRUE(WaitUntil([&] { return server.port() != 0; }, kPatienceMs));
    return server.port();
  }
  static std::string Ask(const HttpServer& server, const std::string& request) {
    const Client client(PortOf(server));
    client.Send(request);
    return client.ReadAll();
  }
  static std::string Get(const HttpServer& server, const std::string& path = "/page") {
    return Ask(server, "GET " + path + " HTTP/1.1\r\nHost: localhost\r\n\r\n");
  }
  std::vector<std::string> Troubles() {
    const std::lock_guard lock(mutex_);
    return troubles_;
  }

 private:
  std::mutex mutex_;
  std::vector<std::string> troubles_;
};

TEST_F(HttpServerTest, AnswersItsPagesAndNothingElse) {
  const HttpServer server(Options());
  const std::string page = Get(server);
  EXPECT_THAT(page, StartsWith("HTTP/1.1 200"));
  EXPECT_THAT(page, HasSubstr("\r\n\r\ntext of the page"));
  EXPECT_THAT(page, Not(HasSubstr("Access-Control"))) << "no other site may read it";
  EXPECT_THAT(Get(server, "/ill"), StartsWith("HTTP/1.1 503"));
  for (const char* path : {"/", "/page/", "/../page", "/pag%65x", "//page", "/other"})
    EXPECT_THAT(Get(server, path), StartsWith("HTTP/1.1 404")) << path;
  EXPECT_THAT(Troubles(), IsEmpty());
}

TEST_F(HttpServerTest, AnswersGetAlone) {
  const HttpServer server(Options());
  for (const char* method : {"POST", "PUT", "DELETE", "OPTIONS", "PATCH", "HEAD"}) {
    const std::string answer =
        Ask(server, std::string(method) + " /page HTTP/1.1\r\nHost: localhost\r\n" +
                        "Origin: http://evil.example\r\nContent-Length: 3\r\n\r\nabc");
    EXPECT_THAT(answer, StartsWith("HTTP/1.1 405")) << method;
    EXPECT_THAT(answer, Not(HasSubstr("Access-Control"))) << method;
    EXPECT_THAT(answer, Not(HasSubstr("text of the page"))) << method;
  }
}

TEST_F(HttpServerTest, IsNotAskedUnderAForeignName) {
  HttpServer::Options options = Options();
  options.names = {"plate.example.org"};
  const HttpServer server(std::move(options));
  const auto ask = [&](const std::string& headers) {
    return Ask(server, "GET /page HTTP/1.1\r\n" + headers + "\r\n");
  };
  EXPECT_THAT(ask("Host: plate.example.org:9890\r\n"), StartsWith("HTTP/1.1 200"));
  for (const char* headers : {"", "Host: evil.example\r\n", "Host: evil.example:9890\r\n",
                              "Host: localhost\r\nHost: evil.example\r\n", "Host:\r\n"}) {
    const std::string answer = ask(headers);
    EXPECT_THAT(answer, AnyOf(StartsWith("HTTP/1.1 403"), StartsWith("HTTP/1.1 400"))) << headers;
    EXPECT_THAT(answer, Not(HasSubstr("text of the page"))) << headers;
  }
}

TEST_F(HttpServerTest, RefusesWhatIsNoRequestOrTooLong) {
  const HttpServer server(Options());
  const std::string get = "GET /page HTTP/1.1\r\nHost: localhost\r\n";
  EXPECT_THAT(Ask(server, "nonsense\r\n\r\n"), StartsWith("HTTP/1.1 400"));
  EXPECT_THAT(Ask(server, get + "Range: bytes=0-0,0-0,0-0\r\n\r\n"), StartsWith("HTTP/1.1 400"));
  EXPECT_THAT(Ask(server, get + "X: " + std::string(10'000, 'x') + "\r\n\r\n"),
              StartsWith("HTTP/1.1 400"))
      << "a header";
  std::string many;
  for (int i = 0; i < 1000; ++i) many += "X-" + std::to_string(i) + ": x\r\n";
  many.resize(16'000);
  EXPECT_THAT(Ask(server, get + many + many), StartsWith("HTTP/1.1 431")) << "many headers";
  EXPECT_THAT(
      Ask(server, "GET /" + std::string(9000, 'x') + " HTTP/1.1\r\nHost: localhost\r\n\r\n"),
      StartsWith("HTTP/1.1 414"));
  EXPECT_THAT(Get(server), StartsWith("HTTP/1.1 200"));
}

TEST_F(HttpServerTest, EndsAClientThatSendsTooSlowly) {
  HttpServer::Options options = Options();
  options.limits.connection = std::chrono::milliseconds(300);
  const HttpServer server(std::move(options));
  const Client client(PortOf(server));
  ASSERT_TRUE(client.Send("GET /page HTTP/1.1\r\nHost: localhost\r\n"));
  int sent = 0;  // a header's bytes, one by one: each comes long before a limit for a read
  const auto ended = [&] {
    ++sent;
    return !client.Send("X");
  };
  EXPECT_TRUE(WaitUntil(ended, kPatienceMs));
  EXPECT_GT(sent, 1);
}

TEST_F(HttpServerTest, AnswersASlowClientThatItWasTooSlow) {
  HttpServer::Options options = Options();
  options.limits.connection = std::chrono::milliseconds(200);
  const HttpServer server(std::move(options));
  EXPECT_THAT(Ask(server, "GET /page HT"), StartsWith("HTTP/1.1 408"));
}

TEST_F(HttpServerTest, EndsAClientThatReadsTooSlowly) {
  HttpServer::Options options = Options();
  options.limits.connection = std::chrono::milliseconds(200);
  options.limits.served = 1;
  options.limits.waiting = 1;
  const HttpServer server(std::move(options));
  const Client client(PortOf(server));
  ASSERT_TRUE(client.Send("GET /large HTTP/1.1\r\nHost: localhost\r\n\r\n"));
  // The next client waits for the only place, which is free again though nothing was read.
  EXPECT_THAT(Get(server), StartsWith("HTTP/1.1 200"));
}

TEST_F(HttpServerTest, ServesBesideManyIdleConnections) {
  HttpServer::Options options = Options();
  options.limits.first_byte = std::chrono::milliseconds(100);
  options.limits.connection = std::chrono::milliseconds(10 * kPatienceMs);
  const HttpServer server(std::move(options));
  const std::uint16_t port = PortOf(server);
  std::vector<Client> idle;
  for (int i = 0; i < 40; ++i) idle.emplace_back(port);  // of 64 places
  EXPECT_THAT(Get(server), StartsWith("HTTP/1.1 200"));
  for (const Client& client : idle) EXPECT_EQ(client.ReadAll(), "") << "closed without a word";
}

TEST_F(HttpServerTest, TurnsAwayAtOnceWhatExceedsItsPlaces) {
  HttpServer::Options options = Options();
  options.limits.served = 2;
  options.limits.waiting = 1;
  options.limits.first_byte = std::chrono::milliseconds(kPatienceMs);
  options.limits.connection = std::chrono::milliseconds(kPatienceMs);
  auto server = std::make_unique<HttpServer>(std::move(options));
  const std::uint16_t port = PortOf(*server);
  std::vector<Client> idle;
  for (int i = 0; i < 3; ++i) idle.emplace_back(port);
  EXPECT_TRUE(WaitUntil([&] { return Get(*server).starts_with("HTTP/1.1 503"); }, kPatienceMs));
  idle.clear();
  EXPECT_TRUE(WaitUntil([&] { return Get(*server).starts_with("HTTP/1.1 200"); }, kPatienceMs));
  // An end does not wait for clients that are silent.
  for (int i = 0; i < 3; ++i) idle.emplace_back(port);
  server.reset();
  for (const Client& client : idle)
    EXPECT_THAT(client.ReadAll(), AnyOf("", StartsWith("HTTP/1.1 503")));
}

TEST_F(HttpServerTest, TellsOfAPortInUseOnceAndListensWhenItIsFree) {
  Squatter squatter;
  HttpServer::Options options = Options();
  options.port = squatter.port();
  const HttpServer server(std::move(options));
  ASSERT_TRUE(WaitUntil([&] { return !Troubles().empty(); }, kPatienceMs));
  EXPECT_EQ(server.port(), 0);
  EXPECT_THAT(Troubles()[0], HasSubstr("127.0.0.1 port " + std::to_string(squatter.port())));
  EXPECT_THAT(Troubles()[0], HasSubstr("in use"));
  test::Pause(100);  // some attempts
  EXPECT_THAT(Troubles(), SizeIs(1));
  squatter.Leave();
  EXPECT_THAT(Get(server), StartsWith("HTTP/1.1 200"));
  EXPECT_TRUE(WaitUntil([&] { return Troubles().size() == 2; }, kPatienceMs));
  EXPECT_EQ(Troubles().back(), "");
}

TEST_F(HttpServerTest, DoesNotShareItsPortWithASecondServer) {
  const HttpServer first(Options());
  HttpServer::Options options = Options();
  options.port = PortOf(first);
  const HttpServer second(std::move(options));
  ASSERT_TRUE(WaitUntil([&] { return !Troubles().empty(); }, kPatienceMs));
  EXPECT_THAT(Troubles()[0], HasSubstr("in use"));
}

TEST_F(HttpServerTest, EndsWhileItTriesAndWhileItListens) {
  Squatter squatter;
  for (int i = 0; i < 20; ++i) {
    HttpServer::Options options = Options();
    options.retry_period = std::chrono::milliseconds(kPatienceMs);
    if (i % 2 == 0) options.port = squatter.port();
    const HttpServer server(std::move(options));
    if (i % 3 == 0) test::Pause(5);
  }
}

}  // namespace
}  // namespace focalfleet
