// layout, targets and plan as processes: the files that they write. Bad input is named, and then
// nothing is written.
#include <gmock/gmock.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmath>

#include "daemon/control/messages.h"
#include "fleet/files/fiducials_file.h"
#include "fleet/files/layout_file.h"
#include "fleet/files/plan_file.h"
#include "fleet/files/state_file.h"
#include "fleet/files/targets_file.h"
#include "tests/daemon/cli/program.h"
#include "tests/support/scratch_folder.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

using test::Focalfleet;
using test::ProgramResult;
using test::ScratchFolder;
using test::Slurp;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

class OfflineCommands : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_EQ(
        Focalfleet({"layout", "hex", "--count", "37", "--pitch-mm", "25.6", "--out", units_}).exit,
        0);
    ASSERT_EQ(Draw({"--seed", "1", "--as", "state", "--out", state_}).exit, 0);
  }

  ProgramResult Draw(std::vector<std::string> more) {
    std::vector<std::string> words = {"targets", "--units", units_};
    words.insert(words.end(), more.begin(), more.end());
    return Focalfleet(words);
  }
  ProgramResult Plan(const std::string& targets, std::vector<std::string> more = {}) {
    std::vector<std::string> words = {"plan",   "--units", units_,  "--targets", targets,
                                      "--from", state_,    "--out", plan_};
    words.insert(words.end(), more.begin(), more.end());
    return Focalfleet(words);
  }
  // The text is refused with exactly this complaint, and no plan is left.
  void ExpectRefused(const std::string& text, const std::string& complaint) {
    const ProgramResult result = Plan(scratch_.Put("bad.csv", text), {"--json"});
    EXPECT_EQ(result.exit, 1) << text;
    EXPECT_THAT(result.err, HasSubstr(complaint)) << text;
    const Json reported = Json::parse(result.out, nullptr, false);
    ASSERT_TRUE(reported.is_object()) << result.out;
    EXPECT_THAT(reported["error"]["text"].get<std::string>(), HasSubstr(complaint));
    EXPECT_THAT(scratch_.List(), ElementsAre("bad.csv", "state.csv", "units.csv")) << text;
  }

  ScratchFolder scratch_;
  std::string units_ = scratch_ / "units.csv";
  std::string state_ = scratch_ / "state.csv";
  std::string plan_ = scratch_ / "plan.csv";
};

TEST_F(OfflineCommands, LayoutWritesTheCountAtThePitch) {
  const auto layout = ReadLayout(Slurp(units_), "units.csv", {});
  ASSERT_TRUE(layout) << layout.error().text;
  EXPECT_EQ(layout->size(), 37u);
  EXPECT_NEAR(layout->pitch_mm(), 25.6, 1e-9);
}

TEST_F(OfflineCommands, LayoutTakesGearsAndArms) {
  const auto result = Focalfleet({"layout", "hex", "--count", "3", "--gear", "900", "800",
                                  "--arm-mm", "8", "--out", scratch_ / "g.csv", "--json"});
  EXPECT_EQ(result.exit, 0) << result.err;
  const Json reported = Json::parse(result.out, nullptr, false);
  EXPECT_EQ(reported["units"], 3);
  const auto layout = ReadLayout(Slurp(scratch_ / "g.csv"), "g.csv", {});
  ASSERT_TRUE(layout) << layout.error().text;
  EXPECT_EQ(layout->unit({2}).theta().gear, 900);
  EXPECT_EQ(layout->unit({2}).phi().gear, 800);
  EXPECT_EQ(layout->unit({0}).phi().arm_mm, 8);
}

