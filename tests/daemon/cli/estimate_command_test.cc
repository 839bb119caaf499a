// estimate as a process: its figures are those of the plan, and its curves add up. Bad input is
// named, and then nothing is written.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <map>

#include "daemon/control/messages.h"
#include "daemon/store/store.h"
#include "fleet/files/csv.h"
#include "fleet/files/layout_file.h"
#include "tests/daemon/cli/program.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using test::Focalfleet;
using test::ProgramResult;
using test::ScratchFolder;
using test::Slurp;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

class EstimateCommand : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_EQ(
        Focalfleet({"layout", "hex", "--count", "37", "--units-per-rail", "20", "--out", units_})
            .exit,
        0);
    ASSERT_EQ(Draw({"--seed", "1", "--as", "state", "--out", state_}).exit, 0);
    ASSERT_EQ(Draw({"--seed", "2", "--from", state_, "--out", targets_}).exit, 0);
  }

  ProgramResult Draw(std::vector<std::string> more) {
    std::vector<std::string> words = {"targets", "--units", units_};
    words.insert(words.end(), more.begin(), more.end());
    return Focalfleet(words);
  }
  ProgramResult Estimate(std::vector<std::string> more = {}) {
    std::vector<std::string> words = {"estimate", "--units", units_, "--targets", targets_};
    words.insert(words.end(), more.begin(), more.end());
    return Focalfleet(words);
  }
  Json EstimateJson(std::vector<std::string> more = {}) {
    more.emplace_back("--json");
    const ProgramResult result = Estimate(more);
    EXPECT_EQ(result.exit, 0) << result.err;
    EXPECT_THAT(result.err, IsEmpty());
    return Json::parse(result.out, nullptr, false);
  }
  void ExpectRefused(std::vector<std::string> more, int exit, const std::string& complaint) {
    more.insert(more.end(), {"--out", scratch_ / "curve.csv"});
    const ProgramResult result = Estimate(more);
    EXPECT_EQ(result.exit, exit) << result.err;
    EXPECT_THAT(result.out, IsEmpty());
    EXPECT_THAT(result.err, HasSubstr(complaint));
    EXPECT_THAT(scratch_.List(), Not(Contains("curve.csv")));
  }

  ScratchFolder scratch_;
  std::string units_ = scratch_ / "units.csv";
  std::string state_ = scratch_ / "state.csv";
  std::string targets_ = scratch_ / "targets.csv";
};

double Of(const Json& band, const char* key = "value") { return band[key].get<double>(); }

void ExpectBand(const Json& band) {
  EXPECT_GT(Of(band, "low"), 0) << band;
  EXPECT_LT(Of(band, "low"), Of(band)) << band;
  EXPECT_LT(Of(band), Of(band, "high")) << band;
}

TEST_F(EstimateCommand, AllModesStandSideBySideWithLimits) {
  const Json reported = EstimateJson({"--from", state_});
  EXPECT_EQ(reported["units"], 37);
  EXPECT_EQ(reported["served"], 37);
  ExpectBand(reported["makespan_s"]);
  ASSERT_EQ(reported["modes"].size(), 3u);
  EXPECT_EQ(reported["modes"][0]["mode"], "asymmetric");
  EXPECT_EQ(reported["modes"][1]["mode"], "five_segment");
  EXPECT_EQ(reported["modes"][2]["mode"], "seven_segment");
  for (const Json& mode : reported["modes"]) {
    EXPECT_EQ(mode["stalls"], false);
    ASSERT_EQ(mode["rails"].size(), 2u);
    double rails_J = 0;
    for (const Json& rail : mode["rails"]) {
      for (const char* key : {"energy_J", "mean_power_W", "peak_power_W"}) ExpectBand(rail[key]);
      rails_J += Of(rail["energy_J"]);
    }
    for (const char* key : {"energy_J", "mean_power_W", "peak_power_W"}) ExpectBand(mode[key]);
    EXPECT_NEAR(rails_J / Of(mode["energy_J"]), 1, 1e-6);
    EXPECT_NEAR(Of(mode["mean_power_W"]) * Of(reported["makespan_s"]) / Of(mode["energy_J"]), 1,
                1e-9);
  }
}

