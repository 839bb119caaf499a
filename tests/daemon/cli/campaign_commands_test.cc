// campaign run and the model in force that comes of it. Errors are refused before anything moves,
// and a loaded model reports what it contains.
#include <gmock/gmock.h>

#include "tests/daemon/cli/fake_daemon.h"
#include "tests/daemon/cli/program.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using test::FakeDaemon;
using test::Focalfleet;
using test::ScratchFolder;
using test::Slurp;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

class CampaignRun : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_EQ(Focalfleet({"layout", "hex", "--count", "7", "--out", units_}).exit, 0);
    ASSERT_EQ(Focalfleet({"campaign", "make", "--kind", "survey", "--moves", "2", "--units", units_,
                          "--out", list_})
                  .exit,
              0);
  }
  test::ProgramResult Run(const std::string& night) {
    return Focalfleet({"campaign", "run", list_, "--units", units_, "--out", scratch_ / night,
                       "--socket", scratch_ / "nobody"});
  }
  const ScratchFolder scratch_;
  const std::string units_ = scratch_ / "units.csv", list_ = scratch_ / "list.csv";
};

TEST_F(CampaignRun, DoesNotWriteOverWhatWasMeasured) {
  const std::string made = scratch_ / "night";
  ASSERT_EQ(
      Focalfleet({"simulate", "campaign", "--units", "3", "--moves", "8", "--out", made}).exit, 0);
  const std::string measured = Slurp(made + "/moves.csv");
  const auto refused = Run("night");
  EXPECT_EQ(refused.exit, 1);
  EXPECT_THAT(refused.err, HasSubstr("night/moves.csv: is there already"));
  EXPECT_EQ(Slurp(made + "/moves.csv"), measured);
}

TEST_F(CampaignRun, WithoutADaemonLeavesNothing) {
  EXPECT_EQ(Run("night").exit, 4);
  EXPECT_THAT(scratch_.List(), ElementsAre("list.csv", "units.csv"));
}

Json InForce(std::vector<std::string> left_out) {
  const Json effect{{"cause", "supply_droop"}, {"axis", "both"},       {"units", 19},
                    {"amplitude_median", 0.2}, {"sigma_median", 0.01}, {"amplitude_unit", "deg"}};
  return {{"in_force",
           {{"name", "night-extended"},
            {"sha256", "bdc50c52651c0000"},
            {"campaign", "night"},
            {"rms_before_um", 55.6},
            {"rms_after_um", 3.5},
            {"units", 19},
            {"effects", {effect}},
            {"left_out", left_out}}},
          {"changes",
           {{{"entry", 1},
             {"at", "now"},
             {"sha256", "bdc50c52651c0000"},
             {"name", "night-extended"}}}}};
}

TEST(ModelCommands, LoadSaysWhatItDoesNotCompensate) {
  const ScratchFolder scratch;
  const std::string file = scratch.Put("model.toml", "");
  const auto loaded = [&](std::vector<std::string> left_out) {
    const FakeDaemon daemon(scratch / "control.sock",
                            {{"model_load", {}}, {"model", {.result = InForce(left_out)}}});
    return Focalfleet({"model", "load", file, "--yes", "--socket", daemon.path()});
  };
  const auto partly = loaded({"supply_droop", "relaxation"});
  EXPECT_EQ(partly.exit, 0) << partly.err;
  EXPECT_THAT(partly.out, AllOf(HasSubstr("is in force, of 19 units\n"),
                                HasSubstr("not compensated: supply_droop, relaxation\n")));
  EXPECT_THAT(loaded({}).out, Not(HasSubstr("not compensated")));
}

TEST(ModelCommands, ShowEndsEachOfItsLines) {
  const ScratchFolder scratch;
  const FakeDaemon daemon(scratch / "control.sock",
                          {{"model", {.result = InForce({"supply_droop"})}}});
  const auto shown = Focalfleet({"model", "show", "--socket", daemon.path()});
  EXPECT_EQ(shown.exit, 0) << shown.err;
  EXPECT_THAT(shown.out, HasSubstr("\nnot compensated: supply_droop\nchange "));
  EXPECT_THAT(shown.out, ::testing::EndsWith("\n"));
}

}  // namespace
}  // namespace focalfleet
