#include "daemon/control/line_server.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <fstream>
#include <map>
#include <memory>

#include "daemon/control/unix_address.h"
#include "tests/daemon/control/raw_client.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using test::RawClient;
using test::ScratchFolder;
using ::testing::HasSubstr;

bool Readable(int fd) {
  pollfd poller{fd, POLLIN, 0};
  return ::poll(&poller, 1, 0) == 1;
}

/// Does a turn: urgent lines, then a line of each client that has one.
void Turn(LineServer* server, std::vector<IncomingLine>* lines) {
  server->Service(lines);
  for (std::size_t left = server->clients(); left > 0; --left)
    if (auto line = server->Next()) lines->push_back(std::move(*line));
}

/// Everything that the server hands out until it has nothing more to do.
std::vector<IncomingLine> Drain(LineServer* server) {
  std::vector<IncomingLine> lines;
  for (int i = 0; i < 100'000 && Readable(server->fd()); ++i) Turn(server, &lines);
  return lines;
}

/// Lets the server read and write what there is, and takes no line that is not urgent.
std::vector<IncomingLine> OnlyUrgent(LineServer* server) {
  std::vector<IncomingLine> lines;
  for (int i = 0; i < 100; ++i) server->Service(&lines);
  return lines;
}

bool IsStop(std::string_view line) { return line.starts_with("stop"); }

TEST(LineServer, HandsOutWholeLinesOnly) {
  const ScratchFolder scratch;
  auto server = LineServer::Create(scratch / "s").value();
  const RawClient client(scratch / "s");
  client.Send("{\"a\"");
  EXPECT_TRUE(Drain(&server).empty());
  client.Send(":1}\n{\"b\":2}\n{\"c");
  const auto lines = Drain(&server);
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_EQ(lines[0].text, "{\"a\":1}");
  EXPECT_EQ(lines[1].text, "{\"b\":2}");
  EXPECT_TRUE(server.Answer(lines[0].client, "yes"));
  EXPECT_EQ(client.Receive(), "yes\n");
}

TEST(LineServer, OnlyOwnerAndGroupMayConnect) {
  const ScratchFolder scratch;
  const auto server = LineServer::Create(scratch / "s").value();
  struct stat info {};
  ASSERT_EQ(::stat((scratch / "s").c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777u, 0660u);
}

TEST(LineServer, ClientsTakeTurns) {
  const ScratchFolder scratch;
  auto server = LineServer::Create(scratch / "s").value();
  const RawClient greedy(scratch / "s");
  const RawClient modest(scratch / "s");
  greedy.Send("1\n2\n3\n");
  modest.Send("a\nb\n");
  OnlyUrgent(&server);  // accepts, reads
  std::string order;
  while (const auto line = server.Next()) {
    order += line->text;
    OnlyUrgent(&server);
  }
  EXPECT_EQ(order, "1a2b3");
  EXPECT_FALSE(Readable(server.fd())) << "nothing is left to do";
}

TEST(LineServer, IsReadableAsLongAsALineIsLeft) {
  const ScratchFolder scratch;
  auto server = LineServer::Create(scratch / "s").value();
  const RawClient client(scratch / "s");
  client.Send("1\n2\n");
  OnlyUrgent(&server);
  EXPECT_TRUE(Readable(server.fd()));
  ASSERT_TRUE(server.Next());
  OnlyUrgent(&server);
  EXPECT_TRUE(Readable(server.fd()));
  ASSERT_TRUE(server.Next());
  OnlyUrgent(&server);
  EXPECT_FALSE(Readable(server.fd()));
}

TEST(LineServer, WhatIsUrgentGoesBeforeEverythingElseThatWasRead) {
  const ScratchFolder scratch;
  auto server = LineServer::Create(scratch / "s", {.urgent = IsStop}).value();
  std::vector<std::unique_ptr<RawClient>> askers;
  for (int i = 0; i < 40; ++i) {
    askers.push_back(std::make_unique<RawClient>(scratch / "s"));
    askers.back()->Send("state\nstate\n");
  }
  const RawClient stopper(scratch / "s");
  stopper.Send("stop\n");
  const auto urgent = OnlyUrgent(&server);
  ASSERT_EQ(urgent.size(), 1u);
  EXPECT_EQ(urgent[0].text, "stop");
  EXPECT_EQ(Drain(&server).size(), 80u);
}

TEST(LineServer, WhatIsUrgentComesFromBehindOtherLinesOfItsClientWhichSaySo) {
  const ScratchFolder scratch;
  auto server = LineServer::Create(scratch / "s", {.urgent = IsStop}).value();
  const RawClient client(scratch / "s");
  const RawClient other(scratch / "s");
  other.Send("apply y\n");
  std::string many;
  for (int i = 0; i < 1000; ++i) many += "state " + std::to_string(i) + "\n";
  client.Send("apply x\n" + many + "stop\napply z\n");
  const auto urgent = OnlyUrgent(&server);
  ASSERT_EQ(urgent.size(), 1u);
  EXPECT_FALSE(urgent[0].overtaken);
  std::map<std::string, bool> overtaken;
  for (const IncomingLine& line : Drain(&server)) overtaken[line.text] = line.overtaken;
  EXPECT_EQ(overtaken.size(), 1003u);
  EXPECT_TRUE(overtaken["apply x"]);
  EXPECT_TRUE(overtaken["state 999"]);
  EXPECT_TRUE(overtaken["apply y"]) << "who sent the stop knew nothing of it";
  EXPECT_FALSE(overtaken["apply z"]) << "it came after the stop";
}

TEST(LineServer, HearsAStopOfAClientThatReadsNoAnswers) {
  const ScratchFolder scratch;
  auto server =
      LineServer::Create(scratch / "s", {.output_bytes_pause = 10'000, .urgent = IsStop}).value();
  const RawClient client(scratch / "s");
  client.Send("state\nstate\n");
  std::vector<IncomingLine> lines;
  OnlyUrgent(&server);
  const auto asked = server.Next();
  ASSERT_TRUE(asked);
  server.Answer(asked->client, std::string(2'000'000, 'y'));
  ASSERT_FALSE(server.Next()) << "it does not read";
  client.Send("stop\n");
  EXPECT_EQ(OnlyUrgent(&server).size(), 1u);
}

TEST(LineServer, AFloodOfStopsIsOneStopOfEachClientATurn) {
  const ScratchFolder scratch;
  auto server = LineServer::Create(scratch / "s", {.urgent = IsStop}).value();
  const RawClient client(scratch / "s");
  std::vector<IncomingLine> lines;
  server.Service(&lines);
  std::string many;
  for (int i = 0; i < 1000; ++i) many += "stop\n";
  client.Send(many);
  server.Service(&lines);
  EXPECT_EQ(lines.size(), 1u);
  EXPECT_TRUE(Readable(server.fd()));
}

TEST(LineServer, ReadsNoFurtherAheadThanItsBound) {
  const ScratchFolder scratch;
  auto server = LineServer::Create(scratch / "s", {.urgent = IsStop, .ahead_bytes = 1000}).value();
  const RawClient client(scratch / "s");
  std::string lines;
  for (int i = 0; i < 3; ++i) lines += std::string(50'000, 'x') + "\n";
  client.Send(lines + "stop\n");
  EXPECT_TRUE(OnlyUrgent(&server).empty()) << "it stands too far behind";
  ASSERT_TRUE(server.Next());
  EXPECT_TRUE(OnlyUrgent(&server).empty());
  ASSERT_TRUE(server.Next());
  EXPECT_EQ(OnlyUrgent(&server).size(), 1u);
}

TEST(LineServer, RefusesALineThatIsTooLongAndHangsUp) {
  const ScratchFolder scratch;
  auto server = LineServer::Create(scratch / "s", {.line_bytes_max = 1000}).value();
  const RawClient client(scratch / "s");
  client.Send(std::string(1001, 'x'));
  EXPECT_TRUE(Drain(&server).empty());
  bool ended = false;
  EXPECT_THAT(client.Receive(&ended), HasSubstr("more than 1000 bytes"));
  EXPECT_TRUE(ended);
  EXPECT_EQ(server.clients(), 0u);
}

TEST(LineServer, TakesALineOfTheGreatestLength) {
  const ScratchFolder scratch;
  auto server = LineServer::Create(scratch / "s", {.line_bytes_max = 100'000}).value();
  const RawClient client(scratch / "s");
  const std::string line = std::string(100'000, 'x') + "\n";
  std::vector<IncomingLine> lines;
  for (std::size_t sent = 0; sent < line.size() || Readable(server.fd());) {
    if (sent < line.size()) sent += client.Send(std::string_view(line).substr(sent));
    Turn(&server, &lines);
  }
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_EQ(lines[0].text.size(), 100'000u);
}

TEST(LineServer, PassesBinaryGarbageOnAsItCame) {
  const ScratchFolder scratch;
  auto server = LineServer::Create(scratch / "s").value();
  const RawClient client(scratch / "s");
  client.Send(std::string_view("\0\xff\x80\n", 4));
  const auto lines = Drain(&server);
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_EQ(lines[0].text, std::string("\0\xff\x80", 3));
}

TEST(LineServer, TakesNoMoreLinesOfAClientThatDoesNotRead) {
  const ScratchFolder scratch;
  auto server = LineServer::Create(scratch / "s", {.output_bytes_pause = 10'000}).value();
  const RawClient client(scratch / "s");
  std::string asked;
  for (int i = 0; i < 100; ++i) asked += "more\n";
  client.Send(asked);
  const std::string big(400'000, 'y');
  std::vector<IncomingLine> lines;
  std::size_t answered = 0;
  const auto answer_all = [&] {
    for (int i = 0; i < 1000 && Readable(server.fd()); ++i) {
      Turn(&server, &lines);
      for (; answered < lines.size(); ++answered) server.Answer(lines[answered].client, big);
    }
  };
  answer_all();
  EXPECT_LT(lines.size(), 5u);
  EXPECT_EQ(server.clients(), 1u);
  std::size_t received = 0;
  for (int i = 0; i < 100'000 && lines.size() < 100; ++i) {
    received += client.Receive().size();
    answer_all();
  }
  EXPECT_EQ(lines.size(), 100u) << "reading sets it going again";
  EXPECT_GT(received, 0u);
}

TEST(LineServer, DropsAClientForWhomTooMuchWaits) {
  const ScratchFolder scratch;
  auto server = LineServer::Create(scratch / "s", {.output_bytes_max = 1'000'000}).value();
  const RawClient client(scratch / "s");
  client.Send("a\n");
  const auto lines = Drain(&server);
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_FALSE(server.Answer(lines[0].client, std::string(3'000'000, 'z')));
  EXPECT_FALSE(server.connected(lines[0].client));
}

TEST(LineServer, SkipsProgressForAClientThatDoesNotRead) {
  const ScratchFolder scratch;
  auto server = LineServer::Create(scratch / "s", {.progress_bytes_max = 1000}).value();
  const RawClient client(scratch / "s");
  client.Send("wait\n");
  const auto lines = Drain(&server);
  ASSERT_EQ(lines.size(), 1u);
  const std::string progress(10'000, 'p');
  for (int i = 0; i < 10'000; ++i) ASSERT_TRUE(server.Progress(lines[0].client, progress));
  EXPECT_TRUE(server.Answer(lines[0].client, "done"));
  std::string all;
  for (int i = 0; i < 1000 && !all.ends_with("done\n"); ++i) {
    all += client.Receive();
    Drain(&server);
  }
  EXPECT_TRUE(all.ends_with("done\n")) << "the last answer is never skipped";
  EXPECT_LT(all.size(), 2'000'000u);
}

TEST(LineServer, HearsTheLastWordsOfAClientThatHangsUp) {
  const ScratchFolder scratch;
  auto server = LineServer::Create(scratch / "s").value();
  RawClient client(scratch / "s");
  client.Send("stop\nstop again\n");
  client.Close();
  const auto lines = Drain(&server);
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_EQ(lines[1].text, "stop again");
  EXPECT_EQ(server.clients(), 0u);
  EXPECT_FALSE(server.Answer(lines[0].client, "too late"));
}

TEST(LineServer, AnswersAClientThatEndedItsInputAndThenHangsUp) {
  const ScratchFolder scratch;
  auto server = LineServer::Create(scratch / "s").value();
  const RawClient client(scratch / "s");
  client.Send("status\n");
  client.EndInput();
  const auto lines = Drain(&server);
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_EQ(server.clients(), 1u);
  server.Answer(lines[0].client, "fine");
  bool ended = false;
  EXPECT_EQ(client.Receive(&ended), "fine\n");
  EXPECT_TRUE(ended);
}

/// Clients that connected one after the other, each taken by the server.
class Crowd {
 public:
  Crowd(const std::string& path, LineServer* server) : path_(path), server_(server) {}
  /// A client; what it says is read, and not handed out.
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
  const ScratchFolder scratch;
  auto server = LineServer::Create(scratch / "s", {.clients_max = 3}).value();
  Crowd crowd(scratch / "s", &server);
  for (int i = 0; i < 3; ++i) crowd.Add();
  crowd[0].Send("status\n");  // so that the second one is idle longest
  server.Answer(Drain(&server).at(0).client, "fine");
  crowd.Add("hello\n");
  const auto lines = Drain(&server);
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_EQ(lines[0].text, "hello");
  EXPECT_FALSE(lines[0].reserved);
  EXPECT_EQ(server.clients(), 3u);
  std::string said;
  EXPECT_TRUE(Ended(crowd[1], &said));
  EXPECT_THAT(said, HasSubstr("this one was idle longest"));
  EXPECT_FALSE(Ended(crowd[0], &said));
  EXPECT_EQ(said, "fine\n");
  EXPECT_FALSE(Ended(crowd[2], &said));
}

TEST(LineServer, AClientThatNeverCompletesALineAgesAsAnIdleOne) {
  const ScratchFolder scratch;
  auto server = LineServer::Create(scratch / "s", {.clients_max = 2}).value();
  Crowd crowd(scratch / "s", &server);
  crowd.Add("drip");
  crowd.Add();
  for (int i = 0; i < 10; ++i) {
    crowd[0].Send("x");
    OnlyUrgent(&server);
  }
  crowd.Add("hello\n");
  EXPECT_EQ(Drain(&server).size(), 1u);
  std::string said;
  EXPECT_TRUE(Ended(crowd[0], &said));
  EXPECT_FALSE(Ended(crowd[1], &said));
}

TEST(LineServer, AClientThatDoesNotReadItsAnswersAgesAsAnIdleOne) {
  const ScratchFolder scratch;
  auto server =
      LineServer::Create(scratch / "s", {.output_bytes_pause = 10'000, .clients_max = 1}).value();
  Crowd crowd(scratch / "s", &server);
  crowd.Add("state\nstate\n");
  const auto asked = server.Next();
  ASSERT_TRUE(asked);
  server.Answer(asked->client, std::string(2'000'000, 'y'));
  crowd.Add("hello\n");
  const auto lines = Drain(&server);
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_EQ(lines[0].text, "hello");
}

// Lines that such a client sends are not taken before it reads, so they keep no place.
TEST(LineServer, AClientThatSendsOnAndDoesNotReadAgesAsAnIdleOne) {
  const ScratchFolder scratch;
  auto server =
      LineServer::Create(scratch / "s",
                         {.output_bytes_pause = 10'000, .clients_max = 1, .reserved_max = 0})
          .value();
  Crowd crowd(scratch / "s", &server);
  crowd.Add("state\n");
  const auto asked = server.Next();
  ASSERT_TRUE(asked);
  server.Answer(asked->client, std::string(2'000'000, 'y'));
  crowd[0].Send("state\n");
  crowd.Add("hello\n");
  const auto lines = Drain(&server);
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_EQ(lines[0].text, "hello");
}

TEST(LineServer, SomethingAskedButNotReadYetIsNotIdle) {
  const ScratchFolder scratch;
  auto server = LineServer::Create(scratch / "s", {.clients_max = 1}).value();
  Crowd crowd(scratch / "s", &server);
  crowd.Add();
  const RawClient newcomer(scratch / "s");
  crowd[0].Send("status\n");  // both before the server's next turn
  const auto lines = Drain(&server);
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_EQ(lines[0].text, "status");
  std::string said;
  EXPECT_TRUE(Ended(newcomer, &said));
  EXPECT_THAT(said, HasSubstr("too many clients"));
}

TEST(LineServer, WhereAllAreBusyReservedPlacesAreLeft) {
  const ScratchFolder scratch;
  auto server =
      LineServer::Create(scratch / "s", {.clients_max = 2, .urgent = IsStop, .reserved_max = 2})
          .value();
  Crowd crowd(scratch / "s", &server);
  for (int i = 0; i < 2; ++i) crowd.AddBusy();
  crowd.Add();
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
  EXPECT_TRUE(lines[1].reserved) << "whoever answers can say that only stop is taken";
  std::string said;
  EXPECT_FALSE(Ended(crowd[0], &said)) << "who has something open keeps its place";
}

TEST(LineServer, WithoutAnythingUrgentNoPlaceIsReservedAndOneTooManyIsReported) {
  const ScratchFolder scratch;
  auto server = LineServer::Create(scratch / "s", {.clients_max = 20}).value();
  Crowd crowd(scratch / "s", &server);
  for (int i = 0; i < 20; ++i) crowd.AddBusy();
  std::string said;
  EXPECT_TRUE(Ended(crowd.Add("hello\n"), &said));
  EXPECT_THAT(said, HasSubstr("too many clients"));
  EXPECT_EQ(server.clients(), 20u);
}

TEST(LineServer, WhoHasAReservedPlaceGetsAnotherOneAsSoonAsThereIsOne) {
  const ScratchFolder scratch;
  auto server = LineServer::Create(scratch / "s", {.clients_max = 1, .urgent = IsStop}).value();
  Crowd crowd(scratch / "s", &server);
  crowd.AddBusy();
  crowd.Add();
  crowd[0].Close();
  crowd[1].Send("status\n");
  OnlyUrgent(&server);
  const auto lines = Drain(&server);
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_FALSE(lines[0].reserved);
}

TEST(LineServer, AFloodOfConnectionsDoesNotKeepOutWhoIsThere) {
  const ScratchFolder scratch;
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
    const int next = ::dup(STDERR_FILENO);  // the lowest that is free
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
  const ScratchFolder scratch;
  auto server = LineServer::Create(scratch / "s", {.urgent = IsStop}).value();
  Crowd crowd(scratch / "s", &server);
  crowd.Add();
  const RawClient newcomer(scratch / "s");
  newcomer.Send("status\n");
  const NoDescriptors none;
  const auto lines = Drain(&server);
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_FALSE(lines[0].reserved);
  std::string said;
  EXPECT_TRUE(Ended(crowd[0], &said));
}

TEST(LineServer, WithoutDescriptorsAStopComesThroughAndNothingSpins) {
  const ScratchFolder scratch;
  auto server = LineServer::Create(scratch / "s", {.urgent = IsStop, .reserved_max = 1}).value();
  Crowd crowd(scratch / "s", &server);
  crowd.AddBusy();
  const RawClient first(scratch / "s");
  const RawClient second(scratch / "s");
  first.Send("stop\n");
  second.Send("stop\n");
  const NoDescriptors none;
  std::vector<IncomingLine> lines;
  int turns = 0;
  for (; turns < 1000 && Readable(server.fd()); ++turns) Turn(&server, &lines);
  ASSERT_EQ(lines.size(), 1u) << "one place is reserved, and its descriptor with it";
  EXPECT_LT(turns, 20) << "who cannot be taken waits, and the listener is left alone";
}

TEST(LineServer, AcceptsAgainAfterAPauseWhenDescriptorsAreThere) {
  const ScratchFolder scratch;
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

TEST(LineServer, ReplacesASocketFileThatNobodyAnswers) {
  const ScratchFolder scratch;
  const auto address = UnixAddress::Of(scratch / "s").value();
  const int dead = ::socket(AF_UNIX, SOCK_STREAM, 0);
  ASSERT_EQ(::bind(dead, address.get(), address.length()), 0);
  ::close(dead);  // as after kill -9: the file stays
  auto server = LineServer::Create(scratch / "s");
  ASSERT_TRUE(server) << server.error().text;
  const RawClient client(scratch / "s");
  client.Send("hello\n");
  EXPECT_EQ(Drain(&*server).size(), 1u);
}

TEST(LineServer, RefusesASocketThatALiveServerHolds) {
  const ScratchFolder scratch;
  const auto first = LineServer::Create(scratch / "s").value();
  const auto second = LineServer::Create(scratch / "s");
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::kRefused);
  EXPECT_THAT(second.error().text, HasSubstr("in use"));
  EXPECT_EQ(::access((scratch / "s").c_str(), F_OK), 0) << "the first one's file stays";
}

TEST(LineServer, DoesNotTakeAFileThatIsNoSocket) {
  const ScratchFolder scratch;
  std::ofstream(scratch / "s") << "precious";
  const auto server = LineServer::Create(scratch / "s");
  ASSERT_FALSE(server);
  EXPECT_THAT(server.error().text, HasSubstr("not a socket"));
}

TEST(LineServer, NamesAPathThatIsTooLongOrNotThere) {
  EXPECT_THAT(LineServer::Create(std::string(200, 'x')).error().text, HasSubstr("107 bytes"));
  EXPECT_THAT(LineServer::Create("/no/such/place/s").error().text, HasSubstr("/no/such/place/s"));
}

TEST(LineServer, RemovesItsSocketFileButNotItsSuccessors) {
  const ScratchFolder scratch;
  { const auto server = LineServer::Create(scratch / "s").value(); }
  EXPECT_NE(::access((scratch / "s").c_str(), F_OK), 0);
  {
    const auto server = LineServer::Create(scratch / "s").value();
    ::unlink((scratch / "s").c_str());
    std::ofstream(scratch / "s") << "another's";
  }
  EXPECT_EQ(::access((scratch / "s").c_str(), F_OK), 0);
}

}  // namespace
}  // namespace focalfleet
