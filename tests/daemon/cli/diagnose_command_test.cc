// diagnose and simulate campaign as processes: two models compared, the patch, and the effects that
// can be planted.
#include <gmock/gmock.h>

#include <cmath>
#include <fstream>
#include <sstream>

#include "daemon/control/messages.h"
#include "tests/daemon/cli/program.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using test::Focalfleet;
using test::ScratchFolder;
using test::Slurp;
using ::testing::HasSubstr;

std::string MadeCampaign(const ScratchFolder& scratch, const std::string& name,
                         const std::string& gear_scale, const std::string& seed) {
  const auto made =
      Focalfleet({"simulate", "campaign", "--units", "12", "--moves", "40", "--seed", seed,
                  "--effect", "gear_scale:theta=" + gear_scale, "--out", scratch / name});
  EXPECT_EQ(made.exit, 0) << made.err;
  return scratch / name;
}

std::string FittedModel(const std::string& campaign) {
  const auto done = Focalfleet({"diagnose", campaign, "--out", campaign + "-report", "-q"});
  EXPECT_EQ(done.exit, 0) << done.err;
  return campaign + "-report/model.toml";
}

TEST(DiagnoseAgainst, TellsWhichModelIsBetterAndWhatHasChanged) {
  const ScratchFolder scratch;
  const std::string old_model = FittedModel(MadeCampaign(scratch, "then", "4e-4", "1"));
  const std::string today = MadeCampaign(scratch, "today", "8e-4", "2");
  const std::string new_model = FittedModel(today);
  const auto result =
      Focalfleet({"diagnose", today, "--model", old_model, "--against", new_model, "--json"});
  ASSERT_EQ(result.exit, 0) << result.err;
  const Json reported = Json::parse(result.out);
  EXPECT_EQ(reported["verdict"], "B is better");
  EXPECT_LT(reported["difference"]["ci95_um"][1], 0);
  EXPECT_EQ(reported["rows"], 480);
  EXPECT_EQ(reported["a"]["name"], "then-extended");
  EXPECT_FALSE(reported["a"]["fitted_to_these_moves"]);
  EXPECT_TRUE(reported["b"]["fitted_to_these_moves"]);
  ASSERT_EQ(reported["notes"].size(), 1u) << reported["notes"];
  EXPECT_THAT(std::string(reported["notes"][0]), HasSubstr("B was fitted to these very moves"));
  ASSERT_GE(reported["terms"].size(), 1u);
  EXPECT_EQ(reported["terms"][0]["cause"], "gear_scale");
  EXPECT_EQ(reported["terms"][0]["in"], "both");
  EXPECT_GT(reported["terms"][0]["difference_sigmas"], 3);
  EXPECT_EQ(reported["geometry"].size(), 5u);

  // The same seed gives the same interval; another seed gives nearly the same.
  const auto again =
      Focalfleet({"diagnose", today, "--model", old_model, "--against", new_model, "--json"});
  EXPECT_EQ(result.out, again.out);
  const auto reseeded = Focalfleet(
      {"diagnose", today, "--model", old_model, "--against", new_model, "--seed", "7", "--json"});
  const Json other = Json::parse(reseeded.out);
  EXPECT_NE(other["difference"]["ci95_um"], reported["difference"]["ci95_um"]);
  EXPECT_EQ(other["difference"]["rms_um"], reported["difference"]["rms_um"]);
}

TEST(DiagnoseAgainst, WithoutAModelTheIdealKinematicsAreA) {
  const ScratchFolder scratch;
  const std::string campaign = MadeCampaign(scratch, "night", "8e-4", "1");
  const std::string model = FittedModel(campaign);
  const auto result = Focalfleet({"diagnose", campaign, "--against", model});
  ASSERT_EQ(result.exit, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("nominal"));
  EXPECT_THAT(result.out, HasSubstr("night-extended"));
  EXPECT_THAT(result.out, HasSubstr("B is better: B less A -"));
  EXPECT_THAT(result.out, HasSubstr("note: B was fitted to these very moves"));
  EXPECT_THAT(result.out, HasSubstr("gear_scale"));
  const auto itself =
      Focalfleet({"diagnose", campaign, "--model", model, "--against", model, "--json"});
  EXPECT_EQ(Json::parse(itself.out)["verdict"], "no difference that these data show");
}