TEST_F(OfflineCommands, LayoutPutsFiducialsBesideTheUnits) {
  const std::string units = scratch_ / "u.csv";
  const std::string lights = scratch_ / "f.csv";
  const auto result = Focalfleet({"layout", "hex", "--count", "30", "--fiducials", "7",
                                  "--fiducials-out", lights, "--out", units, "--json"});
  ASSERT_EQ(result.exit, 0) << result.err;
  EXPECT_EQ(Json::parse(result.out)["fiducials"], 7);
  const auto layout = ReadLayout(Slurp(units), "u.csv", {});
  ASSERT_TRUE(layout) << layout.error().text;
  EXPECT_EQ(layout->size(), 30u);
  const auto fiducials = ReadFiducials(Slurp(lights), "f.csv");
  ASSERT_TRUE(fiducials) << fiducials.error().text;
  EXPECT_EQ(fiducials->size(), 7u);
  EXPECT_EQ(Focalfleet({"layout", "hex", "--count", "30", "--fiducials", "7", "--out", units}).exit,
            2);
}

TEST_F(OfflineCommands, LayoutOutOfLimitsIsWrongUsage) {
  for (const char* count : {"0", "-3", "1000000", "many"}) {
    EXPECT_EQ(Focalfleet({"layout", "hex", "--count", count, "--out", scratch_ / "x.csv"}).exit, 2)
        << count;
  }
  EXPECT_THAT(scratch_.List(), Not(Contains("x.csv")));
}

TEST_F(OfflineCommands, NumbersOutOfRangeAreRefusedInAFewWords) {
  const std::string out = scratch_ / "x.csv";
  const std::vector<std::string> hex = {"layout", "hex", "--count", "3", "--out", out};
  const std::vector<std::string> draw = {"targets", "--units", units_, "--seed", "1", "--out", out};
  const auto refuses = [](std::vector<std::string> words, const std::string& option,
                          const std::string& value) {
    words.insert(words.end(), {option, value});
    const auto result = Focalfleet(words);
    EXPECT_EQ(result.exit, 2) << option << " " << value;
    EXPECT_THAT(result.err, HasSubstr(option + ": " + value + " is not a number of "))
        << result.err;
    EXPECT_LT(result.err.size(), 200u) << result.err;
  };
  for (const char* value : {"inf", "nan", "0", "-1", "1e9"}) {
    refuses(hex, "--pitch-mm", value);
    refuses(hex, "--arm-mm", value);
    refuses(hex, "--gear", value);
  }
  for (const char* value : {"inf", "nan", "-1"}) {
    refuses(draw, "--clearance-mm", value);
    refuses({"watch", "--once"}, "--wait", value);
  }
  EXPECT_THAT(scratch_.List(), Not(Contains("x.csv")));
}

TEST_F(OfflineCommands, SameSeedDrawsTheSameBytesAndAnotherSeedOthers) {
  EXPECT_EQ(Draw({"--seed", "5", "--out", scratch_ / "a.csv"}).exit, 0);
  EXPECT_EQ(Draw({"--seed", "5", "--out", scratch_ / "b.csv"}).exit, 0);
  EXPECT_EQ(Draw({"--seed", "6", "--out", scratch_ / "c.csv"}).exit, 0);
  EXPECT_EQ(Slurp(scratch_ / "a.csv"), Slurp(scratch_ / "b.csv"));
  EXPECT_NE(Slurp(scratch_ / "a.csv"), Slurp(scratch_ / "c.csv"));
}

TEST_F(OfflineCommands, TargetsArePlacesOrAngles) {
  EXPECT_EQ(Draw({"--seed", "5", "--out", scratch_ / "a.csv"}).exit, 0);
  EXPECT_THAT(Slurp(scratch_ / "a.csv"), ::testing::StartsWith("unit_id,x_mm,y_mm\n"));
  EXPECT_EQ(Draw({"--seed", "5", "--angles", "--out", scratch_ / "b.csv"}).exit, 0);
  EXPECT_THAT(Slurp(scratch_ / "b.csv"), ::testing::StartsWith("unit_id,theta_deg,phi_deg\n"));
}

