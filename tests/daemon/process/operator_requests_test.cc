// Requests of operators to the real focalfleetd: alarms over a restart, events, dry runs, waiting.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <string>
#include <utility>

#include "daemon/control/line_client.h"
#include "tests/daemon/process/focalfleetd_fixture.h"
#include "tests/support/process.h"

namespace focalfleet {
namespace {

using test::FocalfleetdTest;
using test::kPatienceMs;
using test::WaitUntil;
using ::testing::HasSubstr;

class OperatorRequests : public FocalfleetdTest {
 protected:
  /// The alarm of this name among those that `alarms` lists; null: it is not there.
  Json Listed(const std::string& name, bool all = false) {
    const auto answer = Ask("alarms", {{"all", all}});
    if (!answer) return nullptr;
    for (const Json& alarm : (*answer)["alarms"])
      if (alarm["name"] == name) return alarm;
    return nullptr;
  }
  void Restart(test::Process* daemon, int signal, const std::string& log) {
    daemon->Signal(signal);
    daemon->Wait();
    *daemon = Start(log);
  }
};

constexpr const char* kAwayBus = "[bus]\nport = \"unix\"\nunix_directory = \".\"\n";

TEST_F(OperatorRequests, AnAcknowledgedAlarmAndAMuteHoldAfterAKill) {
  Configure(kAwayBus);
  auto daemon = Start();
  const auto both_down = [&] {
    const auto alarms = Ask("alarms");
    return alarms && (*alarms)["open"] == 2;
  };
  ASSERT_TRUE(WaitUntil(both_down, kPatienceMs)) << Log();
  EXPECT_EQ(Listed("BusDown")["runbook"], "docs/runbook.md#busdown");
  const auto status = Ask("status");
  ASSERT_TRUE(status);
  EXPECT_EQ((*status)["alarms"]["open"], 2) << "of two buses";
  EXPECT_THAT((*status)["next"].get<std::string>(), HasSubstr("bus 0 is"));
  ASSERT_TRUE(Ask("alarms_ack", {{"names", {"BusDown"}}}));
  ASSERT_TRUE(Ask("alarms_mute", {{"name", "UnitSilent"}, {"for_s", 3600}, {"reason", "repair"}}));
  EXPECT_TRUE(Listed("BusDown").is_null());
  Restart(&daemon, SIGKILL, "again");
  ASSERT_TRUE(WaitUntil(
      [&] {
        const Json alarm = Listed("BusDown", true);
        return !alarm.is_null() && alarm["count"] == 2;
      },
      kPatienceMs))
      << "it is raised again, and counted: " << Log("again");
  const Json alarm = Listed("BusDown", true);
  EXPECT_EQ(alarm["state"], "acknowledged");
  EXPECT_EQ(alarm["acknowledged_by"], "uid " + std::to_string(::getuid()));
  EXPECT_TRUE(Listed("BusDown").is_null());
  const auto alarms = Ask("alarms");
  ASSERT_TRUE(alarms);
  ASSERT_EQ((*alarms)["mutes"].size(), 1u);
  EXPECT_EQ((*alarms)["mutes"][0]["reason"], "repair");
}

TEST_F(OperatorRequests, AConditionThatANewDaemonDoesNotFindIsOver) {
  Configure(kAwayBus);
  auto daemon = Start();
  ASSERT_TRUE(WaitUntil([&] { return !Listed("BusDown").is_null(); }, kPatienceMs)) << Log();
  Configure("[bus]\nport = \"simulated\"\n[clock]\nspeed = 50\n");
  Restart(&daemon, SIGTERM, "again");
  ASSERT_TRUE(WaitUntil(
      [&] {
        const Json alarm = Listed("BusDown", true);
        return !alarm.is_null() && alarm["state"] == "over";
      },
      kPatienceMs))
      << Log("again");
  EXPECT_FALSE(Listed("BusDown", true)["ended"].is_null());
}

TEST_F(OperatorRequests, AFollowerOfEventsMissesNone) {
  Configure("[bus]\nport = \"simulated\"\n[clock]\nspeed = 20\n");
  auto daemon = Start();
  ASSERT_TRUE(Ready()) << Log();
  const auto first = Ask("events");
  ASSERT_TRUE(first);
  constexpr int kChanges = 150;  // more than an answer has without `after`
  for (int n = 0; n < kChanges; ++n)
    ASSERT_TRUE(
        Ask("disable", {{"unit_ids", {2}}, {"reason", "reason " + std::to_string(n) + " of it"}}));
  // Each was answered when it was durable.
  const auto page = Ask("events", {{"after", (*first)["next"]}, {"unit_ids", {2}}});
  ASSERT_TRUE(page) << page.error().text;
  ASSERT_EQ((*page)["events"].size(), static_cast<std::size_t>(kChanges));
  for (int n = 0; n < kChanges; ++n)
    EXPECT_THAT((*page)["events"][static_cast<std::size_t>(n)]["text"].get<std::string>(),
                HasSubstr("disabled: reason " + std::to_string(n) + " of it"));
  EXPECT_EQ((*Ask("events"))["events"].size(), 100u);
}

TEST_F(OperatorRequests, ADryRunMovesAndStoresNothing) {
  Configure("[bus]\nport = \"simulated\"\n[clock]\nspeed = 20\n");
  auto daemon = Start();
  ASSERT_TRUE(Ready()) << Log();
  const Json targets = {{"targets_csv", "unit_id,theta_deg,phi_deg\n1,90,150\n2,20,150\n"}};
  ASSERT_TRUE(Ask("disable", {{"unit_ids", {2}}, {"reason", "bent"}}));
  const auto places = [&] { return (*Ask("state"))["rows"]; };
  const auto happened = [&] { return (*Ask("events"))["events"]; };
  ASSERT_TRUE(
      WaitUntil([&] { return happened().dump().find("bent") != std::string::npos; }, kPatienceMs));
  const Json places_before = places();
  const Json happened_before = happened();
  const auto preview = Ask("preview", targets);
  ASSERT_TRUE(preview) << preview.error().text;
  EXPECT_EQ(places(), places_before);
  EXPECT_EQ(happened(), happened_before);
  EXPECT_EQ((*preview)["targeted"], 2);
  EXPECT_EQ((*preview)["served"], 1);
  EXPECT_GT((*preview)["makespan_s"], 0);
  EXPECT_GT((*preview)["peak_power_W"], 0);
  ASSERT_EQ((*preview)["unserved"].size(), 1u);
  EXPECT_EQ((*preview)["unserved"][0]["reason"], "disabled: bent");
  EXPECT_EQ((*Ask("history"))["configurations"].size(), 0u);
  EXPECT_EQ((*Ask("status"))["busy"], false);
  EXPECT_FALSE(Ask("preview", {{"targets_csv", "unit_id,theta_deg,phi_deg\n1,20,999\n"}}));
  ASSERT_TRUE(Ask("apply", targets));
  const auto busy = Ask("preview", targets);
  ASSERT_FALSE(busy);
  EXPECT_EQ(busy.error().code, ErrorCode::kRefused);
  EXPECT_THAT(busy.error().text, HasSubstr("is under way"));
}

TEST_F(OperatorRequests, WaitIsAnsweredWithTheEndThatOthersCommanded) {
  Configure("[bus]\nport = \"simulated\"\n[clock]\nspeed = 20\n");
  auto daemon = Start();
  ASSERT_TRUE(Ready()) << Log();
  const auto nothing = Ask("wait");
  ASSERT_TRUE(nothing);
  EXPECT_EQ((*nothing)["under_way"], false);
  ASSERT_TRUE(Ask("apply", {{"targets_csv", "unit_id,theta_deg,phi_deg\n1,180,150\n"}}));
  const auto late = Ask("wait", {{"timeout_s", 0}});
  ASSERT_FALSE(late);
  EXPECT_THAT(late.error().text, HasSubstr("configuration 1 is still under way"));
  auto client = LineClient::Connect(scratch_ / "control.sock");
  ASSERT_TRUE(client);
  const auto done = client->Call("wait", Json::object(), {.silence_max = Seconds(60)});
  ASSERT_TRUE(done) << done.error().text;
  EXPECT_EQ((*done)["state"], "done");
  EXPECT_EQ((*done)["arrived"], 1);
  // The row of its end is durable a little later.
  std::string texts;
  const auto reported = [&] {
    texts.clear();
    const auto events = Ask("events");
    if (!events) return false;
    for (const Json& event : (*events)["events"]) texts += event["text"].get<std::string>() + "\n";
    return texts.find("configuration 1 (targets) is done: 1 of 1 arrived\n") != std::string::npos;
  };
  EXPECT_TRUE(WaitUntil(reported, kPatienceMs)) << texts;
  EXPECT_THAT(texts, HasSubstr("configuration 1 (targets) begins: 1 targeted\n"));
  EXPECT_LT(texts.find("begins"), texts.find("is done"));
  const auto none = Ask("events", {{"unit_ids", {1}}, {"severity", "error"}});
  ASSERT_TRUE(none);
  EXPECT_EQ((*none)["events"].size(), 0u);
}

}  // namespace
}  // namespace focalfleet