TEST_F(EstimateCommand, AgreesWithThePlanThatWouldBeSent) {
  const Json estimate = EstimateJson({"--from", state_, "--mode", "asymmetric"});
  ASSERT_EQ(estimate["modes"].size(), 1u);
  const auto plan = Focalfleet({"plan", "--units", units_, "--targets", targets_, "--from", state_,
                                "--out", scratch_ / "plan.csv", "--json"});
  ASSERT_EQ(plan.exit, 0) << plan.err;
  const Json planned = Json::parse(plan.out, nullptr, false);
  EXPECT_EQ(Of(estimate["makespan_s"]), planned["makespan_s"].get<double>());
  const Json& mode = estimate["modes"][0];
  EXPECT_NEAR(Of(mode["energy_J"]), planned["energy_J"].get<double>(), 1e-5);
  EXPECT_EQ(Of(mode["peak_power_W"]), planned["peak_power_W"].get<double>());
}

TEST_F(EstimateCommand, TheCurveHoldsTheEnergyOfEachRailAndMode) {
  const std::string out = scratch_ / "curve.csv";
  const Json reported = EstimateJson({"--from", state_, "--out", out});
  EXPECT_EQ(reported["out"], out);
  const auto table = CsvTable::Parse(Slurp(out), out);
  ASSERT_TRUE(table) << table.error().text;
  ASSERT_TRUE(table->Require({"t_s", "rail", "power_W", "mode"}));
  std::map<std::pair<std::string, std::string>, double> energy_J;
  std::map<std::pair<std::string, std::string>, std::pair<double, double>> last;
  for (std::size_t k = 0; k < table->size(); ++k) {
    CsvRow row(*table, k);
    const std::pair key{row.Text("mode"), row.Text("rail")};
    const double t_s = row.Number("t_s");
    auto& [before_s, power_W] = last[key];
    energy_J[key] += power_W * (t_s - before_s);
    EXPECT_GE(t_s, before_s);
    before_s = t_s;
    power_W = row.Number("power_W");
    ASSERT_FALSE(row.error());
  }
  EXPECT_EQ(energy_J.size(), 9u);
  for (const auto& [key, at] : last) EXPECT_EQ(at.second, 0) << key.first << " " << key.second;
  for (const Json& mode : reported["modes"]) {
    const auto name = mode["mode"].get<std::string>();
    EXPECT_NEAR((energy_J[{name, "total"}]), Of(mode["energy_J"]), 1e-6);
    for (const Json& rail : mode["rails"]) {
      const std::string id = std::to_string(rail["rail_id"].get<int>());
      EXPECT_NEAR((energy_J[{name, id}]), Of(rail["energy_J"]), 1e-6);
    }
  }
}

TEST_F(EstimateCommand, StartsWithAllArmsFoldedWhereNoStateIsGiven) {
  const Json reported = EstimateJson();
  EXPECT_EQ(reported["served"], 37);
  EXPECT_NE(Of(reported["makespan_s"]), Of(EstimateJson({"--from", state_})["makespan_s"]));
}

TEST_F(EstimateCommand, TakesVoltageAndTimerCounts) {
  const Json slow = EstimateJson();
  const Json fast = EstimateJson({"--v-bus", "9", "--repeat", "54"});
  EXPECT_NEAR(Of(fast["makespan_s"]) / Of(slow["makespan_s"]), 0.5, 0.05);
  EXPECT_GT(Of(fast["modes"][0]["peak_power_W"]), 10 * Of(slow["modes"][0]["peak_power_W"]));
  const Json same_speed = EstimateJson({"--counter1", "1000", "--repeat", "54"});
  EXPECT_NEAR(Of(same_speed["makespan_s"]), Of(slow["makespan_s"]), 1e-3);
  const Json coarse = EstimateJson({"--subdivision", "48", "--repeat", "216"});
  EXPECT_NEAR(Of(coarse["makespan_s"]) / Of(slow["makespan_s"]), 1, 0.05);
  EXPECT_EQ(coarse["subdivision"], 48);
}

