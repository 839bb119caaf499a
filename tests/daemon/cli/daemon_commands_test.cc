// The commands that speak to the daemon, as processes of their own, against scripted answers.
#include <gmock/gmock.h>
#include <sys/stat.h>

#include "daemon/files/text_file.h"
#include "tests/daemon/cli/fake_daemon.h"
#include "tests/daemon/cli/program.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using test::FakeAnswer;
using test::FakeDaemon;
using test::Focalfleet;
using test::ProgramResult;
using test::ScratchFolder;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

constexpr const char* kTargets = "unit_id,x_mm,y_mm\n1,0.5,0.25\n2,26.0,0.5\n";

Json Configuration(const std::string& state, std::uint64_t arrived, std::uint64_t failed) {
  Json c{{"id", 7},
         {"source", "t.csv"},
         {"state", state},
         {"round", 1},
         {"targeted", 2},
         {"arrived", arrived},
         {"refused", 0},
         {"failed", failed},
         {"makespan_predicted_s", 12.5},
         {"makespan_s", 12.75},
         {"energy_J", 3.5},
         {"peak_power_W", 0.5},
         {"frames", 420},
         {"upload_bits_predicted", 1800},
         {"upload_bits", 1900},
         {"upload_predicted_s", 0.0018},
         {"upload_s", 0.002},
         {"starts", 2},
         {"starts_known", 2},
         {"start_skew_s", 0.0021},
         {"start_skew_bound_s", 0.0006},
         {"start_skew_least_s", 0.0017},
         {"start_skew_most_s", 0.0027},
         {"start_skew_allowed_s", 0.04},
         {"start_first", {{"unit_id", 1}, {"bus_id", 0}}},
         {"start_last", {{"unit_id", 2}, {"bus_id", 1}}},
         {"unserved", Json::array()}};
  if (failed != 0) {
    c["unserved"].push_back(
        {{"unit_id", 2}, {"outcome", "failed"}, {"reason", "no answer"}, {"state", "silent"}});
  }
  return c;
}

Json Status() {
  return {{"version", "0.1.0"},
          {"units", 2},
          {"enabled", 2},
          {"phases", {{"ready", 2}}},
          {"positions", {{"reported", 2}}},
          {"busy", false},
          {"store", {{"path", "fleet.db"}, {"failing", false}}},
          {"configuration", Configuration("done", 2, 0)},
          {"buses",
           {{{"bus_id", 0}, {"link", "up"}, {"load", 0.1}, {"load_max", 0.2}},
            {{"bus_id", 1},
             {"link", "off"},
             {"port", "can1"},
             {"trouble", "the controller is bus-off"},
             {"load", 0.0},
             {"load_max", 0.375}}}},
          {"bus_load_max", 0.375}};
}

class DaemonCommands : public ::testing::Test {
 protected:
  ProgramResult Ask(std::vector<std::string> words, std::map<std::string, FakeAnswer> answers) {
    FakeDaemon daemon(scratch_ / "sock", std::move(answers));
    words.insert(words.end(), {"--socket", daemon.path()});
    ProgramResult result = Focalfleet(words);
    requests_ = daemon.requests();
    return result;
  }
  ProgramResult Apply(std::vector<std::string> more, FakeAnswer answer) {
    std::vector<std::string> words = {"apply", scratch_.Put("t.csv", kTargets)};
    words.insert(words.end(), more.begin(), more.end());
    return Ask(words, {{"apply", std::move(answer)}, {"status", {.result = Status()}}});
  }

  ScratchFolder scratch_;
  std::vector<ControlRequest> requests_;
};

TEST_F(DaemonCommands, ApplySendsTheFileAndItsName) {
  const auto result = Apply({"--fixed"}, {.result = Json{{"configuration", 7}}});
  EXPECT_EQ(result.exit, 0) << result.err;
  ASSERT_EQ(requests_.size(), 1u);
  EXPECT_EQ(requests_[0].args["targets_csv"], kTargets);
  EXPECT_EQ(requests_[0].args["source"], scratch_ / "t.csv");
  EXPECT_EQ(requests_[0].args["fixed"], true);
  EXPECT_EQ(requests_[0].args["wait"], false);
  EXPECT_THAT(result.out, HasSubstr("configuration 7 accepted"));
}