TEST(DiagnoseAgainst, WrongUsageAndBadModelsAreReported) {
  const ScratchFolder scratch;
  const std::string campaign = MadeCampaign(scratch, "night", "8e-4", "1");
  const std::string bad = scratch.Put("bad.toml", "[[effect]]\ncause = \"moods\"\n");
  const auto neither = Focalfleet({"diagnose", campaign});
  EXPECT_EQ(neither.exit, 2);
  EXPECT_THAT(neither.err, HasSubstr("--out is required"));
  const auto both =
      Focalfleet({"diagnose", campaign, "--against", bad, "--out", scratch / "report"});
  EXPECT_EQ(both.exit, 2);
  EXPECT_THAT(both.err, HasSubstr("--out and --against exclude each other"));
  EXPECT_EQ(Focalfleet({"diagnose", campaign, "--against", bad, "--patch"}).exit, 2);
  const auto refused = Focalfleet({"diagnose", campaign, "--against", bad});
  EXPECT_EQ(refused.exit, 1);
  EXPECT_THAT(refused.err, HasSubstr("bad.toml:1: there is no effect 'moods'"));
  EXPECT_EQ(Focalfleet({"diagnose", campaign, "--against", scratch / "none.toml"}).exit, 1);
  EXPECT_THAT(scratch.List(), ::testing::ElementsAre("bad.toml", "night"));
}

// Candidates of the earlier model are taken over untested, and do not count as sure.
TEST(DiagnoseModel, WhatIsTakenOverKeepsItsCandidates) {
  const ScratchFolder scratch;
  const std::string first = FittedModel(MadeCampaign(scratch, "night", "8e-4", "1"));
  std::string text = Slurp(first);
  const std::string own = "candidates = [\"gear_scale\"]";
  ASSERT_THAT(text, HasSubstr(own));
  text.replace(text.find(own), own.size(), "candidates = [\"gear_scale\", \"ramp_travel\"]");
  const std::string doubted = scratch.Put("doubted.toml", text);
  const auto again = Focalfleet(
      {"diagnose", scratch / "night", "--model", doubted, "--out", scratch / "again", "-q"});
  ASSERT_EQ(again.exit, 0) << again.err;
  EXPECT_THAT(Slurp(scratch / "again/model.toml"),
              HasSubstr("candidates = [\"gear_scale\", \"ramp_travel\"]"));
}

TEST(DiagnosePatch, TellsTheEmpiricalTermAndLeavesTheVerdict) {
  const ScratchFolder scratch;
  const auto made = Focalfleet({"simulate", "campaign", "--units", "24", "--moves", "60",
                                "--effect", "stage_ripple:theta=0.1", "--out", scratch / "night"});
  ASSERT_EQ(made.exit, 0) << made.err;
  const auto result = Focalfleet({"diagnose", scratch / "night", "--out", scratch / "report",
                                  "--without", "stage_ripple", "--patch"});
  ASSERT_EQ(result.exit, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("Something is wrong by "));
  EXPECT_THAT(result.out, HasSubstr("patched by empirical terms"));
  EXPECT_THAT(result.out, HasSubstr("empirical_ripple"));
  const Json report = Json::parse(Slurp(scratch / "report/report.json"));
  EXPECT_EQ(report["verdict"], "unknown");
  EXPECT_EQ(report["unknown"][0]["patched"]["term"], "empirical_ripple");
  const auto again = Focalfleet(
      {"diagnose", scratch / "night", "--against", scratch / "report/model.toml", "--json"});
  ASSERT_EQ(again.exit, 0) << again.err;
  EXPECT_EQ(Json::parse(again.out)["verdict"], "B is better");
}

// Returns the places in moves.csv, which are in its columns 7 and 8, in mm.
std::vector<double> PlacesIn(const std::string& file) {
  std::vector<double> places;
  std::istringstream lines(Slurp(file));
  std::string line;
  std::getline(lines, line);
  while (std::getline(lines, line)) {
    std::istringstream cells(line);
    std::string cell;
    for (int k = 0; std::getline(cells, cell, ','); ++k)
      if (k == 6 || k == 7) places.push_back(std::stod(cell));
  }
  return places;
}

