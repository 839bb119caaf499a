#include "daemon/verbs/request_handler.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "daemon/control/line_client.h"
#include "daemon/status/status_json.h"
#include "fleet/plan/job.h"
#include "protocol/base/limits.h"
#include "tests/daemon/control/raw_client.h"
#include "tests/daemon/verbs/model_text.h"
#include "tests/daemon/verbs/small_fleet.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using test::RawClient;
using test::ScratchFolder;
using test::SmallFleet;
using ::testing::HasSubstr;

std::string Line(std::uint64_t id, const std::string& verb, const Json& args = Json::object()) {
  return EncodeRequest({id, verb, args}) + "\n";
}

/// A request handler and its clients; its turns are taken one by one.
class RequestHandlerTest : public ::testing::Test {
 protected:
  explicit RequestHandlerTest(std::uint32_t units = 3)
      : fleet_(units),
        handler_(
            std::make_unique<LineServer>(
                LineServer::Create(scratch_ / "s", {.urgent = &RequestHandler::IsStop}).value()),
            {.facts = [] { return ShellFacts{}; },
             .log = [this](const std::string& text) { log_ += text + "\n"; },
             .store_path = scratch_ / "none.db",
             .models = &models_,
             .alarms = &alarms_,
             .room_for_rows = [this] { return room_; }}) {}