// Unit 1 is the one at the centre.
std::string WithUnitOneDisabled(const std::string& units_csv) {
  auto file = ReadUnits(units_csv, "units.csv");
  EXPECT_TRUE(file);
  file->units[0].enabled = false;
  return WriteUnits(file->units);
}

TEST_F(OfflineCommands, DisabledUnitsKeepTheirPlaceAndGetNoTarget) {
  units_ = scratch_.Put("units.csv", WithUnitOneDisabled(Slurp(units_)));
  ASSERT_EQ(Draw({"--seed", "1", "--as", "state", "--out", state_}).exit, 0);
  EXPECT_EQ(
      Draw({"--seed", "9", "--from", state_, "--as", "state", "--out", scratch_ / "s9.csv"}).exit,
      0);
  const std::string before = Slurp(state_);
  const std::string after = Slurp(scratch_ / "s9.csv");
  const auto row_of_unit_one = [](const std::string& csv) {
    const std::size_t begin = csv.find("\n1,") + 1;
    return csv.substr(begin, csv.find('\n', begin) - begin);
  };
  EXPECT_EQ(row_of_unit_one(before), row_of_unit_one(after));
  EXPECT_NE(before, after);

  EXPECT_EQ(Draw({"--seed", "9", "--from", state_, "--out", scratch_ / "t.csv"}).exit, 0);
  EXPECT_THAT(Slurp(scratch_ / "t.csv"), Not(HasSubstr("\n1,")));
}

TEST_F(OfflineCommands, DrawingRefusesAStateWithoutTheDisabledUnit) {
  units_ = scratch_.Put("units.csv", WithUnitOneDisabled(Slurp(units_)));
  const std::string state = scratch_.Put("s.csv", "unit_id,theta_deg,phi_deg\n2,0,180\n");
  const auto result = Draw({"--seed", "1", "--from", state, "--out", scratch_ / "t.csv"});
  EXPECT_EQ(result.exit, 1);
  EXPECT_THAT(result.err,
              HasSubstr("s.csv: no row for disabled unit 1: where it stands is needed"));
  EXPECT_THAT(scratch_.List(), Not(Contains("t.csv")));
}

TEST_F(OfflineCommands, PlanServesADrawnConfigurationAndTellsTheSummary) {
  const std::string targets = scratch_ / "t.csv";
  ASSERT_EQ(Draw({"--seed", "2", "--from", state_, "--out", targets}).exit, 0);
  const auto result = Plan(targets, {"--json"});
  ASSERT_EQ(result.exit, 0) << result.err << result.out;
  EXPECT_THAT(result.err, IsEmpty());
  const Json reported = Json::parse(result.out, nullptr, false);
  EXPECT_EQ(reported["units"], 37);
  EXPECT_EQ(reported["targeted"], 37);
  EXPECT_EQ(reported["served"], 37);
  EXPECT_EQ(reported["unserved"], Json::array());
  for (const char* key : {"makespan_s", "energy_J", "peak_power_W", "cpu_s"}) {
    EXPECT_GT(reported[key].get<double>(), 0) << key;
  }
  const auto rows = ReadPlan(Slurp(plan_), plan_);
  ASSERT_TRUE(rows) << rows.error().text;
  EXPECT_EQ(reported["rows"], rows->size());

  double last_s = 0;
  double energy_J = 0;
  for (const PlanRow& row : *rows) {
    last_s = std::max(last_s, row.t1_s);
    energy_J += row.power_W * (row.t1_s - row.t0_s);
  }
  EXPECT_NEAR(reported["makespan_s"].get<double>(), last_s, 1e-6);
  EXPECT_NEAR(reported["energy_J"].get<double>(), energy_J, 1e-6 * energy_J);
  ASSERT_FALSE(reported["rails"].empty());
  EXPECT_GT(reported["rails"][0]["peak_power_W"].get<double>(), 0);
}