// The extended model predicts the campaign in which it was found.
TEST(SimulateCampaign, AModelPredictsTheCampaign) {
  const ScratchFolder scratch;
  const std::string night = scratch / "night", report = scratch / "report";
  const auto made =
      Focalfleet({"simulate", "campaign", "--units", "12", "--moves", "60", "--noise-um", "2",
                  "--effect", "backlash:theta=0.2", "--outliers", "0", "--out", night});
  ASSERT_EQ(made.exit, 0) << made.err;
  ASSERT_EQ(Focalfleet({"diagnose", night, "--out", report}).exit, 0);
  const auto predicted = [&](const std::string& model, const char* noise_um) {
    const auto result = Focalfleet({"simulate", "campaign", "--of", night, "--model", model,
                                    "--noise-um", noise_um, "--out", scratch / "predicted"});
    EXPECT_EQ(result.exit, 0) << result.err;
    const std::vector<double> then = PlacesIn(night + "/moves.csv");
    const std::vector<double> now = PlacesIn(scratch / "predicted/moves.csv");
    EXPECT_EQ(then.size(), 2 * 12 * 60u);
    EXPECT_EQ(then.size(), now.size());
    double square = 0;
    for (std::size_t k = 0; k < std::min(then.size(), now.size()); ++k)
      square += std::pow(then[k] - now[k], 2);
    return 1e3 * std::sqrt(2 * square / static_cast<double>(then.size()));
  };
  const double left_um = predicted(report + "/model.toml", "0");
  EXPECT_LT(left_um, 5);  // noise of the camera, and residuals
  EXPECT_GT(predicted(report + "/model.toml", "20"), 25);
  const auto exit_of = [&](std::vector<std::string> more) {
    std::vector<std::string> words = {"simulate", "campaign", "--out", scratch / "none"};
    words.insert(words.end(), more.begin(), more.end());
    return Focalfleet(words).exit;
  };
  EXPECT_EQ(exit_of({"--of", night}), 2);
  EXPECT_EQ(exit_of({"--model", report + "/model.toml"}), 2);
  EXPECT_EQ(exit_of({"--of", night, "--model", report + "/model.toml", "--outliers", "0.1"}), 2);
  EXPECT_EQ(exit_of({"--of", night, "--model", report + "/model.toml", "--units", "3"}), 2);
  EXPECT_EQ(exit_of({"--of", night, "--model", scratch / "no.toml"}), 1);
  EXPECT_EQ(exit_of({"--of", scratch / "no", "--model", report + "/model.toml"}), 1);
  EXPECT_EQ(exit_of({"--next", scratch / "no.csv"}), 1);
  // The measured campaign stays as it is.
  const std::string measured = Slurp(night + "/moves.csv");
  EXPECT_EQ(Focalfleet({"simulate", "campaign", "--of", night, "--model", report + "/model.toml",
                        "--out", night + "/."})
                .exit,
            2);
  EXPECT_EQ(Slurp(night + "/moves.csv"), measured);
}

TEST(Diagnose, SaysHowManyRowsAreSetAside) {
  const ScratchFolder scratch;
  ASSERT_EQ(Focalfleet({"simulate", "campaign", "--units", "12", "--moves", "40", "--outliers",
                        "0.05", "--out", scratch / "night"})
                .exit,
            0);
  const auto result = Focalfleet({"diagnose", scratch / "night", "--out", scratch / "report"});
  ASSERT_EQ(result.exit, 0) << result.err;
  const Json outliers = Json::parse(Slurp(scratch / "report/report.json"))["outliers"];
  const int far = outliers["why"]["far from every prediction"];
  EXPECT_GT(far, 10);
  EXPECT_THAT(result.out, HasSubstr(std::to_string(far) + " of 480 rows: far from every"));
}

// Rounds the places of moves.csv to a step and reverses its rows.
void MakeOdd(const std::string& campaign, double step_mm) {
  std::istringstream lines(Slurp(campaign + "/moves.csv"));
  std::string line, header;
  std::getline(lines, header);
  std::string rows;
  while (std::getline(lines, line)) {
    std::istringstream cells(line);
    std::string cell, row;
    for (int k = 0; std::getline(cells, cell, ','); ++k) {
      if (k == 6 || k == 7) cell = std::to_string(std::round(std::stod(cell) / step_mm) * step_mm);
      row += (k == 0 ? "" : ",") + cell;
    }
    rows.insert(0, row + (line.ends_with(',') ? ",\n" : "\n"));
  }
  std::ofstream(campaign + "/moves.csv") << header << "\n" << rows;
}