/// Returns a model of unit 1 alone. Its theta goes farther than commanded by this share, counted
/// from theta 0.
std::string GearsOf(double gear_scale) {
  return fmt::format(
      "name = \"night-extended\"\n"
      "[[unit]]\nunit_id = 1\nbase_x_mm = 0\nbase_y_mm = 0\narm_theta_mm = 8.25\n"
      "arm_phi_mm = 8.25\ntheta_zero_deg = 0\nphi_zero_deg = 0\n"
      "left_theta_deg = 0\nleft_phi_deg = 150\nadded_theta_deg = 0\nadded_phi_deg = 0\n"
      "[[effect]]\ncause = \"gear_scale\"\naxis = \"theta\"\nform = 0\nshape = 0\nmemory = 2\n"
      "columns = 1\nunits = [1]\namplitude = [{}]\nsigma = [1e-4]\n"
      "[[effect]]\ncause = \"start_skew\"\naxis = \"theta\"\nform = 0\nshape = 0\nmemory = 0\n"
      "columns = 1\nunits = [1]\namplitude = [0.01]\nsigma = [1e-4]\n",
      gear_scale);
}

/// Returns a state in which all 37 units are at these angles.
std::string StateOf(double theta_deg, double phi_deg) {
  std::string text = "unit_id,theta_deg,phi_deg\n";
  for (int unit = 1; unit <= 37; ++unit)
    text += fmt::format("{},{},{}\n", unit, theta_deg, phi_deg);
  return text;
}

TEST_F(EstimateCommand, TellsWhatTheCommandsOfAModelTake) {
  const std::string model = scratch_.Put("model.toml", GearsOf(0.01));
  const std::string from = scratch_.Put("s.csv", StateOf(0, 150));
  targets_ = scratch_.Put("t.csv", "unit_id,theta_deg,phi_deg\n1,-100,150\n");
  const Json nominal = EstimateJson({"--from", from});
  const Json reported = EstimateJson({"--from", from, "--model", model});
  EXPECT_TRUE(nominal["model"].is_null());
  EXPECT_EQ(reported["served"], 1);
  EXPECT_EQ(reported["model"]["name"], "night-extended");
  EXPECT_EQ(reported["model"]["compensated"], 1);
  EXPECT_EQ(reported["model"]["left_out"], Json::array({"start_skew"}));
  // Time grows with the distance that is counted. Energy does, too, because the motor turns at the
  // same speed.
  EXPECT_NEAR(Of(nominal["makespan_s"]) / Of(reported["makespan_s"]), 1.01, 2e-4);
  EXPECT_NEAR(Of(nominal["modes"][0]["energy_J"]) / Of(reported["modes"][0]["energy_J"]), 1.01,
              2e-4);
  // A unit that the campaign did not measure receives its target unchanged.
  targets_ = scratch_.Put("t.csv", "unit_id,theta_deg,phi_deg\n2,-100,150\n");
  EXPECT_EQ(Of(EstimateJson({"--from", from, "--model", model})["makespan_s"]),
            Of(EstimateJson({"--from", from})["makespan_s"]));
}

TEST_F(EstimateCommand, NamesUnitsThatTheModelWouldSendBeyondTheirRange) {
  const std::string model = scratch_.Put("model.toml", GearsOf(-0.01));
  const std::string from = scratch_.Put("s.csv", StateOf(150, 150));
  targets_ = scratch_.Put("t.csv", "unit_id,theta_deg,phi_deg\n1,189.5,150\n2,100,150\n");
  EXPECT_EQ(EstimateJson({"--from", from})["served"], 2);
  const auto result = Estimate({"--from", from, "--model", model, "--json"});
  EXPECT_EQ(result.exit, 3) << result.err << result.out;
  const Json reported = Json::parse(result.out, nullptr, false);
  EXPECT_EQ(reported["served"], 1);
  EXPECT_EQ(reported["model"]["compensated"], 0);
  EXPECT_EQ(reported["model"]["beyond_range"], Json::array({1}));
  const std::string text = Estimate({"--from", from, "--model", model}).out;
  EXPECT_THAT(text, HasSubstr("night-extended: 0 of 2 targets compensated; not compensated: "
                              "start_skew"));
  EXPECT_THAT(text, HasSubstr("unit 1: by the model its range ends before the target"));
}

