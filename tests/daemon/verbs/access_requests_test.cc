// The request handler asks the table of rights, and keeps who commanded what.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <memory>
#include <string>
#include <vector>

#include "daemon/verbs/request_handler.h"
#include "tests/daemon/control/raw_client.h"
#include "tests/daemon/verbs/small_fleet.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using test::RawClient;
using test::ScratchFolder;
using test::SmallFleet;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;

constexpr WallTime kNow{1'700'000'000'000'000'000};

std::string Line(const std::string& verb, const Json& args = Json::object()) {
  return EncodeRequest({.id = 1, .verb = verb, .args = args}) + "\n";
}

class AccessRequests : public ::testing::Test {
 protected:
  AccessRequests()
      : handler_(std::make_unique<LineServer>(
                     LineServer::Create(scratch_ / "s",
                                        {.urgent = &RequestHandler::IsStop,
                                         .role_of = [this](const auto&) { return role_; },
                                         .turned_away =
                                             [this](const Caller& caller) {
                                               turned_away_ += Describe(caller) + "\n";
                                             }})
                         .value()),
                 {.facts = [] { return ShellFacts{}; },
                  .log = [this](const std::string& text) { log_ += text + "\n"; },
                  .store_path = scratch_ / "none.db",
                  .models = &models_,
                  .alarms = &alarms_,
                  .audit = &audit_,
                  .own_pid = static_cast<std::uint32_t>(::getpid())}) {}

  /// The answer to what a newcomer of this role says.
  std::string Ask(Role role, const std::string& says) {
    role_ = role;
    RawClient client(scratch_ / "s");
    client.Send(says);
    Turns();
    return client.Receive();
  }
  void Turns() {
    pollfd poller{handler_.fd(), POLLIN, 0};
    for (int n = 0; n < 1000 && ::poll(&poller, 1, 0) == 1; ++n)
      handler_.Service(fleet_.View(), &commands_);
  }
  std::vector<AuditRow> Audit(std::vector<ReplyEffect> replies = {}, WallTime now = kNow) {
    std::vector<Row> rows;
    audit_.Take(replies, {.configuration = 12, .now = now}, &rows);
    std::vector<AuditRow> entries;
    for (const Row& row : rows) entries.push_back(std::get<AuditRow>(row));
    return entries;
  }

  const ScratchFolder scratch_;
  SmallFleet fleet_{3};
  Role role_ = Role::kEngineer;
  std::string log_;
  std::string turned_away_;
  ModelRegistry models_{&fleet_.layout()};
  AlarmRegister alarms_;
  AuditTrail audit_{"boot"};
  RequestHandler handler_;
  std::vector<Command> commands_;
};

TEST_F(AccessRequests, AViewerAsksAndStopsAndDoesNothingElse) {
  EXPECT_THAT(Ask(Role::kViewer, Line("status")), HasSubstr(R"("ok":true)"));
  for (const char* verb : {"home", "adopt", "params_set", "disable", "alarms_ack", "model_unload"})
    EXPECT_THAT(Ask(Role::kViewer, Line(verb)),
                AllOf(HasSubstr("may not " + std::string(verb)), HasSubstr(R"("refused")")));
  EXPECT_THAT(commands_, IsEmpty());
  static_cast<void>(Ask(Role::kViewer, Line("stop")));
  EXPECT_THAT(commands_, SizeIs(1));
}

TEST_F(AccessRequests, NobodyGetsAPlaceWithoutARole) {
  EXPECT_THAT(Ask(Role::kNone, Line("stop")),
              AllOf(HasSubstr("has no role here"), HasSubstr(R"("refused")")));
  EXPECT_THAT(turned_away_, HasSubstr("uid " + std::to_string(::geteuid())));
  EXPECT_THAT(commands_, IsEmpty());
}

TEST_F(AccessRequests, ACallerLearnsItsRole) {
  EXPECT_THAT(
      Ask(Role::kOperator, Line("access")),
      AllOf(HasSubstr(R"("role":"operator")"), HasSubstr("uid " + std::to_string(::geteuid()))));
}

