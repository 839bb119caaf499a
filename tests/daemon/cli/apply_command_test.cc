// focalfleet apply: the request that it sends, its report of a configuration, and its exit codes.
#include <gmock/gmock.h>
#include <sys/stat.h>

#include <algorithm>

#include "daemon/files/text_file.h"
#include "tests/daemon/cli/daemon_commands.h"

namespace focalfleet {
namespace {

using test::ConfigurationAnswer;
using test::DaemonCommands;
using test::FakeAnswer;
using test::kTargets;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

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

TEST_F(DaemonCommands, ApplyTellsColumnsThatNobodyReads) {
  const std::string file = scratch_.Put("p.csv", "unit_id,x_mm,y_mm,prioritty\n1,0.5,0.25,3\n");
  const std::map<std::string, FakeAnswer> answers = {{"apply", {.result = Json{{"id", 7}}}}};
  EXPECT_EQ(Ask({"apply", file}, answers).err,
            "focalfleet: " + file + ": columns passed over: prioritty\n");
  EXPECT_THAT(Ask({"apply", file, "-q"}, answers).err, IsEmpty());
}

TEST_F(DaemonCommands, ApplyWaitTellsTheSummaryWithAllItsKeys) {
  const auto result = Apply({"--wait", "--json"}, {.result = ConfigurationAnswer("done", 2, 0)});
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
                      {"unserved", Json::array()},
                      {"schema", 1}};
  EXPECT_EQ(reported, expected);
}

TEST_F(DaemonCommands, ApplyWaitTellsUploadAndStarts) {
  const auto result = Apply({"--wait"}, {.result = ConfigurationAnswer("done", 2, 0)});
  EXPECT_THAT(result.out, HasSubstr("upload 0.002 s (its bits take 0.002 s), 1900 bits (1800 "
                                    "predicted)"));
  EXPECT_THAT(result.out, HasSubstr("units began within at most 2.7 ms of each other, at least "
                                    "1.7 ms (likely 2.1; 2 of 2 reported; plans allow for 40 ms)"));
}

TEST_F(DaemonCommands, ApplyWaitNamesUnservedUnitsAndEndsWithThree) {
  const auto json = Apply({"--wait", "--json"}, {.result = ConfigurationAnswer("done", 1, 1)});
  EXPECT_EQ(json.exit, 3);
  EXPECT_EQ(Json::parse(json.out, nullptr, false)["unserved"],
            Json::parse(R"([{"unit_id":2,"outcome":"failed","reason":"no answer","sighting":null,)"
                        R"("error_um":null,"state":"silent"}])"));
  const auto text = Apply({"--wait"}, {.result = ConfigurationAnswer("done", 1, 1)});
  EXPECT_EQ(text.exit, 3);
  EXPECT_THAT(text.out, HasSubstr("unit 2: failed: no answer (now silent)"));
}

TEST_F(DaemonCommands, QuietStillNamesUnservedUnits) {
  const auto apply = Apply({"--wait", "-q"}, {.result = ConfigurationAnswer("done", 1, 1)});
  EXPECT_EQ(apply.exit, 3);
  EXPECT_THAT(apply.out, IsEmpty());
  EXPECT_EQ(apply.err, "focalfleet: not served:\n  unit 2: failed: no answer (now silent)\n");
  const auto home = Ask({"home", "1", "2", "--wait", "-q"},
                        {{"home", {.result = ConfigurationAnswer("done", 1, 1)}}});
  EXPECT_EQ(home.exit, 3);
  EXPECT_THAT(home.err, HasSubstr("unit 2: failed: no answer"));
  const auto json =
      Apply({"--wait", "-q", "--json"}, {.result = ConfigurationAnswer("done", 1, 1)});
  EXPECT_THAT(json.err, IsEmpty());
  EXPECT_THAT(json.out, HasSubstr("no answer"));
}

TEST_F(DaemonCommands, ManyUnservedUnitsAreReportedByReason) {
  Json configuration = ConfigurationAnswer("done", 0, 0);
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
  // The five lines are the summary, its figures, the upload and the starts; each reason adds one.
  EXPECT_EQ(std::count(text.out.begin(), text.out.end(), '\n'), 5 + 2);
}

TEST_F(DaemonCommands, ReasonsThatDifferInNumbersAloneAreOne) {
  Json configuration = ConfigurationAnswer("done", 0, 0);
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
  Json configuration = ConfigurationAnswer("done", 0, 0);
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
  Json configuration = ConfigurationAnswer("stopped", 1, 0);
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
  EXPECT_EQ(Apply({"--wait"}, {.result = ConfigurationAnswer("stopped", 1, 0)}).exit, 5);
  EXPECT_EQ(Apply({"--wait"}, {.result = ConfigurationAnswer("failed", 0, 1)}).exit, 5);
}

TEST_F(DaemonCommands, ApplyWaitTellsWhatWentWrongOnTheWay) {
  Json configuration = ConfigurationAnswer("failed", 1, 0);
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
      .result = ConfigurationAnswer("done", 2, 0)};
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

}  // namespace
}  // namespace focalfleet