// Units 1 and 5 are neighbours along x, and each is stretched towards the other.
TEST_F(EstimateCommand, SaysWhichArmsMayTouchByAModel) {
  const std::string model = scratch_.Put("model.toml", GearsOf(0.01));
  std::string state = StateOf(90, 180);
  state.replace(state.find("\n1,90,180"), 9, "\n1,0,10");
  state.replace(state.find("\n5,90,180"), 9, "\n5,180,10");
  const std::string from = scratch_.Put("s.csv", state);
  targets_ = scratch_.Put("t.csv", "unit_id,theta_deg,phi_deg\n1,60,150\n5,100,150\n");
  ExpectRefused({"--from", from}, 1, "the starts of units 1 and 5 are 1.5804 mm apart");
  const Json reported = Json::parse(Estimate({"--from", from, "--model", model, "--json"}).out);
  EXPECT_THAT(reported["model"]["too_near"].get<std::string>(),
              HasSubstr("the starts of units 1 and 5 are"));
  EXPECT_THAT(Estimate({"--from", from, "--model", model}).out,
              HasSubstr("they may touch, and are led apart"));
}

TEST_F(EstimateCommand, RefusesAModelThatIsNoneOfThisFleet) {
  const auto refuse = [&](const std::string& text, const std::string& complaint) {
    ExpectRefused({"--model", scratch_.Put("m.toml", text)}, 1, complaint);
  };
  refuse("[[unit", "m.toml:1");
  std::string far = GearsOf(0.01);
  far.replace(far.find("base_x_mm = 0"), 13, "base_x_mm = 99");
  refuse(far, "m.toml:2: unit 1 has its base more than 10 mm from where it is described");
  std::string unmeasured = GearsOf(0.01);
  unmeasured.replace(unmeasured.find("unit_id = 1"), 11, "unit_id = 4711");
  refuse(unmeasured, "it says of no unit of this fleet where its campaign left it");
  ExpectRefused({"--model", scratch_ / "none.toml"}, 1, "none.toml: cannot be read");
}

TEST_F(EstimateCommand, TellsPeopleATableForEachMode) {
  const auto result = Estimate({"--from", state_});
  EXPECT_EQ(result.exit, 0);
  for (const char* text : {"37 of 37 targets served", "makespan ", "asymmetric", "five-segment",
                           "seven-segment", "rail 1", "peak power, W", "load +-20 %"}) {
    EXPECT_THAT(result.out, HasSubstr(text));
  }
  EXPECT_THAT(Estimate({"--quiet"}).out, IsEmpty());
}

TEST_F(EstimateCommand, RefusesANBelowTheCriticalOne) {
  ExpectRefused({"--repeat", "23"}, 1,
                "no axis would start from rest: n 23 is below the critical n 38");
  ExpectRefused({"--repeat", "37"}, 1, "critical n 38");
  EXPECT_EQ(Estimate({"--repeat", "38"}).exit, 0);
  // With the stronger field less time is enough.
  EXPECT_EQ(Estimate({"--repeat", "23", "--v-bus", "3.5"}).exit, 0);
}

TEST_F(EstimateCommand, NamesTheAxesThatWouldNotStartByWhatTheStoreKnows) {
  const std::string path = scratch_ / "fleet.db";
  {
    auto store = Store::Open(path);
    ASSERT_TRUE(store) << store.error().text;
    TuningRow heavy{.serial = {7001},
                    .axis = Axis::kTheta,
                    .critical = 120,
                    .repeat = 150,
                    .margin = 0.1,
                    .load_uNm = 5.6,
                    .v_bus_V = 1.8,
                    .counter1 = 500,
                    .subdivision = 96};
    TuningRow light = heavy;
    light.axis = Axis::kPhi;
    light.critical = 20;
    light.load_uNm = 2;
    const std::vector<Row> rows = {
        BindingRow{UnitId{1}, {7001}}, heavy, light,
        ParameterRow{{7001}, Axis::kTheta, Parameter::kRepeat, 54, Origin::kOperator},
        ParameterRow{{7001}, Axis::kPhi, Parameter::kRepeat, 30, Origin::kTuning}};
    ASSERT_TRUE((*store)->Commit(rows, WallTime{1}));
  }
  const Json reported = EstimateJson({"--store", path, "--mode", "asymmetric"});
  const Json& below = reported["modes"][0]["below_critical"];
  ASSERT_EQ(below.size(), 1u) << below.dump();
  EXPECT_EQ(below[0]["unit_id"], 1);
  EXPECT_EQ(below[0]["axis"], "theta");
  EXPECT_EQ(below[0]["repeat"], 54);
  EXPECT_EQ(below[0]["critical"], 120);
  const auto text = Estimate({"--store", path, "--mode", "asymmetric"});
  EXPECT_EQ(text.exit, 0);
  EXPECT_THAT(text.out, HasSubstr("axes that move would stall"));
  EXPECT_THAT(text.out, HasSubstr("unit 1 theta: n 54, critical 120"));
  // At another voltage the load decides, not the n that was found at 1.8 V.
  EXPECT_TRUE(EstimateJson({"--store", path, "--mode", "asymmetric", "--v-bus",
                            "4"})["modes"][0]["below_critical"]
                  .empty());
  EXPECT_TRUE(EstimateJson({"--mode", "asymmetric"})["modes"][0]["below_critical"].empty());
  // Only one axis is light enough to start. The figures are still reported, with the axes that
  // stall and how near the others are to losing step.
  const auto fast = Estimate({"--store", path, "--mode", "asymmetric", "--repeat", "23"});
  EXPECT_EQ(fast.exit, 0) << fast.err;
  EXPECT_THAT(fast.out, HasSubstr("no margin"));
  EXPECT_THAT(fast.out, HasSubstr("more"));
}

