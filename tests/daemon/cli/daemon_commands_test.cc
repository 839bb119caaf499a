// The commands that speak to the daemon, but for apply (apply_command_test.cc) and stop
// (stop_command_test.cc).
#include "tests/daemon/cli/daemon_commands.h"

#include <gmock/gmock.h>

namespace focalfleet {
namespace {

using test::ConfigurationAnswer;
using test::DaemonCommands;
using test::FakeAnswer;
using test::FakeDaemon;
using test::Focalfleet;
using test::kTargets;
using test::Slurp;
using test::StatusAnswer;
using ::testing::HasSubstr;
using ::testing::Not;

TEST_F(DaemonCommands, NothingThatADaemonSaysMovesTheCursorOrForgesALine) {
  const std::string evil =
      "x\n\x1b[2Jforged\xc2\x9b"
      "31m";
  Json status = StatusAnswer();
  status["version"] = status["store"]["path"] = status["configuration"]["source"] = evil;
  status["dds"] = {{"trouble", evil}};
  status["buses"][1]["trouble"] = evil;
  const Json history = {{"configurations", {{{"id", 1}, {"source", evil}}}},
                        {"alarms", {{{"id", 2}, {"text", evil}}}}};
  const Json model = {{"in_force", {{"name", evil}, {"left_out", {evil}}}}};
  Json failed = ConfigurationAnswer("done", 1, 1);
  failed["source"] = failed["unserved"][0]["reason"] = evil;
  const std::map<std::string, FakeAnswer> answers = {
      {"status", {.result = status}},
      {"history", {.result = history}},
      {"unit", {.result = Json{{"disabled_reason", evil}}}},
      {"model", {.result = model}},
      {"apply", {.result = failed}},
      {"stop", {.result = Json{{"text", evil}}}},
      {"enable", {.result = tl::unexpected<Error>(Error{ErrorCode::kRefused, evil})}}};
  const std::string file = scratch_.Put("t.csv", kTargets);
  for (const std::vector<std::string>& words :
       std::vector<std::vector<std::string>>{{"status"},
                                             {"status", "--buses"},
                                             {"history"},
                                             {"unit", "1"},
                                             {"model", "show"},
                                             {"apply", file, "--wait"},
                                             {"stop"},
                                             {"enable", "1"},
                                             {"status", "--json"},
                                             {"enable", "1", "--json"}}) {
    const auto result = Ask(words, answers);
    const std::string said = result.out + result.err;
    EXPECT_THAT(said, Not(HasSubstr("\x1b"))) << words[0];
    EXPECT_THAT(said, Not(HasSubstr("\xc2\x9b"))) << words[0];
    // The text of an error may contain line breaks of its own.
    EXPECT_TRUE(words[0] == "enable" || said.find("x\n") == std::string::npos) << said;
    EXPECT_TRUE(words[0] == "stop" || said.find("forged") != std::string::npos) << said;
  }
  auto json = Json::parse(Ask({"status", "--json"}, answers).out, nullptr, false);
  for (const char* of_the_program : {"schema", "client_version"}) json.erase(of_the_program);
  EXPECT_EQ(json, status) << "what programs read is what was said";
}

TEST_F(DaemonCommands, NothingThatAFileHoldsMovesTheCursor) {
  const std::string targets = scratch_.Put("t.csv", "unit_id,x_mm,y_mm,a\u202eb\n1,0.5,0.25,3\n");
  const auto apply = Ask({"apply", targets}, {{"apply", {.result = Json{{"id", 7}}}}});
  EXPECT_THAT(apply.err, HasSubstr("columns passed over: a\\u202eb"));
  const std::string frames = scratch_.Put("c.log", "(1.0) can\u202e 00000001#00\n");
  const auto decoded = Focalfleet({"can", "decode", frames});
  EXPECT_THAT(apply.err + decoded.out + decoded.err, Not(HasSubstr("\u202e")));
  EXPECT_THAT(decoded.out + decoded.err, HasSubstr("can\\u202e"));
}

TEST_F(DaemonCommands, StatusSaysThatDdsIsMissing) {
  Json status = StatusAnswer();
  status["dds"] = {{"enabled", true}, {"trouble", "status: DDS: cannot set up the domain"}};
  EXPECT_THAT(Ask({"status"}, {{"status", {.result = status}}}).out,
              HasSubstr("dds        MISSING status: DDS: cannot set up the domain"));
}

TEST_F(DaemonCommands, HomeWaitEndsAsItsUnitsDid) {
  const auto good =
      Ask({"home", "1", "2", "--wait"}, {{"home", {.result = ConfigurationAnswer("done", 2, 0)}}});
  EXPECT_EQ(good.exit, 0);
  const auto bad =
      Ask({"home", "1", "2", "--wait"}, {{"home", {.result = ConfigurationAnswer("done", 1, 1)}}});
  EXPECT_EQ(bad.exit, 3);
  EXPECT_THAT(bad.out, HasSubstr("unit 2: failed: no answer"));
}

TEST_F(DaemonCommands, ParamsShowWhatWasSetAndWhatHoldsByDefault) {
  const Json answer{
      {"drive", {{"theta_repeat", 54}, {"phi_repeat", 108}, {"mode", "asymmetric"}}},
      {"parameters",
       {{{"axis", "theta"}, {"parameter", "repeat"}, {"value", 54}, {"origin", "operator"}}}}};
  const auto text = Ask({"params", "9"}, {{"params", {.result = answer}}});
  EXPECT_THAT(text.out, HasSubstr("theta  repeat     54     operator"));
  EXPECT_THAT(text.out, HasSubstr("phi    repeat     108    default"));
  const auto json =
      Ask({"params", "9", "get", "phi", "repeat", "--json"}, {{"params", {.result = answer}}});
  EXPECT_EQ(Json::parse(json.out, nullptr, false)["parameters"],
            Json::parse(R"([{"axis":"phi","parameter":"repeat","value":108,"origin":"default"}])"));
}

TEST_F(DaemonCommands, ParamsShowWhatTheLastTuningFound) {
  const Json answer{{"drive", {{"theta_repeat", 54}}},
                    {"parameters", Json::array()},
                    {"tuning",
                     {{{"axis", "theta"},
                       {"critical", 37},
                       {"repeat", 54},
                       {"margin", 0.512345},
                       {"load_uNm", 4.07},
                       {"v_bus_V", 1.8},
                       {"mode", "asymmetric"},
                       {"origin", "tuning"},
                       {"at", "2024-05-01T20:00:00Z"}}}}};
  const auto text = Ask({"params", "9"}, {{"params", {.result = answer}}});
  EXPECT_THAT(text.out, HasSubstr("tuned from rest:"));
  EXPECT_THAT(text.out, HasSubstr("theta  37        54      0.51"));
  EXPECT_THAT(Ask({"params", "9", "get", "phi"}, {{"params", {.result = answer}}}).out,
              Not(HasSubstr("tuned from rest")));
  const auto json = Ask({"params", "9", "--json"}, {{"params", {.result = answer}}});
  EXPECT_EQ(Json::parse(json.out, nullptr, false)["tuning"][0]["margin"], 0.512345);
}

TEST_F(DaemonCommands, StatusShowsTroubleAndPassesJsonThrough) {
  const auto text = Ask({"status"}, {{"status", {.result = StatusAnswer()}}});
  EXPECT_EQ(text.exit, 0) << text.err;
  EXPECT_THAT(text.out, HasSubstr("2, 2 enabled: 2 ready"));
  EXPECT_THAT(text.out, HasSubstr("1 of 2 up, highest load 38 %"));
  EXPECT_THAT(text.out, HasSubstr("bus 1: off (can1: the controller is bus-off), load"));
  EXPECT_THAT(text.out, Not(HasSubstr("bus 0: up")));
  EXPECT_THAT(Ask({"status", "--buses"}, {{"status", {.result = StatusAnswer()}}}).out,
              HasSubstr("bus 0: up"));
  const auto json = Ask({"status", "--json"}, {{"status", {.result = StatusAnswer()}}});
  Json answer = StatusAnswer();
  answer["schema"] = 1;  // the version of the form of all answers (docs/schemas/)
  answer["client_version"] = Json::parse(json.out, nullptr, false).value("client_version", "");
  EXPECT_NE(answer["client_version"], "");
  EXPECT_EQ(Json::parse(json.out, nullptr, false), answer);
}

TEST_F(DaemonCommands, StatusTellsTheTimeSoFarOfAConfigurationUnderWay) {
  const auto reported = [&](const std::string& state, double makespan_s) {
    Json status = StatusAnswer();
    status["configuration"] = ConfigurationAnswer(state, 0, 0);
    status["configuration"]["makespan_s"] = makespan_s;
    return Ask({"status"}, {{"status", {.result = status}}}).out;
  };
  EXPECT_THAT(reported("uploading", 0), HasSubstr("makespan - (predicted 12.5 s)"));
  EXPECT_THAT(reported("moving", 3.25), HasSubstr("makespan 3.2 s so far (predicted 12.5 s)"));
  EXPECT_THAT(reported("done", 13), HasSubstr("makespan 13.0 s (predicted 12.5 s)"));
}

TEST_F(DaemonCommands, AQuestionThatIsNotAnsweredMeansThatNoDaemonIsThere) {
  const auto result = Ask({"status", "--json"}, {{"status", {.hang_up = true}}});
  EXPECT_EQ(result.exit, 4);
  EXPECT_EQ(Json::parse(result.out, nullptr, false)["exit"], 4);
}

TEST_F(DaemonCommands, StatusSurvivesAnAnswerWithoutTheExpectedMembers) {
  const auto result = Ask({"status"}, {{"status", {.result = Json{{"units", "many"}}}}});
  EXPECT_EQ(result.exit, 0) << result.err;
}

TEST_F(DaemonCommands, AnAnswerThatStdoutDoesNotTakeEndsWithFive) {
  FakeDaemon daemon(scratch_ / "sock", {{"status", {.result = StatusAnswer()}},
                                        {"state", {.result = Json{{"rows", Json::array()}}}},
                                        {"apply", {.result = ConfigurationAnswer("done", 1, 1)}}});
  const std::string targets = scratch_.Put("t.csv", kTargets);
  for (std::vector<std::string> words : {std::vector<std::string>{"status"},
                                         {"status", "--json"},
                                         {"state"},
                                         {"state", "--json"},
                                         {"apply", targets, "--wait", "--json"}}) {
    words.insert(words.end(), {"--socket", daemon.path()});
    const auto result = test::FocalfleetInto(">/dev/full", words);
    EXPECT_EQ(result.exit, 5) << words[0] << words[1];
    EXPECT_THAT(result.err, HasSubstr("standard output cannot be written: No space left"));
  }
}

TEST_F(DaemonCommands, RetargetSaysWhetherTheUnitGoes) {
  const auto goes = Ask({"retarget", "7", "12.5", "-3"},
                        {{"retarget", {.result = Json{{"goes", true}, {"text", "unit 7 goes"}}}}});
  EXPECT_EQ(goes.exit, 0);
  EXPECT_THAT(goes.out, HasSubstr("unit 7 goes"));
  EXPECT_EQ(requests_.at(0).args, (Json{{"unit_id", 7}, {"x_mm", 12.5}, {"y_mm", -3.0}}));
  const auto stays =
      Ask({"retarget", "7", "35", "120", "--angles"},
          {{"retarget", {.result = Json{{"goes", false}, {"text", "unit 8 is in the way"}}}}});
  EXPECT_EQ(stays.exit, 3);
  EXPECT_THAT(stays.err, HasSubstr("unit 8 is in the way"));
  EXPECT_EQ(requests_.at(0).args, (Json{{"unit_id", 7}, {"theta_deg", 35.0}, {"phi_deg", 120.0}}));
  EXPECT_EQ(Ask({"retarget", "7", "1"}, {{"retarget", {}}}).exit, 2);
}

TEST_F(DaemonCommands, HomeWantsUnitsOrNotKnownButNotBoth) {
  EXPECT_EQ(Ask({"home"}, {{"home", {}}}).exit, 2);
  EXPECT_EQ(Ask({"home", "1", "--not-known"}, {{"home", {}}}).exit, 2);
  Ask({"home", "1", "2", "--wait"}, {{"home", {.result = ConfigurationAnswer("done", 2, 0)}}});
  EXPECT_EQ(requests_.at(0).args,
            (Json{{"unit_ids", {1, 2}}, {"wait", true}, {"unproven", false}}));
  EXPECT_EQ(Ask({"home", "--not-known"}, {{"home", {}}}).exit, 0);
  EXPECT_EQ(requests_.at(0).args,
            (Json{{"not_known", true}, {"wait", false}, {"unproven", false}}));
}

TEST_F(DaemonCommands, DisableWantsAReason) {
  EXPECT_EQ(Ask({"disable", "1"}, {{"disable", {}}}).exit, 2);
  EXPECT_EQ(Ask({"disable", "1", "3", "--reason", "phi stalls"}, {{"disable", {}}}).exit, 0);
  EXPECT_EQ(requests_.at(0).args, (Json{{"unit_ids", {1, 3}}, {"reason", "phi stalls"}}));
  const auto enable = [&](const char* phase) {
    return Ask({"enable", "3", "--within-s", "0"},
               {{"enable", {}}, {"unit", {.result = Json{{"phase", phase}}}}});
  };
  EXPECT_EQ(enable("ready").exit, 0);
  EXPECT_EQ(requests_.at(0).args, (Json{{"unit_ids", {3}}}));
  const auto faulty = enable("fault");
  EXPECT_EQ(faulty.exit, 3);
  EXPECT_THAT(faulty.err, HasSubstr("still in fault: 3"));
}

TEST_F(DaemonCommands, AdoptUnitAndHistoryAskForTheirUnit) {
  EXPECT_EQ(Ask({"adopt", "9", "--yes"}, {{"adopt", {}}}).exit, 0);
  EXPECT_EQ(requests_.at(0).args, (Json{{"unit_id", 9}}));
  const auto unit = Ask({"unit", "9"}, {{"unit", {.result = Json{{"phase", "ready"}}}}});
  EXPECT_THAT(unit.out, HasSubstr("phase  ready"));
  const auto history =
      Ask({"history", "9", "--limit", "3"},
          {{"history", {.result = Json{{"moves", {{{"move", 4}, {"end", "arrived"}}}}}}}});
  EXPECT_EQ(requests_.at(0).args, (Json{{"unit_id", 9}, {"limit", 3}}));
  EXPECT_THAT(history.out, HasSubstr("arrived"));
  EXPECT_EQ(Ask({"history"}, {{"history", {}}}).exit, 0);
  EXPECT_EQ(requests_.at(0).args, (Json{{"limit", 20}}));
}

TEST_F(DaemonCommands, HistoryTellsConfigurationsFirstEachByItsNumber) {
  Json row = ConfigurationAnswer("done", 2, 0);
  row.erase("unserved");
  row.update({{"began", "b"}, {"changed", "c"}});
  const Json alarm{{"id", 3},     {"at", "a"},          {"severity", "error"},
                   {"bus_id", 1}, {"unit_id", nullptr}, {"text", "down"}};
  const auto history = Ask(
      {"history"}, {{"history", {.result = Json{{"alarms", {alarm}}, {"configurations", {row}}}}}});
  EXPECT_THAT(history.out,
              ::testing::MatchesRegex("configurations\nid +state +source +began +changed +targeted "
                                      "+arrived +refused +failed +makespan_s .*\n7 +done +t.csv .*"
                                      "\n\nalarms\nid +at +severity +bus_id +unit_id +text\n3 .*"));
}

TEST_F(DaemonCommands, ParamsSetTakesNegativeValuesAndWantsAllOfThem) {
  EXPECT_EQ(Ask({"params", "9", "set", "theta", "position", "-500"}, {{"params_set", {}}}).exit, 0);
  EXPECT_EQ(requests_.at(0).args,
            (Json{{"unit_id", 9}, {"axis", "theta"}, {"parameter", "position"}, {"value", -500}}));
  EXPECT_EQ(Ask({"params", "9", "set", "theta", "position"}, {{"params_set", {}}}).exit, 2);
  EXPECT_EQ(Ask({"params", "9", "get", "theta", "repeat", "5"}, {{"params", {}}}).exit, 2);
  EXPECT_EQ(Ask({"params", "9", "get", "theta", "speed"}, {{"params", {}}}).exit, 2);
}

Json StateRow(std::uint32_t unit, const std::string& witness) {
  return {{"unit_id", unit},        {"theta_witness", witness},  {"theta_low_deg", -1.5},
          {"theta_high_deg", -1.5}, {"phi_witness", "reported"}, {"phi_low_deg", 179.25},
          {"phi_high_deg", 179.25}};
}

TEST_F(DaemonCommands, StateWritesWhereEveryUnitStands) {
  const Json rows{{"rows", {StateRow(1, "reported"), StateRow(2, "measured")}}};
  const auto result =
      Ask({"state", "--out", scratch_ / "state.csv"}, {{"state", {.result = rows}}});
  EXPECT_EQ(result.exit, 0) << result.err;
  EXPECT_EQ(test::Slurp(scratch_ / "state.csv"),
            "unit_id,theta_deg,phi_deg\n1,-1.5,179.25\n2,-1.5,179.25\n");
}

TEST_F(DaemonCommands, StateRefusesUnknownPlacesUnlessTheyAreLeftOut) {
  const Json rows{{"rows", {StateRow(1, "reported"), StateRow(2, "interval")}}};
  const auto refused = Ask({"state", "--out", scratch_ / "s.csv"}, {{"state", {.result = rows}}});
  EXPECT_EQ(refused.exit, 1);
  EXPECT_THAT(refused.err, HasSubstr("2 (theta interval, phi reported)"));
  EXPECT_THAT(scratch_.List(), Not(::testing::Contains("s.csv")));
  const auto reported =
      Ask({"state", "--out", scratch_ / "s.csv", "--allow-unknown"}, {{"state", {.result = rows}}});
  EXPECT_EQ(reported.exit, 3);
  EXPECT_EQ(test::Slurp(scratch_ / "s.csv"),
            "unit_id,theta_deg,phi_deg\n1,-1.5,179.25\n# unit 2 left out: theta interval, phi "
            "reported\n");
}

}  // namespace
}  // namespace focalfleet