TEST_F(DaemonCommands, ApplyCallsAFileByItsNameWhereItsPathIsTooLong) {
  std::string folder = scratch_.path();
  for (int i = 0; i < 4; ++i) {
    folder += "/" + std::string(100, 'd');
    ASSERT_EQ(mkdir(folder.c_str(), 0755), 0);
  }
  const std::string file = folder + "/t.csv";
  ASSERT_TRUE(WriteFileAtomically(file, kTargets));
  Ask({"apply", file}, {{"apply", {.result = Json{{"configuration", 7}}}}});
  ASSERT_EQ(requests_.size(), 1u);
  EXPECT_EQ(requests_[0].args["source"], "t.csv");
}

TEST_F(DaemonCommands, NothingThatADaemonSaysMovesTheCursorOrForgesALine) {
  const std::string evil =
      "x\n\x1b[2Jforged\xc2\x9b"
      "31m";
  Json status = Status();
  status["version"] = status["store"]["path"] = status["configuration"]["source"] = evil;
  status["dds"] = {{"trouble", evil}};
  status["buses"][1]["trouble"] = evil;
  const Json history = {{"configurations", {{{"id", 1}, {"source", evil}}}},
                        {"alarms", {{{"id", 2}, {"text", evil}}}}};
  const Json model = {{"in_force", {{"name", evil}, {"left_out", {evil}}}}};
  Json failed = Configuration("done", 1, 1);
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
    // The text of an error may have lines of its own.
    EXPECT_TRUE(words[0] == "enable" || said.find("x\n") == std::string::npos) << said;
    EXPECT_TRUE(words[0] == "stop" || said.find("forged") != std::string::npos) << said;
  }
  const auto json = Json::parse(Ask({"status", "--json"}, answers).out, nullptr, false);
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
  Json status = Status();
  status["dds"] = {{"enabled", true}, {"trouble", "status: DDS: cannot set up the domain"}};
  EXPECT_THAT(Ask({"status"}, {{"status", {.result = status}}}).out,
              HasSubstr("dds        MISSING status: DDS: cannot set up the domain"));
}

TEST_F(DaemonCommands, ApplyTellsColumnsThatNobodyReads) {
  const std::string file = scratch_.Put("p.csv", "unit_id,x_mm,y_mm,prioritty\n1,0.5,0.25,3\n");
  const std::map<std::string, FakeAnswer> answers = {{"apply", {.result = Json{{"id", 7}}}}};
  EXPECT_EQ(Ask({"apply", file}, answers).err,
            "focalfleet: " + file + ": columns passed over: prioritty\n");
  EXPECT_THAT(Ask({"apply", file, "-q"}, answers).err, IsEmpty());
}

TEST_F(DaemonCommands, ApplyWaitTellsTheSummaryWithAllItsKeys) {
  const auto result = Apply({"--wait", "--json"}, {.result = Configuration("done", 2, 0)});
  EXPECT_EQ(result.exit, 0) << result.err;
  EXPECT_THAT(result.err, IsEmpty());
  const Json reported = Json::parse(result.out, nullptr, false);
  ASSERT_TRUE(reported.is_object()) << result.out;
  const Json expected{{"configuration", 7},
                      {"state", "done"},
                      {"units", 2},
                      {"targeted", 2},
                      {"arrived", 2},
                      {"refused", 0},
                      {"failed", 0},
                      {"stopped", 0},
                      {"unmeasured", 0},
                      {"makespan_predicted_s", 12.5},
                      {"makespan_s", 12.75},
                      {"measured", Json::array()},
                      {"not_measured", nullptr},
                      {"energy_J", 3.5},
                      {"peak_power_W", 0.5},
                      {"frames", 420},
                      {"upload_bits_predicted", 1800},
                      {"upload_bits", 1900},
                      {"upload_predicted_s", 0.0018},
                      {"upload_s", 0.002},
                      {"starts", 2},
                      {"starts_known", 2},
                      {"start_skew_s", 0.0021},
                      {"start_skew_bound_s", 0.0006},
                      {"start_skew_least_s", 0.0017},
                      {"start_skew_most_s", 0.0027},
                      {"start_skew_allowed_s", 0.04},
                      {"start_first", {{"unit_id", 1}, {"bus_id", 0}}},
                      {"start_last", {{"unit_id", 2}, {"bus_id", 1}}},
                      {"bus_load_max", 0.375},
                      {"unserved", Json::array()}};
  EXPECT_EQ(reported, expected);
}