// Oddities of the data are reported, and every command reads the model.
TEST(Diagnose, SaysWhatIsOddAboutTheData) {
  const ScratchFolder scratch;
  const std::string night = MadeCampaign(scratch, "night", "8e-4", "1");
  MakeOdd(night, 0.1);
  const auto result = Focalfleet({"diagnose", night, "--out", scratch / "report"});
  ASSERT_EQ(result.exit, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("note: 468 of 480 rows stand behind a later move of their "
                                    "unit: rows were sorted\n"));
  EXPECT_THAT(result.out, HasSubstr("note: places come in steps of 0.1 mm: nothing finer can be"));
  const Json report = Json::parse(Slurp(scratch / "report/report.json"));
  ASSERT_EQ(report["remarks"].size(), 1u) << report["remarks"];
  EXPECT_NEAR(report["data"]["place_step_mm"][0], 0.1, 1e-6);
  EXPECT_THAT(Slurp(scratch / "report/report.html"), HasSubstr("Note: places come in steps of"));
  const std::string model = scratch / "report/model.toml";
  const auto predicted = Focalfleet({"simulate", "campaign", "--of", night, "--model", model,
                                     "--out", scratch / "predicted", "-q"});
  EXPECT_EQ(predicted.exit, 0) << predicted.err;
  const auto against = Focalfleet({"diagnose", night, "--against", model});
  EXPECT_EQ(against.exit, 0) << against.err;
  EXPECT_THAT(against.out, HasSubstr("note: 468 of 480 rows stand behind"));
}

// Without a fit there are no figures: unknown values are null, and no line of the model is written.
TEST(Diagnose, TellsNoFiguresOfACampaignThatIsTooShort) {
  const ScratchFolder scratch;
  ASSERT_EQ(Focalfleet({"simulate", "campaign", "--units", "5", "--moves", "3", "--out",
                        scratch / "night"})
                .exit,
            0);
  const auto result = Focalfleet({"diagnose", scratch / "night", "--out", scratch / "report"});
  ASSERT_EQ(result.exit, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("not enough for a verdict: no unit was seen after 8 moves"));
  const Json gain = Json::parse(Slurp(scratch / "report/report.json"))["gain"];
  for (const char* figure :
       {"rms_before_um", "rms_after_um", "noise_floor_um", "mad_after_um", "explained_fraction"})
    EXPECT_TRUE(gain[figure].is_null()) << gain;
  EXPECT_THAT(Slurp(scratch / "report/model.toml"), ::testing::Not(HasSubstr("rms_after_um")));
}

TEST(SimulateCampaign, EffectsAreCauseAxisShapeAndAmplitude) {
  const ScratchFolder scratch;
  const auto made = [&](const std::string& effect) {
    return Focalfleet({"simulate", "campaign", "--units", "3", "--moves", "8", "--effect", effect,
                       "--out", scratch / "made"});
  };
  for (const char* effect : {"backlash=0.1", "backlash:phi=-1e-1", "stiction:theta#45=1",
                             "lost_command=2", "centroid_bias=8"})
    EXPECT_EQ(made(effect).exit, 0) << effect << made(effect).err;
  EXPECT_THAT(Slurp(scratch / "made/moves.csv"), HasSubstr("pixel_x"));
  const auto listed = made("stiction:theta#999=1");
  EXPECT_EQ(listed.exit, 2);
  EXPECT_THAT(listed.err, HasSubstr("45  theta: until the next move; jumps from, deg, 0.4"));
  for (const char* effect :
       {"backlash", "backlash=", "backlash=x", "backlash:=1", "backlash#=1", "backlash#-1=1",
        "backlash=1=2", "Backlash=1", "backlash:z=1", "nothing=1", "backlash=1e999"}) {
    const auto refused = made(effect);
    EXPECT_EQ(refused.exit, 2) << effect;
    EXPECT_THAT(refused.err, HasSubstr("error: ")) << effect;
  }
}

}  // namespace
}  // namespace focalfleet
