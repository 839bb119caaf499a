#include "daemon/control/line_server.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <memory>

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
using test::ScratchFolder;
using test::Turn;
using ::testing::HasSubstr;

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

TEST(LineServer, AnUrgentLineGoesBeforeAllOtherLines) {
  const test::ScratchFolder scratch;
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

TEST(LineServer, AnUrgentLineOvertakesLinesOfItsClientWhichAreMarked) {
  const test::ScratchFolder scratch;
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
  for (auto lines = Drain(&server); !lines.empty(); lines = Drain(&server))
    for (const IncomingLine& line : lines) {
      overtaken[line.text] = line.overtaken;
      server.Answer(line.client, "");
    }
  EXPECT_EQ(overtaken.size(), 1003u);
  EXPECT_TRUE(overtaken["apply x"]);
  EXPECT_TRUE(overtaken["state 999"]);
  EXPECT_TRUE(overtaken["apply y"]) << "the stop counts for lines of other clients, too";
  EXPECT_FALSE(overtaken["apply z"]) << "it came after the stop";
}

TEST(LineServer, TakesAStopOfAClientThatReadsNoAnswers) {
  const test::ScratchFolder scratch;
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

TEST(LineServer, RefusesALineThatIsTooLongAndCloses) {
  const test::ScratchFolder scratch;
  auto server = LineServer::Create(scratch / "s", {.line_bytes_max = 1000}).value();
  const RawClient client(scratch / "s");
  client.Send(std::string(1001, 'x'));
  EXPECT_TRUE(Drain(&server).empty());
  bool ended = false;
  EXPECT_THAT(client.Receive(&ended), HasSubstr("more than 1000 bytes"));
  EXPECT_TRUE(ended);
  EXPECT_EQ(server.clients(), 0u);
}

TEST(LineServer, TheLengthOfALineGoesByTheRoleOfItsClient) {
  const test::ScratchFolder scratch;
  Role role = Role::kViewer;
  auto server = LineServer::Create(
                    scratch / "s",
                    {.line_bytes_max_of = [](Role of) { return of == Role::kViewer ? 10u : 1000u; },
                     .role_of = [&role](const auto&) { return role; }})
                    .value();
  const RawClient viewer(scratch / "s");
  OnlyUrgent(&server);
  role = Role::kEngineer;
  const RawClient engineer(scratch / "s");
  viewer.Send(std::string(11, 'x') + "\n");
  engineer.Send(std::string(11, 'x') + "\n");
  EXPECT_EQ(Drain(&server).size(), 1u);
  EXPECT_THAT(viewer.Receive(), HasSubstr("more than 10 bytes"));
  EXPECT_EQ(engineer.Receive(), "");
}

TEST(LineServer, AClientHasSoManyRequestsOpenAndNoMore) {
  const ScratchFolder scratch;
  auto server = LineServer::Create(scratch / "s", {.urgent = &IsStop}).value();
  const RawClient greedy(scratch / "s");
  const RawClient modest(scratch / "s");
  std::string many;
  for (int n = 0; n < 100; ++n) many += std::to_string(n) + "\n";
  greedy.Send(many);
  modest.Send("a\n");
  const auto lines = Drain(&server);
  ASSERT_EQ(lines.size(), limits::kControlRequestsOpen + 1) << "and that of the other client";
  EXPECT_FALSE(Readable(server.fd())) << "nothing is to be done until one is answered";
  const auto of_greedy =
      std::ranges::find_if(lines, [](const IncomingLine& line) { return line.text == "7"; });
  ASSERT_NE(of_greedy, lines.end());
  EXPECT_TRUE(server.Progress(of_greedy->client, "goes on"));
  EXPECT_TRUE(Drain(&server).empty()) << "progress is no answer";
  EXPECT_TRUE(server.Answer(of_greedy->client, "done"));
  const auto next = Drain(&server);
  ASSERT_EQ(next.size(), 1u);
  EXPECT_EQ(next[0].text, "8");
  greedy.Send("stop\n");
  const auto stop = Drain(&server);
  ASSERT_EQ(stop.size(), 1u) << "a stop waits for no answer";
  EXPECT_EQ(stop[0].text, "stop");
}

TEST(LineServer, AClientThatClosedKeepsNoPlaceForItsOpenRequests) {
  const ScratchFolder scratch;
  auto server = LineServer::Create(scratch / "s", {.urgent = &IsStop}).value();
  RawClient client(scratch / "s");
  std::string many;
  for (int n = 0; n < 100; ++n) many += std::to_string(n) + "\n";
  client.Send(many);
  EXPECT_EQ(Drain(&server).size(), limits::kControlRequestsOpen);
  client.Close();
  EXPECT_EQ(Drain(&server).size(), 100 - limits::kControlRequestsOpen) << "they still count";
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

TEST(LineServer, DropsAClientThatLeavesTooMuchUnread) {
  const test::ScratchFolder scratch;
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

TEST(LineServer, TakesTheLastLinesOfAClientThatCloses) {
  const test::ScratchFolder scratch;
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

TEST(LineServer, AnswersAClientThatEndedItsInputAndThenCloses) {
  const test::ScratchFolder scratch;
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

}  // namespace
}  // namespace focalfleet