TEST_F(DaemonCommands, ApplyWaitTellsUploadAndStarts) {
  const auto result = Apply({"--wait"}, {.result = Configuration("done", 2, 0)});
  EXPECT_THAT(result.out, HasSubstr("upload 0.002 s (its bits take 0.002 s), 1900 bits (1800 "
                                    "predicted)"));
  EXPECT_THAT(result.out, HasSubstr("units began within at most 2.7 ms of each other, at least "
                                    "1.7 ms (likely 2.1; 2 of 2 told; plans allow for 40 ms)"));
}

TEST_F(DaemonCommands, ApplyWaitNamesUnservedUnitsAndEndsWithThree) {
  const auto json = Apply({"--wait", "--json"}, {.result = Configuration("done", 1, 1)});
  EXPECT_EQ(json.exit, 3);
  EXPECT_EQ(Json::parse(json.out, nullptr, false)["unserved"],
            Json::parse(R"([{"unit_id":2,"outcome":"failed","reason":"no answer","sighting":null,)"
                        R"("error_um":null,"state":"silent"}])"));
  const auto text = Apply({"--wait"}, {.result = Configuration("done", 1, 1)});
  EXPECT_EQ(text.exit, 3);
  EXPECT_THAT(text.out, HasSubstr("unit 2: failed: no answer (now silent)"));
}

TEST_F(DaemonCommands, QuietStillNamesUnservedUnits) {
  const auto apply = Apply({"--wait", "-q"}, {.result = Configuration("done", 1, 1)});
  EXPECT_EQ(apply.exit, 3);
  EXPECT_THAT(apply.out, IsEmpty());
  EXPECT_EQ(apply.err, "focalfleet: not served:\n  unit 2: failed: no answer (now silent)\n");
  const auto home =
      Ask({"home", "1", "2", "--wait", "-q"}, {{"home", {.result = Configuration("done", 1, 1)}}});
  EXPECT_EQ(home.exit, 3);
  EXPECT_THAT(home.err, HasSubstr("unit 2: failed: no answer"));
  const auto json = Apply({"--wait", "-q", "--json"}, {.result = Configuration("done", 1, 1)});
  EXPECT_THAT(json.err, IsEmpty());
  EXPECT_THAT(json.out, HasSubstr("no answer"));
}

TEST_F(DaemonCommands, ManyUnservedUnitsAreReportedByReason) {
  Json configuration = Configuration("done", 0, 0);
  configuration["unserved"] = Json::array();
  for (std::uint32_t id = 1; id <= 320; ++id) {
    configuration["unserved"].push_back({{"unit_id", id},
                                         {"outcome", "failed"},
                                         {"reason", id == 30 ? "stalled" : "no answer"},
                                         {"state", "silent"}});
  }
  const auto text = Apply({"--wait"}, {.result = configuration});
  EXPECT_THAT(text.out,
              HasSubstr("  319 units (1, 2, 3, 4, 5, ...): failed: no answer (now silent)\n"
                        "  unit 30: failed: stalled (now silent)\n"));
  // What it is, what it took, its upload and starts; a line a reason.
  EXPECT_EQ(std::count(text.out.begin(), text.out.end(), '\n'), 5 + 2);
}

