// The commands about alarms, events and the configuration under way, and what several commands have
// in common: units by range, bus and state, and the question before what cannot be taken back.
#include <gmock/gmock.h>

#include "tests/daemon/cli/daemon_commands.h"

namespace focalfleet {
namespace {

using test::ConfigurationAnswer;
using test::DaemonCommands;
using test::kTargets;
using test::StatusAnswer;
using ::testing::HasSubstr;
using ::testing::Not;

Json Alarm(std::uint64_t id, const std::string& name, const Json& unit, bool muted = false) {
  return {{"id", id},
          {"name", name},
          {"severity", "error"},
          {"state", "open"},
          {"muted", muted},
          {"unit_id", unit},
          {"bus_id", nullptr},
          {"text", "text of " + std::to_string(id)},
          {"count", 2},
          {"last", "2026-11-26T20:00:00.000Z"},
          {"runbook", "docs/runbook.md#x"}};
}

TEST_F(DaemonCommands, AlarmsOfOneNameAreOneLineWithTheirUnits) {
  const Json answer{
      {"open", 4},
      {"muted", 1},
      {"alarms",
       {Alarm(1, "UnitSilent", 7), Alarm(2, "UnitSilent", 9), Alarm(3, "UnitSilent", 8),
        Alarm(4, "StoreFull", nullptr), Alarm(5, "UnitFault", 3, true)}},
      {"mutes",
       {{{"name", "UnitFault"},
         {"until", "2026-11-26T21:00:00.000Z"},
         {"reason", "repair"},
         {"by", "uid 4294967294"},
         {"open", 3},
         {"open_since", 2}}}}};
  const auto text = Ask({"alarms"}, {{"alarms", {.result = answer}}});
  EXPECT_EQ(text.exit, 0) << text.err;
  EXPECT_THAT(text.out, HasSubstr("3 units (7-9), the newest: text of 3"));
  EXPECT_THAT(text.out, HasSubstr("UnitSilent  open, 6 times"));
  EXPECT_THAT(text.out, HasSubstr("text of 4 (alarm 4)"));
  EXPECT_THAT(text.out, HasSubstr("docs/runbook.md#x"));
  EXPECT_THAT(text.out, Not(HasSubstr("text of 5")));
  EXPECT_THAT(text.out, HasSubstr("muted  UnitFault until 2026-11-26T21:00:00.000Z by uid "
                                  "4294967294: repair (3 open, 2 since)"));
  EXPECT_EQ(requests_.at(0).args, (Json{{"all", false}}));
  EXPECT_THAT(Ask({"alarms", "--all"}, {{"alarms", {.result = answer}}}).out,
              HasSubstr("text of 5"));
  EXPECT_THAT(Ask({"alarms"}, {{"alarms", {}}}).out, HasSubstr("no open alarms"));
}

TEST_F(DaemonCommands, TheWorstUnitsOfAnExposureComeFirst) {
  const auto row = [](int unit, const Json& x_mm, const Json& error_um, const Json& target_x_mm,
                      const char* status, bool moved_since = false) {
    return Json{{"unit_id", unit},
                {"status", status},
                {"moved_since", moved_since},
                {"x_mm", x_mm},
                {"y_mm", 2},
                {"error_um", error_um},
                {"target_x_mm", target_x_mm},
                {"target_y_mm", 2}};
  };
  const Json answer{{"exposure", 4},
                    {"measurements",
                     {row(1, 1.002, 2, 1, "ok"), row(2, 0.95, 50, 1, "ok"),
                      row(3, nullptr, nullptr, 1, "missing"), row(4, 1.5, nullptr, nullptr, "ok"),
                      row(5, 1.9, 900, 1, "ok", true), row(6, 1.01, 10, 1, "ok")}}};
  const auto text = Ask({"measurements", "--worst", "4"}, {{"measurements", {.result = answer}}});
  EXPECT_EQ(text.exit, 0) << text.err;
  EXPECT_EQ(text.out,
            "unit  error    from target     status\n"
            "3     unknown                  missing\n"
            "5     unknown                  moved_since\n"
            "2     50.0 um  -50.0, +0.0 um  ok\n"
            "6     10.0 um  +10.0, +0.0 um  ok\n");
  const auto json =
      Ask({"measurements", "--worst", "1", "--json"}, {{"measurements", {.result = answer}}});
  ASSERT_EQ(json.exit, 0) << json.err;
  const Json kept = Json::parse(json.out)["measurements"];
  ASSERT_EQ(kept.size(), 1u);
  EXPECT_EQ(kept[0]["unit_id"], 3);
}

TEST_F(DaemonCommands, AlarmsAreAcknowledgedByIdAndName) {
  const auto done = Ask({"alarms", "ack", "4711", "UnitNeverBegan"},
                        {{"alarms_ack", {.result = Json{{"text", "acknowledged 3"}}}}});
  EXPECT_EQ(done.exit, 0) << done.err;
  EXPECT_THAT(done.out, HasSubstr("acknowledged 3"));
  EXPECT_EQ(requests_.at(0).args, (Json{{"ids", {4711}}, {"names", {"UnitNeverBegan"}}}));
  EXPECT_EQ(Ask({"alarms", "ack"}, {}).exit, 2);
}

TEST_F(DaemonCommands, AMuteWantsAnEndAndAReason) {
  EXPECT_EQ(Ask({"alarms", "mute", "BusDown", "--reason", "repair"}, {}).exit, 2);
  EXPECT_EQ(Ask({"alarms", "mute", "BusDown", "--for", "2h"}, {}).exit, 2);
  EXPECT_EQ(Ask({"alarms", "mute", "BusDown", "--for", "soon", "--reason", "x"}, {}).exit, 1);
  EXPECT_EQ(
      Ask({"alarms", "mute", "BusDown", "--for", "2h", "--reason", "repair"}, {{"alarms_mute", {}}})
          .exit,
      0);
  EXPECT_EQ(requests_.at(0).args,
            (Json{{"name", "BusDown"}, {"for_s", 7200.0}, {"reason", "repair"}}));
  EXPECT_EQ(Ask({"alarms", "unmute", "BusDown"}, {{"alarms_unmute", {}}}).exit, 0);
}

TEST_F(DaemonCommands, StatusCountsOpenAlarmsAndNamesTheNextStep) {
  Json status = StatusAnswer();
  EXPECT_THAT(Ask({"status"}, {{"status", {.result = status}}}).out, Not(HasSubstr("alarms")));
  status["alarms"] = {{"open", 3}, {"muted", 1}, {"worst", "error"}};
  status["next"] = "focalfleet home 7,9 --wait";
  const auto text = Ask({"status"}, {{"status", {.result = status}}});
  EXPECT_THAT(text.out, HasSubstr("alarms     3 open, 1 muted (`focalfleet alarms`)"));
  EXPECT_THAT(text.out, ::testing::EndsWith("\nnext: focalfleet home 7,9 --wait\n"));
}

TEST_F(DaemonCommands, PageShowsItsAddressWhereThereIsOne) {
  Json status = StatusAnswer();
  status["page"] = "http://127.0.0.1:8080/";
  EXPECT_EQ(Ask({"page"}, {{"status", {.result = status}}}).out, "http://127.0.0.1:8080/\n");
  status["page"] = nullptr;
  const auto none = Ask({"page"}, {{"status", {.result = status}}});
  EXPECT_EQ(none.exit, 1);
  EXPECT_THAT(none.err, HasSubstr("give [http] a port"));
}

TEST_F(DaemonCommands, EventsAskForAPeriodUnitsAndASeverity) {
  const Json event{{"at", "2026-11-26T20:00:00.000Z"},
                   {"severity", "warning"},
                   {"name", "UnitNeverBegan"},
                   {"text", "unit 7 did not begin to move"}};
  const auto text = Ask({"events", "--since", "2026-11-26T19:00Z", "--until", "2026-11-27",
                         "--unit", "7,20-22", "--severity", "warning", "--limit", "5"},
                        {{"events", {.result = Json{{"events", {event}}}}}});
  EXPECT_EQ(text.exit, 0) << text.err;
  EXPECT_THAT(text.out, HasSubstr("UnitNeverBegan: unit 7 did not begin to move"));
  EXPECT_EQ(requests_.at(0).args, (Json{{"since_ns", 1795719600000000000},
                                        {"until_ns", 1795737600000000000},
                                        {"unit_ids", {7, 20, 21, 22}},
                                        {"severity", "warning"},
                                        {"limit", 5}}));
  EXPECT_EQ(Ask({"events", "--since", "yesterday"}, {}).exit, 1);
  EXPECT_EQ(Ask({"events", "-f", "--until", "1h"}, {}).exit, 2);
}

TEST_F(DaemonCommands, FollowedEventsGoOnAfterTheNumbersOfTheLastPage) {
  const Json next{{"alarm", 7}, {"unit", 1}, {"begun", 2}, {"ended", 2}};
  const Json event{{"at_ns", 41}, {"severity", "info"}, {"text", "once"}};
  // With `more` the next page is asked for at once.
  const Json answer{{"events", {event}}, {"next", next}, {"more", true}};
  const auto text = Ask({"events", "-f", "--since", "1h", "--severity", "info"},
                        {{"events", {.result = answer, .answers_most = 3}}});
  EXPECT_EQ(text.exit, 4) << "the daemon is gone";
  ASSERT_GE(requests_.size(), 3u);
  EXPECT_FALSE(requests_[0].args.contains("after"));
  for (const std::size_t page : {1u, 2u})
    EXPECT_EQ(requests_[page].args, (Json{{"after", next}, {"severity", "info"}}));
  const auto older = Ask({"events", "-f"}, {{"events", {.result = Json{{"events", {event}}}}}});
  EXPECT_EQ(older.exit, 1);
  EXPECT_THAT(older.err, HasSubstr("of another version"));
}

TEST_F(DaemonCommands, WaitEndsAsTheConfigurationDid) {
  const auto exit = [&](const Json& answer) {
    return Ask({"wait"}, {{"wait", {.result = answer}}, {"status", {.result = StatusAnswer()}}})
        .exit;
  };
  EXPECT_EQ(exit(ConfigurationAnswer("done", 2, 0)), 0);
  EXPECT_EQ(exit(ConfigurationAnswer("done", 1, 1)), 3);
  EXPECT_EQ(exit(ConfigurationAnswer("stopped", 1, 0)), 5);
  const auto nothing = Ask({"wait"}, {{"wait", {.result = Json{{"under_way", false}}}}});
  EXPECT_EQ(nothing.exit, 0);
  EXPECT_THAT(nothing.out, HasSubstr("nothing is under way"));
  EXPECT_EQ(Ask({"wait"}, {{"wait", {.hang_up = true}}}).exit, 4);
  const Error ends{ErrorCode::kUnavailable, "the daemon ends"};
  EXPECT_EQ(Ask({"wait"}, {{"wait", {.result = tl::unexpected<Error>(ends)}}}).exit, 4);
  const Error late{ErrorCode::kRefused, "configuration 7 is still under way"};
  EXPECT_EQ(
      Ask({"wait", "--timeout", "2.5"}, {{"wait", {.result = tl::unexpected<Error>(late)}}}).exit,
      1);
  EXPECT_EQ(requests_.at(0).args, (Json{{"timeout_s", 2.5}}));
}

TEST_F(DaemonCommands, ADryRunReportsWhoIsServedAndApplyIsNotSent) {
  Json answer{{"dry_run", true},
              {"targeted", 2},
              {"served", 1},
              {"moving", 1},
              {"makespan_s", 12},
              {"energy_J", 3.5},
              {"peak_power_W", 2},
              {"unserved", {{{"unit_id", 2}, {"outcome", "refused"}, {"reason", "disabled: x"}}}}};
  const std::string file = scratch_.Put("t.csv", kTargets);
  const auto some = Ask({"apply", file, "--dry-run"}, {{"preview", {.result = answer}}});
  EXPECT_EQ(some.exit, 3) << some.err;
  EXPECT_THAT(some.out, HasSubstr("dry run, nothing moves: 1 of 2 units served"));
  EXPECT_THAT(some.out, HasSubstr("makespan 12.0 s, energy 3.5 J, peak power 2.0 W"));
  EXPECT_THAT(some.out, HasSubstr("unit 2: refused: disabled: x"));
  ASSERT_EQ(requests_.size(), 1u);
  EXPECT_EQ(requests_[0].args["targets_csv"], kTargets);
  answer["served"] = 2;
  answer["unserved"] = Json::array();
  EXPECT_EQ(Ask({"apply", file, "--dry-run"}, {{"preview", {.result = answer}}}).exit, 0);
  const Error busy{ErrorCode::kRefused, "configuration 7 is under way"};
  EXPECT_EQ(
      Ask({"apply", file, "--dry-run"}, {{"preview", {.result = tl::unexpected<Error>(busy)}}})
          .exit,
      1);
  EXPECT_EQ(Ask({"apply", file, "--dry-run", "--wait"}, {}).exit, 2);
}

TEST_F(DaemonCommands, UnitsAreNamedByRangeBusAndState) {
  EXPECT_EQ(Ask({"home", "7,20-22", "9"}, {{"home", {}}}).exit, 0);
  EXPECT_EQ(requests_.at(0).args["unit_ids"], (Json{7, 20, 21, 22, 9}));
  EXPECT_EQ(Ask({"enable", "--bus", "3,5", "--state", "fault", "--within-s", "0"},
                {{"select", {.result = Json{{"unit_ids", {4, 6}}}}},
                 {"enable", {}},
                 {"unit", {.result = Json{{"phase", "ready"}}}}})
                .exit,
            0);
  ASSERT_GE(requests_.size(), 2u);
  EXPECT_EQ(requests_[0].args, (Json{{"bus_ids", {3, 5}}, {"states", {"fault"}}}));
  EXPECT_EQ(requests_[1].args, (Json{{"unit_ids", {4, 6}}}));
  const auto units =
      Ask({"unit", "7-8", "--json"}, {{"unit", {.result = Json{{"phase", "ready"}}}}});
  EXPECT_EQ(Json::parse(units.out, nullptr, false)["units"].size(), 2u);
  for (const char* bad : {"7-", "a", "9-7", "7,,8"})
    EXPECT_EQ(Ask({"home", bad}, {{"home", {}}}).exit, 2) << bad;
  EXPECT_EQ(Ask({"disable", "--reason", "x"}, {{"disable", {}}}).exit, 2) << "no unit";
}

TEST_F(DaemonCommands, WhatCannotBeTakenBackIsAskedAtATerminalAlone) {
  const std::string model = scratch_.Put("m.toml", "x");
  const std::map<std::string, test::FakeAnswer> answers = {{"home", {}},    {"adopt", {}},
                                                           {"disable", {}}, {"params_set", {}},
                                                           {"model", {}},   {"model_load", {}}};
  for (std::vector<std::string> words :
       std::vector<std::vector<std::string>>{{"home", "7", "--unproven"},
                                             {"adopt", "7"},
                                             {"disable", "1-11", "--reason", "x"},
                                             {"params", "1-11", "set", "theta", "repeat", "54"},
                                             {"model", "load", model}}) {
    const auto refused = AskAtTerminal("n", words, answers);
    EXPECT_EQ(refused.exit, 1) << words[0] << refused.out;
    EXPECT_THAT(refused.out, HasSubstr("Go on? [y/N]")) << words[0];
    EXPECT_THAT(refused.out, HasSubstr("nothing was done")) << words[0];
    EXPECT_TRUE(requests_.empty()) << words[0];
    EXPECT_EQ(AskAtTerminal("y", words, answers).exit, 0) << words[0];
    EXPECT_FALSE(requests_.empty()) << words[0];
    const auto script = Ask(words, answers);
    EXPECT_EQ(script.exit, 0) << words[0] << script.err;
    EXPECT_THAT(script.err, Not(HasSubstr("Go on?"))) << words[0];
    words.emplace_back("--yes");
    EXPECT_THAT(AskAtTerminal("n", words, answers).out, Not(HasSubstr("Go on?"))) << words[0];
    EXPECT_FALSE(requests_.empty()) << words[0];
  }
  const auto few = AskAtTerminal("n", {"disable", "1-10", "--reason", "x"}, answers);
  EXPECT_EQ(few.exit, 0) << few.out;
  EXPECT_EQ(AskAtTerminal("n", {"params", "1-10", "set", "theta", "repeat", "54"}, answers).exit,
            0);
  EXPECT_EQ(Ask({"params", "1-11"}, {{"params", {}}}).exit, 0) << "nothing is set";
}

/// A daemon that refuses units 7 and 9 alone.
test::FakeAnswer RefusesSome(const Json& otherwise) {
  return {.result = otherwise, .refused_units = {7, 9}};
}

TEST_F(DaemonCommands, ARefusalOfOneUnitDoesNotKeepTheOthersOut) {
  const Json done{{"text", "done"}, {"goes", true}};
  const struct {
    std::vector<std::string> words;
    std::string verb;
  } commands[] = {{{"adopt", "7-10", "--yes"}, "adopt"},
                  {{"params", "7-10", "set", "theta", "repeat", "54"}, "params_set"},
                  {{"params", "7-10"}, "params"},
                  {{"unit", "7-10"}, "unit"},
                  {{"history", "7-10"}, "history"},
                  {{"retarget", "7-10", "35", "120", "--angles"}, "retarget"}};
  for (const auto& [words, verb] : commands) {
    const auto some = Ask(words, {{verb, RefusesSome(done)}});
    EXPECT_EQ(some.exit, 3) << verb;
    ASSERT_EQ(requests_.size(), 4u) << verb;
    EXPECT_EQ(requests_[3].args["unit_id"], 10) << verb;
    EXPECT_THAT(some.err, HasSubstr("unit 7: not now")) << verb;
    EXPECT_THAT(some.err, HasSubstr("unit 9: not now")) << verb;
    EXPECT_THAT(some.err, HasSubstr("2 of 4 units refused")) << verb;
    auto with_json = words;
    with_json.emplace_back("--json");
    const Json answer =
        Json::parse(Ask(with_json, {{verb, RefusesSome(done)}}).out, nullptr, false);
    EXPECT_EQ(answer["units"].size(), 2u) << verb;
    EXPECT_EQ(answer["units"][1]["unit_id"], 10) << verb;
    EXPECT_EQ(answer["refused"][1],
              (Json{{"unit_id", 9}, {"code", "refused"}, {"text", "not now"}}))
        << verb;
  }
  const auto none = Ask({"adopt", "7,9", "--yes"}, {{"adopt", RefusesSome(done)}});
  EXPECT_EQ(none.exit, 1) << "nothing changed";
  EXPECT_EQ(requests_.size(), 2u);
  const auto one = Ask({"adopt", "7", "--yes"}, {{"adopt", RefusesSome(done)}});
  EXPECT_EQ(one.exit, 1);
  EXPECT_THAT(one.err, HasSubstr("error: not now"));
  const auto gone = Ask({"adopt", "7-10", "--yes"}, {{"adopt", {.hang_up = true}}});
  EXPECT_EQ(gone.exit, 5) << "whether unit 7 was adopted is not known";
  EXPECT_EQ(requests_.size(), 1u) << "the others are not tried without a daemon";
  EXPECT_EQ(Ask({"retarget", "7-10", "1", "2"}, {}).exit, 2) << "a place belongs to one unit";
}

}  // namespace
}  // namespace focalfleet