  RawClient& Add(const std::string& says = "") {
    RawClient& client = *clients_.emplace_back(std::make_unique<RawClient>(scratch_ / "s"));
    client.Send(says);
    return client;
  }
  std::size_t Turn() {
    const std::size_t before = commands_.size();
    handler_.Service(fleet_.View(), &commands_);
    return commands_.size() - before;
  }
  void TurnUntilQuiet() {
    for (int i = 0; i < 100'000 && Waits(); ++i) Turn();
  }
  [[nodiscard]] bool Waits() const {
    pollfd poller{handler_.fd(), POLLIN, 0};
    return ::poll(&poller, 1, 0) == 1;
  }
  [[nodiscard]] std::size_t Stops() const {
    return static_cast<std::size_t>(std::ranges::count_if(commands_, [](const Command& command) {
      return std::holds_alternative<StopCommand>(command.what);
    }));
  }

  const ScratchFolder scratch_;
  SmallFleet fleet_;
  std::string log_;
  ModelRegistry models_{&fleet_.layout()};
  AlarmRegister alarms_;
  Status room_;  // for rows
  RequestHandler handler_;
  std::vector<std::unique_ptr<RawClient>> clients_;
  std::vector<Command> commands_;
};

TEST_F(RequestHandlerTest, AStopIsHandledAloneBeforeAllOtherLines) {
  for (int i = 0; i < 10; ++i) Add(Line(1, "status"));
  Turn();  // accepts the clients, some in each turn
  TurnUntilQuiet();
  for (auto& client : clients_) {
    static_cast<void>(client->Receive());
    client->Send(Line(2, "status"));
  }
  Add();
  TurnUntilQuiet();
  for (auto& client : clients_) static_cast<void>(client->Receive());
  for (std::size_t i = 0; i < 10; ++i) clients_[i]->Send(Line(3, "status"));
  clients_[10]->Send(Line(3, "stop"));
  EXPECT_EQ(Turn(), 1u);
  EXPECT_EQ(Stops(), 1u);
  for (std::size_t i = 0; i < 10; ++i)
    EXPECT_EQ(clients_[i]->Receive(), "") << "no question before the stop is on the buses";
  TurnUntilQuiet();
  for (std::size_t i = 0; i < 10; ++i) EXPECT_THAT(clients_[i]->Receive(), HasSubstr(R"("id":3)"));
}

TEST_F(RequestHandlerTest, AFloodOfStopsKeepsNoClientOut) {
  std::string flood;
  for (std::uint64_t id = 1; id <= 200; ++id) flood += Line(id, "stop");
  Add();
  Add();
  TurnUntilQuiet();
  clients_[0]->Send(flood);
  clients_[1]->Send(Line(1, "status"));
  Turn();
  Turn();
  EXPECT_THAT(clients_[1]->Receive(), HasSubstr(R"("ok":true)")) << "the second turn is for all";
  TurnUntilQuiet();
  EXPECT_EQ(Stops(), 200u);
}

class BusyRequestHandlerTest : public RequestHandlerTest {
 protected:
  BusyRequestHandlerTest() : RequestHandlerTest(500) {}
};

TEST_F(RequestHandlerTest, WhoWaitsForTheStateIsAnsweredAtTheEnd) {
  Add(Line(1, "state"));
  TurnUntilQuiet();
  EXPECT_EQ(handler_.wake_at(), HostInstant{0});
  handler_.states().Serve(fleet_.View(), [](StateRows*) { return true; });
  EXPECT_EQ(handler_.wake_at(), kNever) << "the other thread wakes the core";
  handler_.Close();
  EXPECT_THAT(clients_[0]->Receive(), HasSubstr("the daemon ends"));
}

TEST_F(BusyRequestHandlerTest, CheapLinesShareATurnWithinItsBudget) {
  const std::size_t answer = EncodeResult(1, UnitJson(fleet_.View(), {0})).size();
  const std::size_t line = Line(1, "unit", {{"unit_id", 1}}).size() - 1;
  const std::size_t most =
      RequestHandler::kTurnBytes / (answer + line + RequestHandler::kLineBytes) + 1;
  Add();
  TurnUntilQuiet();
  std::string many;
  for (int i = 0; i < 500; ++i) many += Line(1, "unit", {{"unit_id", 1}});
  clients_[0]->Send(many);
  Turn();
  const std::string answers = clients_[0]->Receive();
  EXPECT_EQ(static_cast<std::size_t>(std::ranges::count(answers, '\n')), most);
  EXPECT_TRUE(Waits());
}

TEST_F(RequestHandlerTest, AMotionThatAStopOvertookIsRefused) {
  const Json apply = {{"targets_csv", "unit_id,theta_deg,phi_deg\n1,10,90\n"}};
  Add();
  Add();
  TurnUntilQuiet();
  clients_[1]->Send(Line(5, "apply", apply));
  clients_[0]->Send(Line(1, "apply", apply) + Line(2, "home", {{"unit_ids", {1}}}) +
                    Line(3, "disable", {{"unit_ids", {1}}, {"reason", "stalls"}}) +
                    Line(4, "stop") + Line(6, "home", {{"unit_ids", {2}}}));
  TurnUntilQuiet();
  ASSERT_EQ(commands_.size(), 3u);
  EXPECT_TRUE(std::holds_alternative<StopCommand>(commands_[0].what));
  EXPECT_TRUE(std::holds_alternative<EnableCommand>(commands_[1].what));
  EXPECT_TRUE(std::holds_alternative<HomeCommand>(commands_[2].what)) << "it came after the stop";
  const std::string reported = clients_[0]->Receive();
  EXPECT_THAT(reported, HasSubstr("a stop that came before apply was begun went ahead of it"));
  EXPECT_THAT(reported, HasSubstr("a stop that came before home was begun went ahead of it"));
  EXPECT_THAT(clients_[1]->Receive(), HasSubstr("went ahead of it")) << "of another client, too";
}

TEST_F(RequestHandlerTest, WhereAllPlacesAreBusyOnlyStopIsTaken) {
  for (std::uint32_t i = 0; i < limits::kControlClients; ++i) {
    Add(Line(1, "adopt", {{"unit_id", 1}}));  // stays open: the coordinator is not stepped
    TurnUntilQuiet();
  }
  Add(Line(7, "status"));
  TurnUntilQuiet();
  const std::string reported = clients_.back()->Receive();
  EXPECT_THAT(reported, HasSubstr("too many clients, only stop is taken"));
  EXPECT_THAT(reported, HasSubstr(R"("id":7)"));
  EXPECT_EQ(Stops(), 0u);
  clients_.back()->Send(Line(8, "stop"));
  TurnUntilQuiet();
  EXPECT_EQ(Stops(), 1u);
  Add(R"({"id":1,"verb":"\u0073top"})"
      "\n");
  TurnUntilQuiet();
  EXPECT_EQ(Stops(), 2u) << "written otherwise it is a stop all the same";
}

TEST_F(RequestHandlerTest, AnAcknowledgementIsKeptWithItsUser) {
  std::vector<Row> rows = {
      AlarmRow{4, Severity::kError, UnitId{1}, {}, "silent", AlarmName::kUnitSilent}};
  alarms_.Take(WallTime::Now(), &rows);
  Add(Line(1, "alarms"));
  TurnUntilQuiet();
  const std::string listed = clients_[0]->Receive();
  EXPECT_THAT(listed, HasSubstr(R"("name":"UnitSilent")"));
  EXPECT_THAT(listed, HasSubstr(R"("runbook":"docs/runbook.md#unitsilent")"));
  clients_[0]->Send(Line(2, "alarms_ack", {{"ids", {5}}}) + Line(3, "alarms_ack", {{"ids", {4}}}));
  TurnUntilQuiet();
  EXPECT_THAT(clients_[0]->Receive(), HasSubstr("alarm 5 is not open"));
  ASSERT_EQ(commands_.size(), 1u);
  const auto& keep = std::get<KeepRowsCommand>(commands_[0].what);
  EXPECT_EQ(keep.text, "1 alarm is acknowledged");
  EXPECT_EQ(std::get<OpenAlarmRow>(keep.rows.at(0)).acknowledged_by,
            "uid " + std::to_string(::getuid()));
  const Effects effects = fleet_.Step({.now = {}, .commands = commands_});
  EXPECT_TRUE(effects.replies.empty()) << "it is answered when it is durable";
  clients_[0]->Send(Line(4, "alarms") + Line(5, "alarms", {{"severity", "bad"}}) +
                    Line(6, "alarms_mute", {{"name", "BusDown"}, {"reason", "r"}, {"for_s", 1e9}}));
  TurnUntilQuiet();
  const std::string after = clients_[0]->Receive();
  EXPECT_THAT(after, HasSubstr(R"("alarms":[])"));
  EXPECT_THAT(after, HasSubstr("severity must be info, warning or error"));
  EXPECT_THAT(after, HasSubstr("at most 31 days"));
}

TEST_F(RequestHandlerTest, WaitIsAnsweredAtOnceWhereNothingIsUnderWay) {
  Add(Line(1, "wait"));
  TurnUntilQuiet();
  EXPECT_THAT(clients_[0]->Receive(), HasSubstr(R"({"under_way":false})"));
  EXPECT_EQ(handler_.wake_at(), kNever);
}

TEST_F(RequestHandlerTest, UnitsAreSelectedByConditionsThatHoldTogether) {
  Add(Line(1, "select", {{"unit_ids", {3, 1}}, {"states", {"absent"}}}) +
      Line(2, "select", {{"bus_ids", {0}}, {"states", {"unknown", "fault"}}}) +
      Line(3, "select", {{"states", {"fault"}}}) + Line(4, "select", {{"states", {"lazy"}}}) +
      Line(5, "select", {{"bus_ids", {9}}}) + Line(6, "select", {{"unit_ids", {9}}}) +
      Line(7, "select"));
  TurnUntilQuiet();
  const std::string answers = clients_[0]->Receive();
  EXPECT_THAT(answers, HasSubstr(R"("id":1,"ok":true,"result":{"unit_ids":[1,3]})"));
  EXPECT_THAT(answers, HasSubstr(R"("id":2,"ok":true,"result":{"unit_ids":[1,2,3]})"));
  EXPECT_THAT(answers, HasSubstr("no unit is so"));
  EXPECT_THAT(answers, HasSubstr("there is no state 'lazy'"));
  EXPECT_THAT(answers, HasSubstr("there is no bus 9"));
  EXPECT_THAT(answers, HasSubstr("there is no unit 9"));
  EXPECT_THAT(answers, HasSubstr("no unit named"));
}

TEST_F(RequestHandlerTest, ADryRunIsPlannedAndChangesNothing) {
  const Json args = {{"targets_csv", "unit_id,theta_deg,phi_deg\n1,10,90\n"}};
  Add(Line(1, "preview", args) + Line(2, "preview", args));
  TurnUntilQuiet();
  EXPECT_TRUE(commands_.empty());
  EXPECT_THAT(clients_[0]->Receive(), HasSubstr("another dry run is being planned"));
  const auto job = handler_.TakePreview();
  ASSERT_TRUE(job);
  EXPECT_EQ(job->purpose, PlanPurpose::kPreview);
  EXPECT_FALSE(job->targets[0]) << "the unit was never heard, so it cannot go";
  EXPECT_FALSE(handler_.TakePreview()) << "it is handed out once";
  handler_.PreviewDone(fleet_.View(), {.purpose = PlanPurpose::kPreview, .plan = Plan{}});
  const std::string answer = clients_[0]->Receive();
  EXPECT_THAT(answer, HasSubstr(R"("served":0,"targeted":1)"));
  EXPECT_THAT(answer, HasSubstr(R"("outcome":"refused")"));
  EXPECT_FALSE(fleet_.View().coordinator->busy());
  clients_[0]->Send(Line(3, "preview", args));
  TurnUntilQuiet();
  ASSERT_TRUE(handler_.TakePreview());
  handler_.PreviewDone(fleet_.View(), {.purpose = PlanPurpose::kPreview,
                                       .plan = Fail(ErrorCode::kRefused, "given up")});
  EXPECT_THAT(clients_[0]->Receive(), HasSubstr("given up"));
}

TEST_F(RequestHandlerTest, ADryRunShowsThatItIsPlanned) {
  EXPECT_EQ(handler_.wake_at(), kNever);
  Add(Line(7, "preview", {{"targets_csv", "unit_id,theta_deg,phi_deg\n1,10,90\n"}}));
  TurnUntilQuiet();
  auto job = handler_.TakePreview();
  ASSERT_TRUE(job);
  EXPECT_NE(handler_.wake_at(), kNever);
  handler_.ShowProgress(fleet_.View(HostInstant{Seconds(130).ns}));
  TurnUntilQuiet();
  const std::string progress = clients_[0]->Receive();
  EXPECT_THAT(progress, HasSubstr(R"("progress":{)"));
  EXPECT_THAT(progress, HasSubstr(R"("elapsed_s":130.0)"));
  handler_.PreviewDone(fleet_.View(), PlanFailed(*job, {ErrorCode::kUnavailable, "no room"}));
  EXPECT_EQ(handler_.wake_at(), kNever) << "it is over";
}

TEST_F(RequestHandlerTest, ARetargetThatWaitsShowsThatTheDaemonLives) {
  Add(Line(8, "retarget", {{"unit_id", 1}, {"theta_deg", 10}, {"phi_deg", 90}}));
  TurnUntilQuiet();
  ASSERT_EQ(commands_.size(), 1u);
  handler_.ShowProgress(fleet_.View(HostInstant{Seconds(130).ns}));
  TurnUntilQuiet();
  EXPECT_THAT(clients_[0]->Receive(), HasSubstr(R"({"id":8,"progress":{)"));
  handler_.Reply(fleet_.View(), {commands_[0].request, true, {}, "unit 1 goes"});
  EXPECT_EQ(handler_.wake_at(), kNever);
}

TEST_F(RequestHandlerTest, QuestionsToTheStoreAreAnsweredByAnotherThread) {
  std::vector<std::string> verbs = {"history", "events", "params", "measurements", "alarms"};
  RawClient& client = Add();
  for (std::size_t n = 0; n < verbs.size(); ++n)
    client.Send(Line(n + 1, verbs[n], {{"all", true}, {"unit_id", 1}}));
  TurnUntilQuiet();
  std::vector<StoreQuestion> handed_over;
  const auto submit = [&](StoreQuestion* question) {
    if (handed_over.size() == 3) return false;  // no room
    handed_over.push_back(std::move(*question));
    return true;
  };
  handler_.SubmitQuestions(submit);
  EXPECT_EQ(handed_over.size(), 3u);
  std::vector<StoreQuestion> rest;
  handler_.SubmitQuestions([&](StoreQuestion* question) {
    rest.push_back(std::move(*question));
    return true;
  });
  ASSERT_EQ(rest.size(), 2u);
  const std::atomic<bool> ending{false};
  StoreQuestions store(scratch_ / "none.db");
  for (const StoreQuestion& question : handed_over) handler_.Answered(store(question, ending));
  TurnUntilQuiet();
  const std::string answers = client.Receive();
  EXPECT_EQ(std::ranges::count(answers, '\n'), 3) << answers;
  EXPECT_THAT(answers, HasSubstr("none.db: No such file"));
  handler_.Close();
  EXPECT_THAT(client.Receive(), HasSubstr("the daemon ends"));
}

TEST_F(RequestHandlerTest, OpenAlarmsNeedNoStore) {
  Add(Line(1, "alarms"));
  TurnUntilQuiet();
  EXPECT_THAT(clients_[0]->Receive(), HasSubstr(R"("alarms":[])"));
}

TEST_F(RequestHandlerTest, QuestionsThatWaitForTheStoreAreBounded) {
  std::string many;
  for (std::uint64_t n = 1; n <= limits::kControlRequestsOpen; ++n) many += Line(n, "history");
  for (std::size_t open = 0; open < limits::kControlClients; open += limits::kControlRequestsOpen) {
    Add(many);
    TurnUntilQuiet();
  }
  EXPECT_EQ(clients_.back()->Receive(), "");
  Add(Line(1, "history"));
  TurnUntilQuiet();
  EXPECT_THAT(clients_.back()->Receive(), HasSubstr("64 questions wait for the store"));
}

TEST_F(RequestHandlerTest, WhereTooManyRowsWaitForTheDiskStopAloneIsTaken) {
  room_ = Fail(ErrorCode::kUnavailable, "it cannot be stored: 65 MiB of rows wait");
  std::vector<Row> rows = {
      AlarmRow{4, Severity::kError, UnitId{1}, {}, "silent", AlarmName::kUnitSilent}};
  alarms_.Take(WallTime::Now(), &rows);
  Add(Line(1, "disable", {{"unit_ids", {1}}, {"reason", "stalls"}}) +
      Line(2, "enable", {{"unit_ids", {1}}}) + Line(3, "alarms_ack", {{"ids", {4}}}) +
      Line(4, "model_load", {{"model_toml", test::ModelText(fleet_.layout(), "night")}}) +
      Line(5, "status"));
  TurnUntilQuiet();
  const std::string answers = clients_[0]->Receive();
  std::size_t refused = 0;
  for (std::size_t at = 0; (at = answers.find("65 MiB of rows wait", at)) != std::string::npos;)
    refused += ++at > 0 ? 1u : 0u;
  EXPECT_EQ(refused, 4u) << answers;
  EXPECT_THAT(answers, HasSubstr(R"("id":5,"ok":true)")) << "a question is answered";
  EXPECT_TRUE(commands_.empty());
  EXPECT_EQ(models_.compensation(), nullptr) << "nothing changed";
  EXPECT_EQ(alarms_.Count(WallTime::Now()).open, 1u) << "likewise";
  clients_[0]->Send(Line(6, "stop"));
  TurnUntilQuiet();
  EXPECT_EQ(Stops(), 1u);
  room_ = {};
  clients_[0]->Send(Line(7, "disable", {{"unit_ids", {1}}, {"reason", "stalls"}}));
  TurnUntilQuiet();
  EXPECT_EQ(commands_.size(), 2u);
}

class WaitingRequestHandlerTest : public RequestHandlerTest {
 protected:
  WaitingRequestHandlerTest() {
    Command apply;
    ApplyCommand what;
    what.targets.resize(fleet_.layout().size());
    what.targets[0] = Pose{};
    apply.what = std::move(what);
    static_cast<void>(fleet_.Step({.now = {}, .commands = std::span(&apply, 1)}));
  }
};

TEST_F(WaitingRequestHandlerTest, WaitsOfAClientAreBoundedAndAStopIsFirst) {
  ASSERT_TRUE(fleet_.View().coordinator->busy());
  std::string flood;
  for (std::uint64_t id = 1; id <= 1000; ++id) flood += Line(id, "wait");
  Add(flood);
  TurnUntilQuiet();
  handler_.ShowProgress(fleet_.View(HostInstant{Seconds(1).ns}));
  TurnUntilQuiet();
  const std::string progress = clients_[0]->Receive();
  EXPECT_EQ(static_cast<std::size_t>(std::ranges::count(progress, '\n')),
            limits::kControlRequestsOpen);
  EXPECT_THAT(progress, HasSubstr(R"({"id":8,"progress":{)"));
  EXPECT_FALSE(Waits()) << "the other lines cost nothing until one is answered";
  clients_[0]->Send(Line(1001, "stop"));
  TurnUntilQuiet();
  EXPECT_EQ(Stops(), 1u);
}

TEST_F(WaitingRequestHandlerTest, WaitsOfClientsThatAreGoneAreForgotten) {
  ASSERT_TRUE(fleet_.View().coordinator->busy());
  for (int n = 0; n < 100; ++n) {
    Add(Line(1, "wait") + Line(2, "wait"));
    TurnUntilQuiet();
    clients_.back()->Close();
    TurnUntilQuiet();
  }
  EXPECT_NE(handler_.wake_at(), kNever);
  handler_.ShowProgress(fleet_.View(HostInstant{Seconds(1).ns}));
  EXPECT_EQ(handler_.wake_at(), kNever) << "nobody waits any more";
}

TEST(RequestHandler, KnowsAStopFromEverythingElse) {
  EXPECT_TRUE(RequestHandler::IsStop(R"({"id":1,"verb":"stop"})"));
  EXPECT_TRUE(RequestHandler::IsStop(R"({"args":{"unit_id":3},"id":1,"verb":"stop"})"));
  EXPECT_TRUE(RequestHandler::IsStop(R"( { "verb" : "stop" , "id" : 7 } )"));
  EXPECT_FALSE(RequestHandler::IsStop(R"({"id":1,"verb":"status","args":{"a":"stop"}})"));
  EXPECT_FALSE(RequestHandler::IsStop(R"({"verb":"stop"})")) << "no request at all";
  EXPECT_FALSE(RequestHandler::IsStop(R"("stop")"));
  EXPECT_FALSE(RequestHandler::IsStop(""));
}

}  // namespace
}  // namespace focalfleet
