// tune as a process: one motor, a fleet into a table and into the store, and bad input.
#include <gmock/gmock.h>

#include "daemon/control/messages.h"
#include "daemon/store/store.h"
#include "daemon/store/store_reader.h"
#include "fleet/files/csv.h"
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
using ::testing::Not;

// The sets were fitted without dead time and rise time.
const std::vector<std::string> kIdeal = {"--dead-time-ns", "0", "--rise-ns", "0", "--fall-ns", "0"};

class TuneCommand : public ::testing::Test {
 protected:
  static ProgramResult Tune(std::vector<std::string> more) {
    std::vector<std::string> words = {"tune"};
    words.insert(words.end(), kIdeal.begin(), kIdeal.end());
    words.insert(words.end(), more.begin(), more.end());
    return Focalfleet(words);
  }
  void MakeUnits() {
    ASSERT_EQ(Focalfleet({"layout", "hex", "--count", "3", "--out", units_}).exit, 0);
  }

  ScratchFolder scratch_;
  std::string units_ = scratch_ / "units.csv";
  std::string tuned_ = scratch_ / "tuned.csv";
};

TEST_F(TuneCommand, FindsThePapersCriticalRepeat) {
  const ProgramResult result = Tune({"--json"});
  ASSERT_EQ(result.exit, 0) << result.err;
  const Json reported = Json::parse(result.out, nullptr, false);
  EXPECT_EQ(reported["critical"], 37);
  EXPECT_EQ(reported["critical_reduced"], 37);
  EXPECT_GT(reported["repeat"].get<int>(), 50);
  EXPECT_NEAR(reported["margin"].get<double>(), 0.5, 0.02);
  EXPECT_NEAR(reported["margin_at_108"].get<double>(), 0.88, 0.03);
}

TEST_F(TuneCommand, RefusesWhatThePeakCheckForbids) {
  const ProgramResult result = Tune({"--v-bus", "9", "--counter1", "2000"});
  EXPECT_EQ(result.exit, 1);
  EXPECT_THAT(result.err, HasSubstr("of 2V/(3r), more than 95.0 %"));
  EXPECT_EQ(Tune({"--v-bus", "9", "--counter1", "2000", "--peak-share", "1"}).exit, 0);
}

TEST_F(TuneCommand, ChoosesTheBestOfTheRails) {
  const ProgramResult result = Tune({"--minimise", "time", "--rails", "1.8,3", "--json"});
  ASSERT_EQ(result.exit, 0) << result.err;
  const Json reported = Json::parse(result.out, nullptr, false);
  EXPECT_EQ(reported["candidates"].size(), 6u);
  EXPECT_EQ(reported["v_bus_V"], 3);
  for (const Json& candidate : reported["candidates"])
    EXPECT_GE(candidate["move_s"].get<double>(), reported["move_s"].get<double>());
}

TEST_F(TuneCommand, AFleetIsTunedByItsLoadsAndTheRefusedAreNamed) {
  MakeUnits();
  const std::string loads =
      scratch_.Put("loads.csv", "unit_id,axis,load_uNm\n1,theta,6\n2,phi,40\n");
  const ProgramResult result = Tune({"--units", units_, "--loads", loads, "--out", tuned_});
  EXPECT_EQ(result.exit, 3) << result.err;
  EXPECT_THAT(result.out, HasSubstr("5 of 6 axes tuned"));
  EXPECT_THAT(result.out, HasSubstr("unit 2 phi: the load stalls"));
  const auto table = CsvTable::Parse(Slurp(tuned_), tuned_);
  ASSERT_TRUE(table) << table.error().text;
  ASSERT_EQ(table->size(), 6u);
  EXPECT_EQ(table->cell(0, *table->Find("load_uNm")), "6");
  EXPECT_EQ(table->cell(1, *table->Find("critical")), "37");
  EXPECT_EQ(table->cell(1, *table->Find("origin")), "tuning");
  EXPECT_EQ(table->cell(3, *table->Find("outcome")), "stalls");
  EXPECT_EQ(table->cell(3, *table->Find("repeat")), "");
}

TEST_F(TuneCommand, TheSameSeedDrawsTheSameLoads) {
  MakeUnits();
  const auto text = [&](const char* seed) {
    EXPECT_EQ(
        Tune({"--units", units_, "--load-spread", "0.05", "--seed", seed, "--out", tuned_}).exit,
        0);
    return Slurp(tuned_);
  };
  const std::string first = text("1");
  EXPECT_EQ(text("1"), first);
  EXPECT_NE(text("2"), first);
}