TEST_F(EstimateCommand, RefusesWhatTheMotorCannotPull) {
  ExpectRefused({"--repeat", "10"}, 1,
                "1.8 V, 500 counts x 10, 96 vectors a turn: the motor "
                "cannot pull its load");
  ExpectRefused({"--v-bus", "0.2", "--mode", "asymmetric"}, 1, "cannot pull its load");
}

TEST_F(EstimateCommand, ImpossibleSettingsAreWrongUsage) {
  for (const char* v : {"0", "-1.8", "12.5", "nan", "inf", "lots"}) {
    ExpectRefused({"--v-bus", v}, 2, "--v-bus");
  }
  for (const char* n : {"0", "-1", "256", "1.5", "nan"})
    ExpectRefused({"--repeat", n}, 2, "--repeat");
  for (const char* c : {"0", "-500", "65536", "x"})
    ExpectRefused({"--counter1", c}, 2, "--counter1");
  for (const char* n : {"0", "1", "-6", "97", "100000", "nan"}) {
    ExpectRefused({"--subdivision", n}, 2, "--subdivision");
  }
  ExpectRefused({"--mode", "six-segment"}, 2, "--mode");
  EXPECT_EQ(Focalfleet({"estimate", "--units", units_}).exit, 2);
}

TEST_F(EstimateCommand, RefusesBadFilesWithFileRowAndReason) {
  targets_ = scratch_.Put("bad.csv", "unit_id,x_mm,y_mm\n1,1,1\n4711,1,1\n");
  ExpectRefused({}, 1, "bad.csv:3: unit 4711: unknown unit");
  targets_ = scratch_ / "none.csv";
  ExpectRefused({}, 1, "none.csv: cannot be read");
  targets_ = scratch_.Put("good.csv", "unit_id,theta_deg,phi_deg\n1,0,150\n");
  ExpectRefused({"--from", scratch_.Put("s.csv", "unit_id,theta_deg\n1,0\n")}, 1, "s.csv");
  const auto full = Estimate({"--out", "/dev/full"});
  EXPECT_EQ(full.exit, 1);
  EXPECT_THAT(full.err, HasSubstr("No space left"));
}

TEST_F(EstimateCommand, NamesUnitsThatAreNotServedAndEndsWithThree) {
  auto file = ReadUnits(Slurp(units_), units_);
  ASSERT_TRUE(file);
  file->units[0].enabled = false;
  units_ = scratch_.Put("units.csv", WriteUnits(file->units));
  targets_ = scratch_.Put("t.csv", "unit_id,theta_deg,phi_deg\n1,0,180\n2,0,150\n");
  EXPECT_THAT(Estimate().out, HasSubstr("unit 1: disabled"));
  const auto result = Estimate({"--json"});
  EXPECT_EQ(result.exit, 3) << result.err << result.out;
  const Json reported = Json::parse(result.out, nullptr, false);
  EXPECT_EQ(reported["unserved"][0]["unit_id"], 1);
}

}  // namespace
}  // namespace focalfleet