TEST_F(DaemonCommands, ReasonsThatDifferInNumbersAloneAreOne) {
  Json configuration = Configuration("done", 0, 0);
  configuration["unserved"] = Json::array();
  for (std::uint32_t id = 1; id <= 100; ++id)
    configuration["unserved"].push_back(
        {{"unit_id", id},
         {"outcome", "failed"},
         {"reason",
          std::to_string(10 + id) + ".5 um from its target as measured, more than 10.0 um"},
         {"state", "ready"}});
  const auto text = Apply({"--wait"}, {.result = configuration});
  EXPECT_THAT(text.out,
              HasSubstr("  100 units (1, 2, 3, 4, 5, ...): failed: 11.5 to 110.5 um from its "
                        "target as measured, more than 10.0 um (now ready)\n"));
  EXPECT_EQ(std::count(text.out.begin(), text.out.end(), '\n'), 5 + 1);
}

TEST_F(DaemonCommands, WhatNobodyMeasuredIsNotDone) {
  Json configuration = Configuration("done", 0, 0);
  configuration["unmeasured"] = 2;
  configuration["not_measured"] = "3 exposures could not be used, the last because nothing came";
  for (const std::uint32_t id : {1u, 2u})
    configuration["unserved"].push_back({{"unit_id", id},
                                         {"outcome", "unmeasured"},
                                         {"reason", "not measured: nothing came"},
                                         {"state", "ready"}});
  const auto text = Apply({"--wait", "--correct", "1"}, {.result = configuration});
  EXPECT_EQ(text.exit, 3);
  EXPECT_THAT(text.out, HasSubstr("0 of 2 units arrived, 0 refused, 0 failed, 2 unmeasured\n"));
  EXPECT_THAT(text.out, HasSubstr("not measured: 3 exposures could not be used"));
  const auto json = Apply({"--wait", "--json"}, {.result = configuration});
  const Json reported = Json::parse(json.out, nullptr, false);
  EXPECT_EQ(reported["unmeasured"], 2);
  EXPECT_EQ(reported["not_measured"], configuration["not_measured"]);
  EXPECT_EQ(reported["unserved"][1]["outcome"], "unmeasured");
}

TEST_F(DaemonCommands, AStoppedConfigurationIsOneLineAndNoListOfItsUnits) {
  Json configuration = Configuration("stopped", 1, 0);
  configuration["targeted"] = 100;
  configuration["stopped"] = 98;
  configuration["failed"] = 1;
  for (std::uint32_t id = 1; id <= 99; ++id)
    configuration["unserved"].push_back(
        {{"unit_id", id},
         {"outcome", id == 7 ? "failed" : "stopped"},
         {"reason", id == 7 ? "it does not answer" : "stopped by the operator"},
         {"state", "ready"}});
  const auto text = Apply({"--wait"}, {.result = configuration});
  EXPECT_EQ(text.exit, 5);
  EXPECT_THAT(text.out, HasSubstr("1 of 100 units arrived, 0 refused, 1 failed, 98 stopped\n"));
  EXPECT_THAT(text.out, HasSubstr("unit 7: failed: it does not answer"));
  EXPECT_THAT(text.out, Not(HasSubstr("stopped by the operator")));
}

TEST_F(DaemonCommands, ApplyWaitEndsWithFiveWhereItWasStoppedOrFailed) {
  EXPECT_EQ(Apply({"--wait"}, {.result = Configuration("stopped", 1, 0)}).exit, 5);
  EXPECT_EQ(Apply({"--wait"}, {.result = Configuration("failed", 0, 1)}).exit, 5);
}

TEST_F(DaemonCommands, ApplyWaitTellsWhatWentWrongOnTheWay) {
  Json configuration = Configuration("failed", 1, 0);
  configuration["error"] = "the store cannot be written";
  const auto text = Apply({"--wait"}, {.result = configuration});
  EXPECT_EQ(text.exit, 5);
  EXPECT_THAT(text.out, HasSubstr("the store cannot be written"));
  const auto json = Apply({"--wait", "--json"}, {.result = configuration});
  EXPECT_EQ(Json::parse(json.out, nullptr, false)["error"]["text"], "the store cannot be written");
}