TEST_F(OfflineCommands, PlanSavesEnergyLowersThePeakOrEvensPowerOut) {
  const std::string targets = scratch_ / "t.csv";
  ASSERT_EQ(Draw({"--seed", "2", "--from", state_, "--out", targets}).exit, 0);
  const auto planned = [&](const std::vector<std::string>& options) {
    const auto result = Plan(targets, options);
    EXPECT_EQ(result.exit, 0) << result.err;
    return Json::parse(result.out, nullptr, false);
  };
  const auto number = [](const Json& reported, const char* key) {
    return reported[key].get<double>();
  };
  const Json soonest = planned({"--json"});
  EXPECT_EQ(soonest["objective"], "soonest");
  EXPECT_GE(number(soonest, "peak_power_most_W"), number(soonest, "peak_power_W"));
  const Json energy = planned({"--json", "--least-energy"});
  EXPECT_EQ(energy["objective"], "least_energy");
  EXPECT_LE(number(energy, "energy_J"), number(soonest, "energy_J") * (1 + 1e-9));
  const Json peak = planned({"--json", "--least-peak"});
  EXPECT_LT(number(peak, "peak_power_most_W"), number(soonest, "peak_power_most_W"));
  const Json even = planned({"--json", "--even-power", "--within-s", "60"});
  EXPECT_GT(number(even, "flatness"), number(soonest, "flatness"));
  EXPECT_LE(number(even, "makespan_s"), 60);
  EXPECT_EQ(Plan(targets, {"--even-power", "--least-peak"}).exit, 2);
}

TEST_F(OfflineCommands, PlanSaysWhichTimeIsFeasible) {
  const std::string targets = scratch_ / "t.csv";
  ASSERT_EQ(Draw({"--seed", "2", "--from", state_, "--out", targets}).exit, 0);
  const auto soon = Plan(targets, {"--even-power", "--within-s", "0.5"});
  EXPECT_EQ(soon.exit, 1);
  EXPECT_THAT(soon.err, HasSubstr("no plan within 0.50 s was found: the soonest one takes "));
  const auto alone = Plan(targets, {"--within-s", "60"});
  EXPECT_EQ(alone.exit, 1);
  EXPECT_THAT(alone.err, HasSubstr("--within-s goes with --least-energy"));
  EXPECT_THAT(scratch_.List(), Not(Contains("plan.csv")));
}

TEST_F(OfflineCommands, PlanBySectorsServesAll) {
  const std::string targets = scratch_ / "t.csv";
  ASSERT_EQ(Draw({"--seed", "2", "--from", state_, "--out", targets}).exit, 0);
  const auto result = Plan(targets, {"--sectors", "3", "--json"});
  ASSERT_EQ(result.exit, 0) << result.err;
  const Json reported = Json::parse(result.out, nullptr, false);
  EXPECT_EQ(reported["served"], 37);
  EXPECT_EQ(reported["sectors"], 3);
  const auto refused = Plan(targets, {"--sectors", "38"});
  EXPECT_EQ(refused.exit, 1);
  EXPECT_THAT(refused.err, HasSubstr("38 sectors: between 1 and 37 are possible"));
}

TEST_F(OfflineCommands, PlanInStagesSaysWhereToMeasureAndWhatItCosts) {
  const std::string targets = scratch_ / "t.csv";
  ASSERT_EQ(Draw({"--seed", "2", "--from", state_, "--out", targets}).exit, 0);
  const auto result = Plan(targets, {"--stall-tolerant", "--json"});
  ASSERT_EQ(result.exit, 0) << result.err;
  const Json reported = Json::parse(result.out, nullptr, false);
  const Json& stages = reported["guarantee"]["stages_s"];
  ASSERT_GT(stages.size(), 1u);
  EXPECT_EQ(stages[0], 0.0);
  EXPECT_LT(stages.back().get<double>(), reported["makespan_s"].get<double>());
  EXPECT_GT(reported["makespan_s"].get<double>(), reported["bound_s"].get<double>());
  EXPECT_THAT(Plan(targets, {"--stall-tolerant"}).out,
              HasSubstr("measure all units before 0.00, "));
  EXPECT_EQ(Plan(targets, {"--stall-tolerant", "--sectors", "2"}).exit, 1);
}

