#include "daemon/control/line_server.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>

#include "daemon/control/unix_address.h"
#include "tests/daemon/control/scratch.h"

namespace focalfleet {
namespace {

using ::testing::HasSubstr;

/// A client that does exactly what it is told, byte by byte.
class RawClient {
 public:
  explicit RawClient(const std::string& path) {
    const auto address = UnixAddress::Of(path).value();
    fd_ = ::socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    EXPECT_EQ(::connect(fd_, address.get(), address.length()), 0);
  }
  ~RawClient() { Close(); }
  RawClient(const RawClient&) = delete;
  RawClient& operator=(const RawClient&) = delete;

  std::size_t Send(std::string_view bytes) const {
    const ssize_t sent = ::send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    return sent > 0 ? static_cast<std::size_t>(sent) : 0;
  }
  /// All that is there; `ended` says whether the server closed.
  std::string Receive(bool* ended = nullptr) const {
    std::string all;
    std::array<char, 65536> chunk;
    for (;;) {
      const ssize_t got = ::recv(fd_, chunk.data(), chunk.size(), 0);
      if (ended != nullptr) *ended = got == 0;
      if (got < 0 && errno == ECONNRESET) continue;  // told once, before what was sent ahead of it
      if (got <= 0) return all;
      all.append(chunk.data(), static_cast<std::size_t>(got));
    }
  }
  void EndInput() const { ::shutdown(fd_, SHUT_WR); }
  void Close() {
    if (fd_ >= 0) ::close(fd_);
    fd_ = -1;
  }

 private:
  int fd_ = -1;
};

bool Readable(int fd) {
  pollfd poller{fd, POLLIN, 0};
  return ::poll(&poller, 1, 0) == 1;
}

/// Everything that the server hands out until it has nothing more to do.
std::vector<IncomingLine> Drain(LineServer* server) {
  std::vector<IncomingLine> lines;
  for (int i = 0; i < 100'000 && Readable(server->fd()); ++i) server->Service(&lines);
  return lines;
}

TEST(LineServer, HandsOutWholeLinesOnly) {
  const Scratch scratch;
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
  const Scratch scratch;
  const auto server = LineServer::Create(scratch / "s").value();
  struct stat info {};
  ASSERT_EQ(::stat((scratch / "s").c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777u, 0660u);
}

TEST(LineServer, GivesOneLineOfEachClientATime) {
  const Scratch scratch;
  auto server = LineServer::Create(scratch / "s").value();
  const RawClient greedy(scratch / "s");
  const RawClient modest(scratch / "s");
  greedy.Send("1\n2\n3\n");
  modest.Send("a\n");
  std::vector<IncomingLine> lines;
  server.Service(&lines);  // accepts
  lines.clear();
  server.Service(&lines);
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_NE(lines[0].client, lines[1].client);
  EXPECT_EQ(Drain(&server).size(), 2u);
}

TEST(LineServer, RefusesALineThatIsTooLongAndHangsUp) {
  const Scratch scratch;
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
  const Scratch scratch;
  auto server = LineServer::Create(scratch / "s", {.line_bytes_max = 100'000}).value();
  const RawClient client(scratch / "s");
  const std::string line = std::string(100'000, 'x') + "\n";
  std::vector<IncomingLine> lines;
  for (std::size_t sent = 0; sent < line.size() || Readable(server.fd());) {
    if (sent < line.size()) sent += client.Send(std::string_view(line).substr(sent));
    server.Service(&lines);
  }
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_EQ(lines[0].text.size(), 100'000u);
}

TEST(LineServer, PassesBinaryGarbageOnAsItCame) {
  const Scratch scratch;
  auto server = LineServer::Create(scratch / "s").value();
  const RawClient client(scratch / "s");
  client.Send(std::string_view("\0\xff\x80\n", 4));
  const auto lines = Drain(&server);
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_EQ(lines[0].text, std::string("\0\xff\x80", 3));
}

TEST(LineServer, TakesNoMoreLinesOfAClientThatDoesNotRead) {
  const Scratch scratch;
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
      server.Service(&lines);
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
  const Scratch scratch;
  auto server = LineServer::Create(scratch / "s", {.output_bytes_max = 1'000'000}).value();
  const RawClient client(scratch / "s");
  client.Send("a\n");
  const auto lines = Drain(&server);
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_FALSE(server.Answer(lines[0].client, std::string(3'000'000, 'z')));
  EXPECT_FALSE(server.connected(lines[0].client));
}

TEST(LineServer, SkipsProgressForAClientThatDoesNotRead) {
  const Scratch scratch;
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
  const Scratch scratch;
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
  const Scratch scratch;
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

TEST(LineServer, ServesManyClientsAndTellsOneTooMany) {
  const Scratch scratch;
  auto server = LineServer::Create(scratch / "s", {.clients_max = 20}).value();
  std::vector<std::unique_ptr<RawClient>> clients;
  for (int i = 0; i < 21; ++i) {
    clients.push_back(std::make_unique<RawClient>(scratch / "s"));
    clients.back()->Send("hello " + std::to_string(i) + "\n");
    Drain(&server);
  }
  EXPECT_EQ(server.clients(), 20u);
  bool ended = false;
  EXPECT_THAT(clients.back()->Receive(&ended), HasSubstr("too many clients"));
  EXPECT_TRUE(ended);
}

TEST(LineServer, ReplacesASocketFileThatNobodyAnswers) {
  const Scratch scratch;
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
  const Scratch scratch;
  const auto first = LineServer::Create(scratch / "s").value();
  const auto second = LineServer::Create(scratch / "s");
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::kRefused);
  EXPECT_THAT(second.error().text, HasSubstr("in use"));
  EXPECT_EQ(::access((scratch / "s").c_str(), F_OK), 0) << "the first one's file stays";
}

TEST(LineServer, DoesNotTakeAFileThatIsNoSocket) {
  const Scratch scratch;
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
  const Scratch scratch;
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
