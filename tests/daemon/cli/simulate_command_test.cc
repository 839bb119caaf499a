// simulate drive as a process: its files and its refusals. A stall is reported and is no error.
#include <gmock/gmock.h>

#include <cmath>

#include "daemon/control/messages.h"
#include "fleet/files/csv.h"
#include "tests/daemon/cli/program.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using test::Focalfleet;
using test::ProgramResult;
using test::ScratchFolder;
using test::Slurp;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class SimulateDrive : public ::testing::Test {
 protected:
  ProgramResult Simulate(std::vector<std::string> more) {
    std::vector<std::string> words = {"simulate", "drive", "--out", out_};
    words.insert(words.end(), more.begin(), more.end());
    return Focalfleet(words);
  }
  Json Reported(std::vector<std::string> more) {
    more.emplace_back("--json");
    const ProgramResult result = Simulate(std::move(more));
    EXPECT_EQ(result.exit, 0) << result.err;
    return Json::parse(result.out, nullptr, false);
  }
  [[nodiscard]] Json Summary() const {
    return Json::parse(Slurp(out_ + "/summary.json"), nullptr, false);
  }

  ScratchFolder scratch_;
  std::string out_ = scratch_ / "wave";
};

const std::vector<std::string> kBench = {"--v-bus",  "9",         "--counter1",    "500",
                                         "--repeat", "8",         "--subdivision", "96",
                                         "--mode",   "asymmetric"};

// The wave's figures are computed from the table alone.
TEST_F(SimulateDrive, TheTableTellsTheSameAsTheSummary) {
  const ProgramResult result = Simulate(kBench);
  ASSERT_EQ(result.exit, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("in step"));
  const auto table = CsvTable::Parse(Slurp(out_ + "/wave.csv"), "wave.csv");
  ASSERT_TRUE(table) << table.error().text;
  EXPECT_THAT(table->columns(), ElementsAre("t_s", "ia_A", "ib_A", "ic_A", "va_V", "vb_V", "vc_V",
                                            "torque_Nm", "theta_rad"));
  double square = 0;
  double supply_W = 0;
  double torque = 0;
  for (std::size_t k = 0; k < table->size(); ++k) {
    CsvRow row(*table, k);
    for (const std::string leg : {"a", "b", "c"}) {
      const double current = row.Number("i" + leg + "_A");
      square += current * current / 3;
      supply_W += current * row.Number("v" + leg + "_V");
    }
    torque += row.Number("torque_Nm");
  }
  const Json summary = Summary();
  const auto rows = static_cast<double>(table->size());
  EXPECT_EQ(summary["samples"], table->size());
  EXPECT_NEAR(std::sqrt(square / rows) / summary["rms_A"].get<double>(), 1, 1e-3);
  // The star floats, so the sum of v i is the power that the motor takes.
  const Json& power = summary["power_W"];
  EXPECT_NEAR(supply_W / rows / (power["supply"].get<double>() - power["switching"].get<double>()),
              1, 1e-2);
  EXPECT_NEAR(torque / rows / summary["torque_mean_Nm"].get<double>(), 1, 1e-2);
  EXPECT_EQ(summary["in_step"], true);
  EXPECT_NEAR(summary["speed_rpm"].get<double>(), 22500, 30);
  EXPECT_LT(std::abs(summary["energy_balance"].get<double>()), 1e-6);
  EXPECT_EQ(summary["settings"]["subdivision"], 96);
}

TEST_F(SimulateDrive, TheReportShowsThePapersPictures) {
  ASSERT_EQ(Simulate(kBench).exit, 0);
  const std::string page = Slurp(out_ + "/report.html");
  for (const char* title : {"Phase current", "Terminal voltage a", "Spectrum of the phase current",
                            "How often which current flows", "About the highest current",
                            "Peak of each carrier period", "Torque", "Lag", "V/(√3 r)", "2V/(3r)"})
    EXPECT_THAT(page, HasSubstr(title));
}

TEST_F(SimulateDrive, TheSameTwiceIsTheSameBytes) {
  const Json first = Reported(kBench);
  const std::string wave = Slurp(out_ + "/wave.csv");
  const std::string page = Slurp(out_ + "/report.html");
  EXPECT_EQ(Reported(kBench), first);
  EXPECT_EQ(Slurp(out_ + "/wave.csv"), wave);
  EXPECT_EQ(Slurp(out_ + "/report.html"), page);
}