TEST_F(TuneCommand, TheStoreTakesWhatWasTunedWithItsOrigin) {
  MakeUnits();
  const std::string path = scratch_ / "fleet.db";
  {
    auto store = Store::Open(path);
    ASSERT_TRUE(store) << store.error().text;
    const std::vector<Row> rows = {BindingRow{UnitId{1}, {7001}}, BindingRow{UnitId{2}, {7002}}};
    ASSERT_TRUE((*store)->Commit(rows, WallTime{1}));
    // The store is open, as while a daemon runs.
    const ProgramResult held = Tune({"--units", units_, "--store", path});
    EXPECT_EQ(held.exit, 1);
    EXPECT_THAT(held.err, HasSubstr(path));
  }
  const ProgramResult result = Tune({"--units", units_, "--store", path});
  EXPECT_EQ(result.exit, 3) << result.err;
  EXPECT_THAT(result.out, HasSubstr("unit 3 theta: no serial number"));
  auto reader = StoreReader::Open(path);
  ASSERT_TRUE(reader) << reader.error().text;
  const auto history = (*reader)->Parameters({7001}, 100);
  ASSERT_TRUE(history);
  EXPECT_EQ(history->size(), 8u);
  int repeats = 0;
  for (const ParameterHistory& entry : *history) {
    EXPECT_EQ(entry.row.origin, Origin::kTuning);
    if (entry.row.parameter != Parameter::kRepeat) continue;
    ++repeats;
    EXPECT_GT(entry.row.value, 50);
  }
  EXPECT_EQ(repeats, 2);
  const auto tunings = (*reader)->Tunings({7001}, 100);
  ASSERT_TRUE(tunings) << tunings.error().text;
  ASSERT_EQ(tunings->size(), 2u);
  for (const TuningHistory& entry : *tunings) {
    EXPECT_EQ(entry.row.critical, 37);
    EXPECT_GT(entry.row.repeat, 50);
    EXPECT_GE(entry.row.margin, 0.5);
    EXPECT_EQ(entry.row.v_bus_V, 1.8);
    EXPECT_EQ(entry.row.origin, Origin::kTuning);
  }
}

TEST_F(TuneCommand, WithoutAMarginThereIsNoneAndNotLessThanNone) {
  const ProgramResult result = Tune({"--margin", "0", "--json"});
  ASSERT_EQ(result.exit, 0) << result.err;
  const Json reported = Json::parse(result.out, nullptr, false);
  EXPECT_EQ(reported["repeat"], reported["critical"]);
  EXPECT_EQ(reported["margin"].get<double>(), 0);
  MakeUnits();
  ASSERT_EQ(
      Tune({"--margin", "0", "--units", units_, "--load-spread", "0.02", "--out", tuned_}).exit, 0);
  const auto table = CsvTable::Parse(Slurp(tuned_), tuned_);
  ASSERT_TRUE(table) << table.error().text;
  for (std::size_t k = 0; k < table->size(); ++k)
    EXPECT_GE(std::stod(std::string(table->cell(k, *table->Find("margin")))), 0);
}

TEST_F(TuneCommand, AFleetGetsTheVoltageOfEachRailAndTheModeOfEachUnit) {
  const std::string units = scratch_ / "rails.csv";
  ASSERT_EQ(Focalfleet({"layout", "hex", "--count", "4", "--out", units}).exit, 0);
  const std::string loads =
      scratch_.Put("loads.csv", "unit_id,axis,load_uNm\n1,theta,3\n2,phi,6\n");
  const auto best = [&](const char* what) {
    const ProgramResult result = Tune({"--units", units, "--loads", loads, "--minimise", what,
                                       "--rails", "1.8,3", "--out", tuned_, "--json"});
    EXPECT_EQ(result.exit, 0) << result.err;
    return Json::parse(result.out, nullptr, false);
  };
  for (const char* what : {"time", "energy"}) {
    const Json reported = best(what);
    const auto table = CsvTable::Parse(Slurp(tuned_), tuned_);
    ASSERT_TRUE(table) << table.error().text;
    const auto cell = [&](std::size_t row, const char* column) {
      return std::string(table->cell(row, *table->Find(column)));
    };
    // All units of a rail have one voltage, and both axes of a unit one mode. The shortest time
    // needs the high voltage.
    for (std::size_t k = 0; k < table->size(); ++k) {
      EXPECT_EQ(cell(k, "v_bus_V"), cell(0, "v_bus_V"));
      EXPECT_EQ(cell(k, "mode"), cell(k - k % 2, "mode"));
    }
    if (what == std::string("time")) {
      EXPECT_EQ(cell(0, "v_bus_V"), "3");
    }
    // Both axes of unit 2 have the mode that costs least in sum, so neither costs less than alone.
    const ProgramResult one =
        Tune({"--load", "6", "--minimise", what, "--rails", cell(0, "v_bus_V"), "--json"});
    ASSERT_EQ(one.exit, 0) << one.err;
    const Json alone = Json::parse(one.out, nullptr, false);
    const char* const figure = what == std::string("time") ? "move_s" : "move_J";
    EXPECT_GE(std::stod(cell(3, figure)), 0.995 * alone[figure].get<double>());
    EXPECT_LE(std::stod(cell(3, figure)), 1.1 * alone[figure].get<double>());
    EXPECT_GE(reported["choices"].size(), 1u);
  }
}

