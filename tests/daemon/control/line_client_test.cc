#include "daemon/control/line_client.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <thread>

#include "daemon/control/line_server.h"
#include "daemon/control/unix_address.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using test::ScratchFolder;
using ::testing::HasSubstr;

/// A server on a thread of its own that answers by verb, until it is destroyed.
class EchoServer {
 public:
  explicit EchoServer(const std::string& path) : server_(LineServer::Create(path).value()) {
    thread_ = std::thread([this] { Run(); });
  }
  ~EchoServer() {
    end_ = true;
    thread_.join();
  }
  EchoServer(const EchoServer&) = delete;
  EchoServer& operator=(const EchoServer&) = delete;

 private:
  void Run() {
    while (!end_) {
      pollfd poller{server_.fd(), POLLIN, 0};
      ::poll(&poller, 1, 10);
      std::vector<IncomingLine> urgent;  // stays empty
      server_.Service(&urgent);
      while (const auto line = server_.Next()) Answer(*line);
    }
  }
  void Answer(const IncomingLine& line) {
    const auto request = DecodeRequest(line.text);
    if (!request) {
      server_.Answer(line.client, EncodeError(0, request.error()));
    } else if (request->verb == "count") {
      for (int i = 1; i <= 3; ++i) server_.Progress(line.client, EncodeProgress(request->id, i));
      server_.Answer(line.client, EncodeResult(request->id, "three"));
    } else if (request->verb == "refuse") {
      server_.Answer(line.client, EncodeError(request->id, {ErrorCode::kRefused, "busy"}));
    } else if (request->verb == "mumble") {
      server_.Answer(line.client, "}{");
    } else if (request->verb == "echo") {
      server_.Answer(line.client, EncodeResult(request->id, request->args));
    }  // else: silence
  }

  LineServer server_;
  std::atomic<bool> end_{false};
  std::thread thread_;
};

TEST(LineClient, ReturnsTheResultAndShowsProgressOnTheWay) {
  const ScratchFolder scratch;
  const EchoServer server(scratch / "s");
  auto client = LineClient::Connect(scratch / "s").value();
  std::vector<int> seen;
  const auto result = client.Call(
      "count", Json::object(),
      {.on_progress = [&](const Json& progress) { seen.push_back(progress.get<int>()); }});
  ASSERT_TRUE(result) << result.error().text;
  EXPECT_EQ(*result, "three");
  EXPECT_THAT(seen, ::testing::ElementsAre(1, 2, 3));
}

TEST(LineClient, CarriesALineOfManyBytesBothWays) {
  const ScratchFolder scratch;
  const EchoServer server(scratch / "s");
  auto client = LineClient::Connect(scratch / "s").value();
  const std::string big(2'000'000, 'x');
  const auto result = client.Call("echo", {{"text", big}});
  ASSERT_TRUE(result) << result.error().text;
  EXPECT_EQ((*result)["text"].get_ref<const std::string&>().size(), big.size());
}

TEST(LineClient, GivesTheServersErrorAndStaysConnected) {
  const ScratchFolder scratch;
  const EchoServer server(scratch / "s");
  auto client = LineClient::Connect(scratch / "s").value();
  const auto refused = client.Call("refuse", Json::object());
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kRefused);
  EXPECT_EQ(refused.error().text, "busy");
  EXPECT_TRUE(client.connected());
  EXPECT_TRUE(client.Call("count", Json::object()));
}

TEST(LineClient, GivesUpASilentServer) {
  const ScratchFolder scratch;
  const EchoServer server(scratch / "s");
  auto client = LineClient::Connect(scratch / "s").value();
  const auto nothing =
      client.Call("silence", Json::object(), {.silence_max = Milliseconds(20), .on_progress = {}});
  ASSERT_FALSE(nothing);
  EXPECT_EQ(nothing.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(nothing.error().text, HasSubstr("no answer in time"));
  EXPECT_FALSE(client.connected());
}

TEST(LineClient, NamesASocketThatNoServerAnswers) {
  const test::ScratchFolder scratch;
  const auto client = LineClient::Connect(scratch / "s");
  ASSERT_FALSE(client);
  EXPECT_EQ(client.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(client.error().text, HasSubstr(scratch / "s"));
}

TEST(LineClient, ReportsAServerThatDiesOrSendsGarbage) {
  const test::ScratchFolder scratch;
  auto server = std::make_unique<EchoServer>(scratch / "s");
  auto mumbled = LineClient::Connect(scratch / "s").value();
  EXPECT_FALSE(mumbled.Call("mumble", Json::object()));
  EXPECT_FALSE(mumbled.connected());
  auto client = LineClient::Connect(scratch / "s").value();
  EXPECT_TRUE(client.Call("count", Json::object()));
  server.reset();
  const auto broken = client.Call("count", Json::object());
  ASSERT_FALSE(broken);
  EXPECT_EQ(broken.error().code, ErrorCode::kUnavailable);
  EXPECT_FALSE(client.connected());
}

// The server stands for a stopped daemon: it listens, and accepts no connection.
TEST(LineClient, GivesUpOnAServerThatTakesNoConnection) {
  const ScratchFolder scratch;
  const auto address = UnixAddress::Of(scratch / "s").value();
  const int listener = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  ASSERT_EQ(::bind(listener, address.get(), address.length()), 0);
  ASSERT_EQ(::listen(listener, 0), 0);
  const auto first = LineClient::Connect(scratch / "s");
  ASSERT_TRUE(first) << "in the backlog";
  const auto second = LineClient::Connect(scratch / "s", Milliseconds(20));
  ::close(listener);
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(second.error().text, HasSubstr("no connection is taken there in time"));
}

}  // namespace
}  // namespace focalfleet