TEST_F(AccessRequests, ARefusalIsNamedLoggedAndKept) {
  static_cast<void>(Ask(Role::kViewer, Line("adopt", {{"unit_id", 1}})));
  EXPECT_THAT(log_, HasSubstr("adopt refused: uid "));
  const auto kept = Audit();
  ASSERT_THAT(kept, SizeIs(1));
  EXPECT_EQ(kept[0].verb, "adopt");
  EXPECT_EQ(kept[0].role, "viewer");
  EXPECT_EQ(kept[0].code, "refused");
  EXPECT_FALSE(kept[0].taken);
  EXPECT_EQ(kept[0].process->uid, ::geteuid());
  EXPECT_EQ(kept[0].boot_id, "boot");
  EXPECT_THAT(kept[0].request, HasSubstr(R"("unit_id":1)"));
}

TEST_F(AccessRequests, QuestionsAreNotKept) {
  static_cast<void>(Ask(Role::kViewer, Line("status") + Line("state") + Line("access")));
  EXPECT_FALSE(audit_.waiting());
}

TEST_F(AccessRequests, ACommandIsKeptWithItsOutcome) {
  static_cast<void>(Ask(Role::kOperator, Line("disable", {{"unit_ids", {1}}, {"reason", "x"}})));
  ASSERT_THAT(commands_, SizeIs(1));
  const auto kept = Audit();
  ASSERT_THAT(kept, SizeIs(1));
  EXPECT_TRUE(kept[0].taken);
  EXPECT_EQ(kept[0].configuration, 0u) << "it moves nothing";
  static_cast<void>(Ask(Role::kOperator, Line("stop")));
  EXPECT_EQ(Audit().at(0).configuration, 12u);
  static_cast<void>(Ask(Role::kOperator, Line("measure")));
  ASSERT_THAT(commands_, SizeIs(3));
  const auto refused =
      Audit({{.request = commands_[2].request, .error = Error{ErrorCode::kRefused, "busy"}}});
  ASSERT_THAT(refused, SizeIs(1));
  EXPECT_FALSE(refused[0].taken);
  EXPECT_EQ(refused[0].reason, "busy");
}