TEST_F(DaemonCommands, ApplyShowsProgressInPlainLinesIntoAPipeAndNoneWithQuiet) {
  FakeAnswer answer{
      .progress =
          {{{"state", "uploading"}, {"round", 1}, {"fraction", 0.0}},
           {{"state", "moving"}, {"round", 1}, {"fraction", 0.5}, {"arrived", 1}, {"targeted", 2}}},
      .result = Configuration("done", 2, 0)};
  const auto loud = Apply({"--wait"}, answer);
  EXPECT_THAT(loud.err, HasSubstr("  0 %  round 1: uploading"));
  EXPECT_THAT(loud.err, HasSubstr(" 50 %  round 1: moving  1 of 2 arrived\n"));
  EXPECT_THAT(loud.err, Not(HasSubstr("\r")));
  const auto quiet = Apply({"--wait", "--quiet"}, answer);
  EXPECT_THAT(quiet.err, IsEmpty());
  EXPECT_THAT(quiet.out, IsEmpty());
}

TEST_F(DaemonCommands, ApplyTellsWhatTheDaemonRefused) {
  const auto result =
      Apply({"--wait"},
            {.result = Fail(ErrorCode::kInvalid, "t.csv:3: unit 2: named twice (first in row 2)")});
  EXPECT_EQ(result.exit, 1);
  EXPECT_THAT(result.out, IsEmpty());
  EXPECT_THAT(result.err, HasSubstr("t.csv:3: unit 2: named twice"));
}

TEST_F(DaemonCommands, ApplyEndsWithFiveWhereTheDaemonGoesAwayOnTheWay) {
  const auto result = Apply({"--wait"}, {.hang_up = true});
  EXPECT_EQ(result.exit, 5);
  EXPECT_THAT(result.err, HasSubstr("whether `apply` took effect is not known"));
}

TEST_F(DaemonCommands, ApplyEndsWithFiveWhereTheDaemonEndsOnTheWay) {
  const auto result =
      Apply({"--wait"}, {.result = Fail(ErrorCode::kUnavailable, "the daemon ends")});
  EXPECT_EQ(result.exit, 5);
}

