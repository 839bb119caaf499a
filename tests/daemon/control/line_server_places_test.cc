// Places of a line server's clients: which client makes room for another, which places are
// reserved, and what remains possible without descriptors.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/resource.h>
#include <unistd.h>

#include <memory>

#include "daemon/control/line_server.h"
#include "tests/daemon/control/line_server_turns.h"
#include "tests/daemon/control/raw_client.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using test::Drain;
using test::IsStop;
using test::OnlyUrgent;
using test::RawClient;
using test::Readable;
using test::Turn;
using ::testing::HasSubstr;

/// Clients that connected one after the other, each taken by the server.
class Clients {
 public:
  Clients(const std::string& path, LineServer* server) : path_(path), server_(server) {}
  /// A client whose line is read, and not handed out.
  RawClient& Add(const std::string& says = "") {
    RawClient& client = *clients_.emplace_back(std::make_unique<RawClient>(path_));
    OnlyUrgent(server_);
    client.Send(says);
    OnlyUrgent(server_);
    return client;
  }
  /// A client that waits for an answer.
  RawClient& AddBusy() {
    RawClient& client = Add("wait\n");
    EXPECT_TRUE(server_->Next());
    return client;
  }
  RawClient& operator[](std::size_t i) { return *clients_[i]; }

 private:
  std::string path_;
  LineServer* server_;
  std::vector<std::unique_ptr<RawClient>> clients_;
};

bool Ended(const RawClient& client, std::string* said) {
  bool ended = false;
  *said = client.Receive(&ended);
  return ended;
}

TEST(LineServer, AnIdleClientMakesRoomForANewcomerAndIsReportedWhy) {
  const test::ScratchFolder scratch;
  auto server = LineServer::Create(scratch / "s", {.clients_max = 3}).value();
  Clients clients(scratch / "s", &server);
  for (int i = 0; i < 3; ++i) clients.Add();
  clients[0].Send("status\n");  // so that the second one is idle longest
  server.Answer(Drain(&server).at(0).client, "fine");
  clients.Add("hello\n");
  const auto lines = Drain(&server);
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_EQ(lines[0].text, "hello");
  EXPECT_FALSE(lines[0].reserved);
  EXPECT_EQ(server.clients(), 3u);
  std::string said;
  EXPECT_TRUE(Ended(clients[1], &said));
  EXPECT_THAT(said, HasSubstr("this one was idle longest"));
  EXPECT_FALSE(Ended(clients[0], &said));
  EXPECT_EQ(said, "fine\n");
  EXPECT_FALSE(Ended(clients[2], &said));
}

TEST(LineServer, AClientThatNeverCompletesALineAgesAsAnIdleOne) {
  const test::ScratchFolder scratch;
  auto server = LineServer::Create(scratch / "s", {.clients_max = 2}).value();
  Clients clients(scratch / "s", &server);
  clients.Add("drip");
  clients.Add();
  for (int i = 0; i < 10; ++i) {
    clients[0].Send("x");
    OnlyUrgent(&server);
  }
  clients.Add("hello\n");
  EXPECT_EQ(Drain(&server).size(), 1u);
  std::string said;
  EXPECT_TRUE(Ended(clients[0], &said));
  EXPECT_FALSE(Ended(clients[1], &said));
}