TEST_F(OfflineCommands, PlanRefusesOneNameForTwoFiles) {
  const std::string targets = scratch_ / "t.csv";
  ASSERT_EQ(Draw({"--seed", "2", "--from", state_, "--out", targets}).exit, 0);
  const auto result = Plan(targets, {"--plot", scratch_ / "plan.csv"});
  EXPECT_EQ(result.exit, 1);
  EXPECT_THAT(result.err, HasSubstr("--out and --plot name one file"));
}

TEST_F(OfflineCommands, PlanWritesAPageToLookAt) {
  const std::string targets = scratch_ / "t.csv";
  ASSERT_EQ(Draw({"--seed", "2", "--from", state_, "--out", targets}).exit, 0);
  const std::string page = scratch_ / "plan.html";
  const auto result = Plan(targets, {"--plot", page, "--json"});
  ASSERT_EQ(result.exit, 0) << result.err << result.out;
  EXPECT_EQ(Json::parse(result.out, nullptr, false)["plot"], page);
  EXPECT_THAT(Slurp(page), HasSubstr("\"units_count\":37"));
  EXPECT_THAT(Slurp(page), HasSubstr("<title>Plan: " + targets));
  EXPECT_THAT(Plan(targets, {"--plot", page}).out, HasSubstr(page + ": to look at"));
  EXPECT_EQ(Json::parse(Plan(targets, {"--json"}).out, nullptr, false)["plot"], nullptr);
}

TEST_F(OfflineCommands, PlanWritesNothingWhereItsPageCannotBe) {
  const std::string targets = scratch_ / "t.csv";
  ASSERT_EQ(Draw({"--seed", "2", "--from", state_, "--out", targets}).exit, 0);
  const auto result = Plan(targets, {"--plot", scratch_ / "none/plan.html"});
  EXPECT_EQ(result.exit, 1);
  EXPECT_THAT(result.err, HasSubstr("none/plan.html: cannot be written"));
  EXPECT_EQ(Plan(targets, {"--plot", "-"}).exit, 2) << "stdout has the plan or its summary";
  EXPECT_THAT(scratch_.List(), ElementsAre("state.csv", "t.csv", "units.csv"));
}

TEST_F(OfflineCommands, PlanNamesADisabledTargetAndEndsWithThree) {
  units_ = scratch_.Put("units.csv", WithUnitOneDisabled(Slurp(units_)));
  ASSERT_EQ(Draw({"--seed", "1", "--as", "state", "--out", state_}).exit, 0);
  const auto result =
      Plan(scratch_.Put("t.csv", "unit_id,theta_deg,phi_deg\n1,0,180\n"), {"--json"});
  EXPECT_EQ(result.exit, 3) << result.err;
  const Json reported = Json::parse(result.out, nullptr, false);
  EXPECT_EQ(reported["unserved"],
            Json::parse(R"([{"unit_id":1,"why":"disabled","by":null,"proof":null}])"));
  const auto quiet = Plan(scratch_ / "t.csv", {"-q"});
  EXPECT_EQ(quiet.exit, 3);
  EXPECT_THAT(quiet.out, IsEmpty());
  EXPECT_THAT(quiet.err, HasSubstr("unit 1: disabled"));
  EXPECT_EQ(reported["served"], 0);
  EXPECT_THAT(scratch_.List(), Contains("plan.csv"));
}