TEST_F(AccessRequests, NoCallerFillsTheDisk) {
  std::string flood;
  constexpr int kLines = 300;
  for (int n = 0; n < kLines; ++n) flood += Line("adopt", {{"unit_id", 1}});
  static_cast<void>(Ask(Role::kViewer, flood));
  EXPECT_THAT(Audit(), SizeIs(AuditTrail::kRepeatsKept));
  static_cast<void>(Ask(Role::kViewer, Line("adopt")));
  const auto later = Audit({}, WallTime{kNow.ns + 61'000'000'000});
  ASSERT_THAT(later, SizeIs(1));
  EXPECT_THAT(later[0].reason, HasSubstr("240 entries before it were left out"));
  EXPECT_LT(std::count(log_.begin(), log_.end(), '\n'), 20);
}

TEST_F(AccessRequests, ARefusalThatIsNotKeptCostsNoHash) {
  static_cast<void>(Ask(Role::kViewer, Line("adopt")));
  static_cast<void>(Audit({}, WallTime{}));
  std::string flood;
  for (std::uint32_t n = 1; n < AuditTrail::kRepeatsKept; ++n) flood += Line("adopt");
  static_cast<void>(Ask(Role::kViewer, flood));
  EXPECT_THAT(Audit({}, WallTime{}), SizeIs(AuditTrail::kRepeatsKept - 1));
  static_cast<void>(Ask(Role::kViewer, Line("adopt")));
  EXPECT_FALSE(audit_.waiting()) << "it is counted, and no entry was made";
}

TEST_F(AccessRequests, WhereTheDiskIsFullRefusalsAndStopsAreCountedAlone) {
  static_cast<void>(Ask(Role::kViewer, Line("adopt") + Line("stop")));
  std::vector<Row> rows;
  audit_.Take({}, {.now = {}, .full = true}, &rows);
  static_cast<void>(Ask(Role::kViewer, Line("adopt")));
  EXPECT_FALSE(audit_.waiting());
  EXPECT_THAT(rows, IsEmpty());
  static_cast<void>(Ask(Role::kViewer, Line("stop")));
  const auto kept = Audit({}, WallTime{});
  ASSERT_THAT(kept, SizeIs(1));
  EXPECT_THAT(kept[0].reason, HasSubstr("3 entries before it were left out"));
}

TEST_F(AccessRequests, LongRequestsAreKeptByTheirFrontAndTheirHash) {
  const std::string csv = std::string(4096, 'x') + "\xc3\xa4";
  static_cast<void>(Ask(Role::kOperator, Line("apply", {{"targets_csv", csv}})));
  const auto kept = Audit();
  ASSERT_THAT(kept, SizeIs(1));
  EXPECT_LE(kept[0].request.size(), AuditRow::kRequestBytesMax);
  EXPECT_GT(kept[0].request_bytes, csv.size());
  EXPECT_THAT(kept[0].request_sha256, SizeIs(64));
}

TEST_F(AccessRequests, ARecordedCommandCountsAsThatOfWhoSendsItAgain) {
  const std::string recorded = Line("disable", {{"unit_ids", {1}}, {"reason", "x"}});
  static_cast<void>(Ask(Role::kOperator, recorded));
  ASSERT_THAT(commands_, SizeIs(1));
  EXPECT_THAT(Ask(Role::kViewer, recorded), HasSubstr("may not disable"));
  EXPECT_THAT(Ask(Role::kNone, recorded), HasSubstr("has no role here"));
  EXPECT_THAT(commands_, SizeIs(1));
  static_cast<void>(Ask(Role::kOperator, recorded));
  EXPECT_THAT(commands_, SizeIs(2)) << "whoever may command may do so twice, and is named twice";
  EXPECT_THAT(Audit(), SizeIs(3));
}

TEST_F(AccessRequests, TheDaemonItselfAsksOnBehalfOfATokensBearer) {
  const ControlRequest viewer{
      .id = 1,
      .verb = "adopt",
      .args = {{"unit_id", 1}},
      .caller = Caller{.role = Role::kViewer, .door = Door::kHttp, .token = "page"}};
  EXPECT_THAT(Ask(Role::kEngineer, EncodeRequest(viewer) + "\n"),
              HasSubstr("token page (viewer) may not adopt"));
  const auto kept = Audit();
  ASSERT_THAT(kept, SizeIs(1));
  EXPECT_EQ(kept[0].door, "http");
  EXPECT_EQ(kept[0].name, "token page");
  EXPECT_FALSE(kept[0].process);
}

TEST_F(AccessRequests, NobodyElseAsksOnBehalfOfOthers) {
  const std::string says =
      EncodeRequest(
          {.id = 1,
           .verb = "adopt",
           .args = {{"unit_id", 1}},
           .caller = Caller{.role = Role::kEngineer, .door = Door::kHttp, .token = "x"}}) +
      "\n";
  const pid_t other = ::fork();
  ASSERT_GE(other, 0);
  if (other == 0) {
    const RawClient client(scratch_ / "s");
    client.Send(says);
    client.EndInput();
    ::_exit(0);  // its request is still heard
  }
  int ended = 0;
  ASSERT_EQ(::waitpid(other, &ended, 0), other);
  Turns();
  EXPECT_THAT(commands_, IsEmpty());
  const auto kept = Audit();
  ASSERT_THAT(kept, SizeIs(1));
  EXPECT_THAT(kept[0].reason, HasSubstr("on behalf of others"));
  EXPECT_EQ(kept[0].process->pid, static_cast<std::uint32_t>(other));
}

}  // namespace
}  // namespace focalfleet