TEST(LineServer, AClientThatDoesNotReadItsAnswersAgesAsAnIdleOne) {
  const test::ScratchFolder scratch;
  auto server =
      LineServer::Create(scratch / "s", {.output_bytes_pause = 10'000, .clients_max = 1}).value();
  Clients clients(scratch / "s", &server);
  clients.Add("state\nstate\n");
  const auto asked = server.Next();
  ASSERT_TRUE(asked);
  server.Answer(asked->client, std::string(2'000'000, 'y'));
  clients.Add("hello\n");
  const auto lines = Drain(&server);
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_EQ(lines[0].text, "hello");
}

// Lines that such a client sends are not taken before it reads, so they keep no place.
TEST(LineServer, AClientThatSendsOnAndDoesNotReadAgesAsAnIdleOne) {
  const test::ScratchFolder scratch;
  auto server =
      LineServer::Create(scratch / "s",
                         {.output_bytes_pause = 10'000, .clients_max = 1, .reserved_max = 0})
          .value();
  Clients clients(scratch / "s", &server);
  clients.Add("state\n");
  const auto asked = server.Next();
  ASSERT_TRUE(asked);
  server.Answer(asked->client, std::string(2'000'000, 'y'));
  clients[0].Send("state\n");
  clients.Add("hello\n");
  const auto lines = Drain(&server);
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_EQ(lines[0].text, "hello");
}

TEST(LineServer, SomethingAskedButNotReadYetIsNotIdle) {
  const test::ScratchFolder scratch;
  auto server = LineServer::Create(scratch / "s", {.clients_max = 1}).value();
  Clients clients(scratch / "s", &server);
  clients.Add();
  const RawClient newcomer(scratch / "s");
  clients[0].Send("status\n");  // both come before the server's next turn
  const auto lines = Drain(&server);
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_EQ(lines[0].text, "status");
  std::string said;
  EXPECT_TRUE(Ended(newcomer, &said));
  EXPECT_THAT(said, HasSubstr("too many clients"));
}

TEST(LineServer, WhereAllAreBusyReservedPlacesAreLeft) {
  const test::ScratchFolder scratch;
  auto server =
      LineServer::Create(scratch / "s", {.clients_max = 2, .urgent = IsStop, .reserved_max = 2})
          .value();
  Clients clients(scratch / "s", &server);
  for (int i = 0; i < 2; ++i) clients.AddBusy();
  clients.Add();
  EXPECT_EQ(server.clients(), 3u);
  const RawClient stopper(scratch / "s");
  const RawClient asker(scratch / "s");  // in the place of the idle one
  OnlyUrgent(&server);
  stopper.Send("stop\n");
  asker.Send("status\n");
  const auto lines = Drain(&server);
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_EQ(lines[0].text, "stop") << "the urgent one first";
  EXPECT_TRUE(lines[0].reserved);
  EXPECT_TRUE(lines[1].reserved) << "the answer can say that only stop is taken";
  std::string said;
  EXPECT_FALSE(Ended(clients[0], &said)) << "a client with an open request keeps its place";
}

TEST(LineServer, WithoutAnythingUrgentNoPlaceIsReservedAndOneTooManyIsReported) {
  const test::ScratchFolder scratch;
  auto server = LineServer::Create(scratch / "s", {.clients_max = 20}).value();
  Clients clients(scratch / "s", &server);
  for (int i = 0; i < 20; ++i) clients.AddBusy();
  std::string said;
  EXPECT_TRUE(Ended(clients.Add("hello\n"), &said));
  EXPECT_THAT(said, HasSubstr("too many clients"));
  EXPECT_EQ(server.clients(), 20u);
}

TEST(LineServer, AClientInAReservedPlaceGetsAnotherOneAsSoonAsThereIsOne) {
  const test::ScratchFolder scratch;
  auto server = LineServer::Create(scratch / "s", {.clients_max = 1, .urgent = IsStop}).value();
  Clients clients(scratch / "s", &server);
  clients.AddBusy();
  clients.Add();
  clients[0].Close();
  clients[1].Send("status\n");
  OnlyUrgent(&server);
  const auto lines = Drain(&server);
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_FALSE(lines[0].reserved);
}

TEST(LineServer, AFloodOfConnectionsDoesNotKeepOutPresentClients) {
  const test::ScratchFolder scratch;
  auto server = LineServer::Create(scratch / "s", {.clients_max = 64, .urgent = IsStop}).value();
  std::vector<std::unique_ptr<RawClient>> flood;
  for (int i = 0; i < 64; ++i) flood.push_back(std::make_unique<RawClient>(scratch / "s"));
  const RawClient operator_client(scratch / "s");
  for (int i = 0; i < 30; ++i) flood.push_back(std::make_unique<RawClient>(scratch / "s"));
  operator_client.Send("stop\n");
  EXPECT_EQ(Drain(&server).size(), 1u);
  EXPECT_EQ(server.clients(), 64u);
}

/// No descriptor can be opened in this process as long as it lives.
class NoDescriptors {
 public:
  NoDescriptors() {
    ::getrlimit(RLIMIT_NOFILE, &before_);
    const int next = ::dup(STDERR_FILENO);  // the lowest free one
    ::close(next);
    rlimit none = before_;
    none.rlim_cur = static_cast<rlim_t>(next);
    ::setrlimit(RLIMIT_NOFILE, &none);
  }
  ~NoDescriptors() { ::setrlimit(RLIMIT_NOFILE, &before_); }
  NoDescriptors(const NoDescriptors&) = delete;
  NoDescriptors& operator=(const NoDescriptors&) = delete;

 private:
  rlimit before_{};
};

TEST(LineServer, WithoutDescriptorsAnIdleClientMakesRoom) {
  const test::ScratchFolder scratch;
  auto server = LineServer::Create(scratch / "s", {.urgent = IsStop}).value();
  Clients clients(scratch / "s", &server);
  clients.Add();
  const RawClient newcomer(scratch / "s");
  newcomer.Send("status\n");
  const NoDescriptors none;
  const auto lines = Drain(&server);
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_FALSE(lines[0].reserved);
  std::string said;
  EXPECT_TRUE(Ended(clients[0], &said));
}

TEST(LineServer, WithoutDescriptorsAStopComesThroughAndNothingSpins) {
  const test::ScratchFolder scratch;
  auto server = LineServer::Create(scratch / "s", {.urgent = IsStop, .reserved_max = 1}).value();
  Clients clients(scratch / "s", &server);
  clients.AddBusy();
  const RawClient first(scratch / "s");
  const RawClient second(scratch / "s");
  first.Send("stop\n");
  second.Send("stop\n");
  const NoDescriptors none;
  std::vector<IncomingLine> lines;
  int turns = 0;
  for (; turns < 1000 && Readable(server.fd()); ++turns) Turn(&server, &lines);
  ASSERT_EQ(lines.size(), 1u) << "one place is reserved, and its descriptor with it";
  EXPECT_LT(turns, 20) << "a connection without a place waits, and the listener rests";
}

TEST(LineServer, AcceptsAgainAfterAPauseWhenDescriptorsAreThere) {
  const test::ScratchFolder scratch;
  auto server =
      LineServer::Create(scratch / "s", {.accept_pause = std::chrono::milliseconds(20)}).value();
  const RawClient client(scratch / "s");
  client.Send("hello\n");
  {
    const NoDescriptors none;
    EXPECT_TRUE(Drain(&server).empty());
  }
  pollfd poller{server.fd(), POLLIN, 0};
  ASSERT_EQ(::poll(&poller, 1, 30'000), 1) << "it wakes by itself";
  EXPECT_EQ(Drain(&server).size(), 1u);
}

}  // namespace
}  // namespace focalfleet