TEST_F(SimulateDrive, AStallIsSaidAndIsNoError) {
  const ProgramResult result = Simulate({"--repeat", "30", "--load", "fleet", "--from-rest"});
  EXPECT_EQ(result.exit, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("stalled: the rotor does not follow the field from rest"));
  EXPECT_EQ(Summary()["in_step"], false);
  EXPECT_TRUE(Summary()["lag_deg"].is_null());
  EXPECT_TRUE(Summary()["torque_ripple"]["rms"].is_null());
  // The load is more than the motor holds at any lag.
  EXPECT_THAT(Simulate({"--repeat", "37", "--load", "60"}).out, HasSubstr("stalled: at no lag"));
  EXPECT_EQ(Summary()["in_step"], false);
}

TEST_F(SimulateDrive, RotationThatWouldNotStartIsSaid) {
  const ProgramResult result = Simulate({"--repeat", "34", "--load", "fleet"});
  EXPECT_EQ(result.exit, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("from rest it would not start"));
  EXPECT_EQ(Summary()["in_step"], true);
  EXPECT_EQ(Summary()["starts_from_rest"], false);
}

TEST_F(SimulateDrive, FromRestTheRotorStartsAtRest) {
  const Json reported =
      Reported({"--repeat", "60", "--load", "fleet", "--from-rest", "--turns", "1"});
  EXPECT_EQ(reported["in_step"], true);
  const auto table = CsvTable::Parse(Slurp(out_ + "/wave.csv"), "wave.csv");
  ASSERT_TRUE(table);
  CsvRow row(*table, 0);
  EXPECT_EQ(row.Number("ia_A"), 0);
  EXPECT_LT(row.Number("theta_rad"), -0.1);
}

TEST_F(SimulateDrive, SettingsReachTheMotor) {
  const Json reported =
      Reported({"--repeat", "8", "--v-bus", "9", "--set", "C", "--resistance-ohm", "20",
                "--dead-time-ns", "0", "--turns", "1", "--sample-ns", "100"});
  EXPECT_EQ(reported["settings"]["resistance_ohm"], 20);
  EXPECT_NEAR(reported["limit_reachable_A"].get<double>(), 2 * 9 / (3 * 20.0), 1e-12);
  EXPECT_NEAR(reported["limit_linear_A"].get<double>(), 9 / std::sqrt(3) / 20, 1e-12);
  EXPECT_EQ(reported["samples"], 26667);
  EXPECT_LT(reported["peak_A"].get<double>(), 0.3);
}

TEST_F(SimulateDrive, ImpossibleSettingsAreRefusedWithTheReason) {
  struct Bad {
    std::vector<std::string> words;
    int exit;
    const char* complaint;
  };
  for (const Bad& bad : {
           Bad{{"--counter1", "0"}, 2, "--counter1"},
           Bad{{"--repeat", "0"}, 2, "--repeat"},
           Bad{{"--repeat", "256"}, 2, "--repeat"},
           Bad{{"--subdivision", "95"}, 2, "95 is not a multiple of 6"},
           Bad{{"--subdivision", "0"}, 2, "0 is not a multiple of 6"},
           Bad{{"--v-bus", "0"}, 2, "--v-bus"},
           Bad{{"--v-bus", "-9"}, 2, "--v-bus"},
           Bad{{"--v-bus", "nan"}, 2, "--v-bus"},
           Bad{{"--v-bus", "24"}, 2, "up to 12 V, which the bridge bears"},
           Bad{{"--mode", "nine-segment"}, 2, "--mode"},
           Bad{{"--set", "X"}, 2, "--set"},
           Bad{{"--turns", "0"}, 2, "--turns"},
           Bad{{"--resistance-ohm", "0"}, 2, "--resistance-ohm"},
           Bad{{"--dead-time-ns", "3473"}, 1, "as long as the carrier period"},
           Bad{{"--counter1", "7"}, 1, "--dead-time-ns 50"},
           Bad{{"--load", "heavy"}, 1, "--load heavy"},
           Bad{{"--load", "-1"}, 1, "--load -1"},
           Bad{{"--ramp-stages", "2"}, 1, "--from-rest"},
           Bad{{"--sample-ns", "2000"}, 1, "needs four samples"},
           Bad{{"--turns", "100"}, 1, "fewer --turns"},
       }) {
    const ProgramResult result = Simulate(bad.words);
    EXPECT_EQ(result.exit, bad.exit) << bad.words[0] << " " << bad.words[1];
    EXPECT_THAT(result.err, HasSubstr(bad.complaint));
    EXPECT_THAT(result.out, IsEmpty());
  }
  EXPECT_THAT(scratch_.List(), IsEmpty());
}

TEST_F(SimulateDrive, ADirectoryThatCannotBeMadeIsAReason) {
  out_ = scratch_.Put("file", "") + "/in";
  const ProgramResult result = Simulate({"--repeat", "8", "--v-bus", "9", "--turns", "1"});
  EXPECT_EQ(result.exit, 1);
  EXPECT_THAT(result.err, HasSubstr("file/in: no such directory can be made"));
}

}  // namespace
}  // namespace focalfleet