TEST_F(OfflineCommands, PlanRefusesBadTargetsWithFileRowAndReason) {
  ExpectRefused("unit_id,x_mm,y_mm\n1,1,1\n4711,1,1\n", "bad.csv:3: unit 4711: unknown unit");
  ExpectRefused("unit_id,x_mm,y_mm\n1,1,1\n2,-13,-22\n1,2,2\n", "bad.csv:4: ");
  ExpectRefused("unit_id,x_mm,y_mm\n1,nan,1\n", "bad.csv:2: ");
  ExpectRefused("unit_id,x_mm,y_mm\n1,inf,1\n", "bad.csv:2: ");
  ExpectRefused("unit_id,x_mm,y_mm\n1,16.6,0\n", "bad.csv:2: unit 1: ");
  ExpectRefused("unit_id,theta_deg,phi_deg\n1,0,181\n", "bad.csv:2: unit 1: phi_deg");
  ExpectRefused("unit_id,x_mm,y_mm\n1,-6.4,-11.08\n2,-6.4,-11.0\n",
                "bad.csv:3: unit 2: its target collides with that of unit 1 in line 2");
  ExpectRefused("unit_id,x_mm,y_mm\n1,1,1\n2,-1", "bad.csv:3: ");
  ExpectRefused("unit_id,x_mm,y_mm\n1,1,1\n2,-13\n", "bad.csv:3: ");
  ExpectRefused(std::string("\x89PNG\r\n\x1a\n\0\0", 10), "bad.csv:1: not a text file: byte 0x89");
  ExpectRefused("unit_id,x_um,y_um\n1,1,1\n", "x_mm");
  ExpectRefused("", "bad.csv");
  ExpectRefused("unit_id,x_mm,y_mm\n", "bad.csv");
}

TEST_F(OfflineCommands, PlanRefusesBadStatesAndUnitsWithFileRowAndReason) {
  const std::string targets = scratch_.Put("t.csv", "unit_id,x_mm,y_mm\n1,1,1\n");
  const std::string bad = scratch_.Put("bad.csv", "unit_id,theta_deg,phi_deg\n1,0,180\n99,0,180\n");
  auto result =
      Focalfleet({"plan", "--units", units_, "--targets", targets, "--from", bad, "--out", plan_});
  EXPECT_EQ(result.exit, 1);
  EXPECT_THAT(result.err, HasSubstr("bad.csv:3: "));
  result =
      Focalfleet({"plan", "--units", bad, "--targets", targets, "--from", state_, "--out", plan_});
  EXPECT_EQ(result.exit, 1);
  EXPECT_THAT(result.err, HasSubstr("bad.csv"));
  result = Focalfleet({"plan", "--units", scratch_ / "none.csv", "--targets", targets, "--from",
                       state_, "--out", plan_});
  EXPECT_EQ(result.exit, 1);
  EXPECT_THAT(result.err, HasSubstr("none.csv: cannot be read: No such file"));
  EXPECT_THAT(scratch_.List(), Not(Contains("plan.csv")));
}

TEST_F(OfflineCommands, ARefusedPlanLeavesTheOldFileAsItWas) {
  const std::string old = scratch_.Put("plan.csv", "old\n");
  EXPECT_EQ(Plan(scratch_.Put("bad.csv", "unit_id\n")).exit, 1);
  EXPECT_EQ(Slurp(old), "old\n");
}

TEST_F(OfflineCommands, AFullDiskAndAMissingFolderAreReportedAndLeaveNothing) {
  const std::string targets = scratch_.Put("t.csv", "unit_id,x_mm,y_mm\n1,1,1\n");
  plan_ = "/dev/full";
  const auto full = Plan(targets, {"--json"});
  EXPECT_EQ(full.exit, 1);
  EXPECT_EQ(Json::parse(full.out, nullptr, false)["error"]["code"], "full");
  EXPECT_THAT(full.err, HasSubstr("/dev/full: cannot be written: No space left"));
  plan_ = scratch_ / "no/such/plan.csv";
  const auto missing = Plan(targets);
  EXPECT_EQ(missing.exit, 1);
  EXPECT_THAT(missing.err, HasSubstr("no/such/plan.csv: cannot be written: No such file"));
  EXPECT_THAT(scratch_.List(), ElementsAre("state.csv", "t.csv", "units.csv"));
}