TEST_F(DaemonCommands, HomeWaitEndsAsItsUnitsDid) {
  const auto good =
      Ask({"home", "1", "2", "--wait"}, {{"home", {.result = Configuration("done", 2, 0)}}});
  EXPECT_EQ(good.exit, 0);
  const auto bad =
      Ask({"home", "1", "2", "--wait"}, {{"home", {.result = Configuration("done", 1, 1)}}});
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

TEST_F(DaemonCommands, ApplyDoesNotAskTheDaemonAboutAFileThatIsNoText) {
  const std::string binary = scratch_.Put("b.csv", std::string("unit_id,x_mm\n1,\0", 16) + "\xff");
  const auto result = Ask({"apply", binary}, {});
  EXPECT_EQ(result.exit, 1);
  EXPECT_THAT(result.err, HasSubstr("b.csv:2: not a text file: byte 0x00"));
  EXPECT_THAT(requests_, IsEmpty());
  const auto missing = Ask({"apply", scratch_ / "none.csv"}, {});
  EXPECT_EQ(missing.exit, 1);
  EXPECT_THAT(missing.err, HasSubstr("none.csv: cannot be read: No such file"));
}

TEST_F(DaemonCommands, StatusShowsTroubleAndPassesJsonThrough) {
  const auto text = Ask({"status"}, {{"status", {.result = Status()}}});
  EXPECT_EQ(text.exit, 0) << text.err;
  EXPECT_THAT(text.out, HasSubstr("2, 2 enabled: 2 ready"));
  EXPECT_THAT(text.out, HasSubstr("1 of 2 up, highest load 38 %"));
  EXPECT_THAT(text.out, HasSubstr("bus 1: off (can1: the controller is bus-off), load"));
  EXPECT_THAT(text.out, Not(HasSubstr("bus 0: up")));
  EXPECT_THAT(Ask({"status", "--buses"}, {{"status", {.result = Status()}}}).out,
              HasSubstr("bus 0: up"));
  const auto json = Ask({"status", "--json"}, {{"status", {.result = Status()}}});
  EXPECT_EQ(Json::parse(json.out, nullptr, false), Status());
}

TEST_F(DaemonCommands, StatusTellsTheTimeSoFarOfAConfigurationUnderWay) {
  const auto reported = [&](const std::string& state, double makespan_s) {
    Json status = Status();
    status["configuration"] = Configuration(state, 0, 0);
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
  FakeDaemon daemon(scratch_ / "sock", {{"status", {.result = Status()}},
                                        {"state", {.result = Json{{"rows", Json::array()}}}},
                                        {"apply", {.result = Configuration("done", 1, 1)}}});
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

TEST_F(DaemonCommands, StopNamesAUnitOrNone) {
  const auto all = Ask({"stop"}, {{"stop", {}}, {"status", {.result = Status()}}});
  EXPECT_EQ(all.exit, 0) << all.err;
  EXPECT_EQ(requests_.at(0).args, Json::object());
  const auto one =
      Ask({"stop", "17"}, {{"stop", {}}, {"unit", {.result = Json{{"phase", "ready"}}}}});
  EXPECT_EQ(one.exit, 0) << one.err;
  EXPECT_EQ(requests_.at(0).args, (Json{{"unit_id", 17}}));
}

TEST_F(DaemonCommands, AStopIsDoneWhenUnitsStand) {
  Json moves = Status();
  moves["phases"] = {{"ready", 1}, {"settling", 1}};
  const auto all = Ask({"stop", "--within-s", "0"}, {{"stop", {}}, {"status", {.result = moves}}});
  EXPECT_EQ(all.exit, 3);
  EXPECT_THAT(all.err, HasSubstr("1 unit did not confirm"));
  const auto one = Ask({"stop", "17", "--within-s", "0", "--json"},
                       {{"stop", {}}, {"unit", {.result = Json{{"phase", "moving"}}}}});
  EXPECT_EQ(one.exit, 3);
  EXPECT_EQ(Json::parse(one.out, nullptr, false)["not_standing"], 1);
  moves["phases"] = {{"ready", 1}, {"silent", 2}, {"identifying", 1}, {"absent", 1}};
  const auto silent =
      Ask({"stop", "--within-s", "0"}, {{"stop", {}}, {"status", {.result = moves}}});
  EXPECT_EQ(silent.exit, 3);
  EXPECT_THAT(silent.err, HasSubstr("3 units do not answer, so whether they stand is not known"));
  const auto absent = Ask({"stop", "17", "--within-s", "0", "--json"},
                          {{"stop", {}}, {"unit", {.result = Json{{"phase", "absent"}}}}});
  EXPECT_EQ(absent.exit, 3);
  EXPECT_EQ(Json::parse(absent.out, nullptr, false)["not_known"], 1);
  EXPECT_EQ(Ask({"stop"}, {{"stop", {}}}).exit, 5) << "whether they stand is not known";
}

// Where all places are taken the daemon lets a stop in, and no question.
TEST_F(DaemonCommands, AStopAsksAgainWhereTheDaemonHasNoPlaceForAQuestion) {
  const auto all = Ask({"stop", "--within-s", "600"},
                       {{"stop", {}}, {"status", {.full_first = 2, .result = Status()}}});
  EXPECT_EQ(all.exit, 0) << all.err;
  EXPECT_EQ(requests_.size(), 4u);
  const auto never = Ask({"stop", "--within-s", "0"},
                         {{"stop", {}}, {"status", {.full_first = 1000, .result = Status()}}});
  EXPECT_EQ(never.exit, 5);
  EXPECT_THAT(never.err, HasSubstr("whether units stand is not known: too many clients"));
}

TEST_F(DaemonCommands, StopPointsToTheDirectWayWhereNoDaemonAnswers) {
  const auto result = Focalfleet({"stop", "--socket", scratch_ / "nobody"});
  EXPECT_EQ(result.exit, 4);
  EXPECT_THAT(result.err, HasSubstr("stop --direct"));
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
  Ask({"home", "1", "2", "--wait"}, {{"home", {.result = Configuration("done", 2, 0)}}});
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
  EXPECT_EQ(Ask({"adopt", "9"}, {{"adopt", {}}}).exit, 0);
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
  Json row = Configuration("done", 2, 0);
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

TEST_F(DaemonCommands, StateRefusesUnknownPlacesUnlessToldToLeaveThemOut) {
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