TEST_F(TuneCommand, ARampLowersNAndKeepsTheMarginThatWasAskedFor) {
  const ProgramResult with =
      Tune({"--set", "C", "--ramp-stages", "8", "--ramp-stage-ms", "20", "--json"});
  const ProgramResult without = Tune({"--set", "C", "--json"});
  ASSERT_EQ(with.exit, 0) << with.err;
  ASSERT_EQ(without.exit, 0) << without.err;
  const Json ramped = Json::parse(with.out);
  const Json plain = Json::parse(without.out);
  EXPECT_LT(ramped["repeat"].get<int>(), plain["repeat"].get<int>());
  EXPECT_EQ(ramped["margin"].get<double>(), 0.5);
}

TEST_F(TuneCommand, BadInputIsRefusedWithTheReason) {
  MakeUnits();
  struct Bad {
    std::vector<std::string> words;
    int exit;
    const char* complaint;
  };
  const auto loads = [&](const std::string& rows) {
    static int count = 0;
    return scratch_.Put("l" + std::to_string(++count) + ".csv", "unit_id,axis,load_uNm\n" + rows);
  };
  for (const Bad& bad : {
           Bad{{"--load", "40"}, 1, "the load stalls from rest"},
           Bad{{"--load", "22"}, 1, "with the margin"},
           Bad{{"--margin", "-1"}, 2, "--margin"},
           Bad{{"--peak-share", "0"}, 2, "--peak-share"},
           Bad{{"--rails", "1.8,24", "--minimise", "energy"}, 2, "which the bridge bears"},
           Bad{{"--minimise", "beauty"}, 2, "--minimise"},
           Bad{{"--out", tuned_}, 1, "need --units"},
           Bad{{"--units", units_}, 1, "--store or --out"},
           Bad{{"--units", scratch_ / "none.csv", "--out", tuned_}, 1, "none.csv"},
           Bad{{"--units", units_, "--store", scratch_ / "none.db"}, 1, "no such store"},
           Bad{{"--rails", "1.8,3"}, 1, "--minimise chooses from"},
           Bad{{"--units", units_, "--out", tuned_, "--ramp-stages", "4"}, 1, "start their moves"},
           Bad{{"--resistance-ohm", "0.001"}, 1, "L/r of a phase"},
           Bad{{"--inertia-gcm2", "1e-9"}, 1, "an inertia of"},
           Bad{{"--units", units_, "--out", tuned_, "--loads", loads("9,theta,5\n")},
               1,
               ":2: column unit_id"},
           Bad{{"--units", units_, "--out", tuned_, "--loads", loads("1,psi,5\n")},
               1,
               "neither theta"},
           Bad{{"--units", units_, "--out", tuned_, "--loads", loads("1,phi,0\n")}, 1, "load_uNm"},
           Bad{{"--units", units_, "--out", tuned_, "--loads", loads("1,phi,5\n1,phi,5\n")},
               1,
               "twice"},
       }) {
    const ProgramResult result = Tune(bad.words);
    EXPECT_EQ(result.exit, bad.exit) << bad.words[0] << " " << result.err;
    EXPECT_THAT(result.err, HasSubstr(bad.complaint));
  }
  EXPECT_THAT(scratch_.List(), Not(Contains("tuned.csv")));
  EXPECT_THAT(scratch_.List(), Not(Contains("none.db")));
}

}  // namespace
}  // namespace focalfleet