TEST_F(OfflineCommands, ObstaclesStandInTheWay) {
  const std::string obstacles =
      scratch_.Put("o.csv", "obstacle_id,x_mm,y_mm,radius_mm\n1,10,0,1.5\n");
  const auto result = Plan(scratch_.Put("t.csv", "unit_id,x_mm,y_mm\n1,10,0\n"),
                           {"--obstacles", obstacles, "--json"});
  EXPECT_NE(result.exit, 0) << result.out;
  EXPECT_EQ(Draw({"--seed", "3", "--obstacles", obstacles, "--out", scratch_ / "d.csv"}).exit, 0);
}

TEST_F(OfflineCommands, OutDashIsStdoutAndWhatIsSaidBesideGoesToStderr) {
  const auto to_file = Draw({"--seed", "5", "--out", scratch_ / "t.csv"});
  const auto to_stdout = Draw({"--seed", "5", "--out", "-"});
  EXPECT_EQ(to_stdout.exit, 0);
  EXPECT_EQ(to_stdout.out, Slurp(scratch_ / "t.csv"));
  EXPECT_THAT(to_stdout.err, HasSubstr("-: targets of 37 units"));
  plan_ = "-";
  EXPECT_THAT(Plan(scratch_ / "t.csv").out, ::testing::StartsWith("unit_id,axis,"));
  EXPECT_EQ(Plan(scratch_ / "t.csv", {"--json"}).exit, 2);
  EXPECT_EQ(
      test::FocalfleetInto(">/dev/full", {"layout", "hex", "--count", "1", "--out", "-"}).exit, 1);
  EXPECT_NE(access("-", F_OK), 0);
}

TEST_F(OfflineCommands, ReadsPipesThatHaveAWriterAndRefusesNamedOnes) {
  const std::string targets = scratch_.Put("t.csv", "unit_id,x_mm,y_mm\n1,1,1\n");
  const auto shell = [&](const std::string& command) {
    return test::RunProgram(
        {"bash", "-c", command, FOCALFLEET_PROGRAM, units_, state_, plan_, targets});
  };
  const std::string plan = "\"$0\" plan --units \"$1\" --from \"$2\" --out \"$3\" --targets ";
  EXPECT_EQ(shell("cat \"$4\" | " + plan + "/dev/stdin").exit, 0);
  EXPECT_EQ(shell(plan + "/dev/stdin <\"$4\"").exit, 0);
  EXPECT_EQ(shell(plan + "<(cat \"$4\")").exit, 0);
  const std::string pipe = scratch_ / "pipe";
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  const auto named = Plan(pipe);
  EXPECT_EQ(named.exit, 1);
  EXPECT_THAT(named.err, HasSubstr("pipe: a named pipe; give a file, or /dev/stdin"));
}

TEST_F(OfflineCommands, AMisspeltColumnOfUnitsIsReported) {
  std::string text = Slurp(units_);
  text.replace(text.find("enabled"), 7, "enabld");
  const auto result = Focalfleet({"targets", "--units", scratch_.Put("u.csv", text), "--seed", "1",
                                  "--out", scratch_ / "t.csv"});
  EXPECT_THAT(result.err, HasSubstr("enabld"));
}

TEST_F(OfflineCommands, PlanTellsColumnsOfTargetsThatNobodyReads) {
  const std::string file =
      scratch_.Put("p.csv", "unit_id,theta_deg,phi_deg,prioritty\n1,10,150,3\n");
  EXPECT_THAT(Plan(file).err, HasSubstr("p.csv: columns passed over: prioritty"));
}

}  // namespace
}  // namespace focalfleet
