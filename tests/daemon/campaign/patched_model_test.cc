// A model with empirical terms and with shapes of single units is written to its file and read
// back.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "daemon/campaign/diagnosis_files.h"
#include "daemon/campaign/diagnosis_page.h"
#include "daemon/campaign/model_file.h"
#include "daemon/campaign/verdict_sentence.h"
#include "sim/campaigns/effects/empirical.h"
#include "tests/sim/campaigns/planting/planted_campaign.h"

namespace focalfleet {
namespace {

using ::testing::HasSubstr;

const ReportNames kNames{.sha256 = "12ab", .campaign = "damp"};

sim::Campaign DampCampaign() { return sim::test::Damp(11); }

sim::Diagnosis PatchedDiagnosis(const sim::Campaign& campaign) {
  return sim::Diagnose(campaign, {.patch = true, .with_gain = false});
}

double FarthestApart_mm(const sim::CampaignModel& a, const sim::CampaignModel& b,
                        const sim::Campaign& campaign) {
  const sim::CampaignFacts facts = sim::MakeFacts(campaign);
  const sim::Places one = sim::Predict(a, facts, sim::OneAfterTheOther());
  const sim::Places other = sim::Predict(b, facts, sim::OneAfterTheOther());
  double most = 0;
  for (std::size_t row = 0; row < campaign.rows(); ++row)
    most = std::max(most,
                    std::hypot(one.x_mm[row] - other.x_mm[row], one.y_mm[row] - other.y_mm[row]));
  return most;
}

TEST(PatchedModel, ReadsBackAndPredictsTheSamePlaces) {
  const sim::Campaign campaign = DampCampaign();
  const sim::Diagnosis diagnosis = PatchedDiagnosis(campaign);
  const std::string text = WriteModel(diagnosis, kNames, campaign);
  EXPECT_THAT(text, HasSubstr("cause = \"empirical_curve\""));
  EXPECT_THAT(text, HasSubstr("covariate = \"humidity_pct\""));
  EXPECT_THAT(text, HasSubstr("channel = \"theta angle\""));
  const auto read = ReadModelFile(text, "model.toml", campaign.units);
  ASSERT_TRUE(read) << read.error().text;
  ASSERT_EQ(read->model.terms.size(), diagnosis.model.terms.size());
  EXPECT_EQ(read->units_known, campaign.units.size());
  EXPECT_LT(FarthestApart_mm(diagnosis.model, read->model, campaign), 1e-6);
  // The same holds on another night, wetter than any that was seen.
  sim::Campaign wetter = sim::test::Damp(12);
  for (double& humidity : wetter.covariates.back().values) humidity += 15;
  EXPECT_LT(FarthestApart_mm(diagnosis.model, read->model, wetter), 1e-6);
  sim::CampaignModel plain = read->model;
  plain.terms.clear();
  EXPECT_GT(FarthestApart_mm(plain, read->model, wetter), 5e-3);  // or the terms did nothing
}

TEST(ModelFile, KeepsTheShapeOfEachUnit) {
  const sim::Campaign campaign = sim::test::Planted(
      {{.cause = "tooth_damage", .amplitude = 0.1, .axis = "theta"}}, {.units = 24, .moves = 80});
  const sim::Diagnosis diagnosis = sim::test::Verdicts(campaign);
  ASSERT_EQ(diagnosis.model.terms.size(), 1u) << sim::test::Reported(diagnosis);
  ASSERT_EQ(diagnosis.model.terms[0].form.shape_of_unit.size(), campaign.units.size());
  const std::string text = WriteModel(diagnosis, kNames, campaign);
  const auto read = ReadModelFile(text, "model.toml", campaign.units);
  ASSERT_TRUE(read) << read.error().text;
  EXPECT_LT(FarthestApart_mm(diagnosis.model, read->model, campaign), 1e-6);
  // These texts are no shapes of single units.
  const auto error_of = [&](std::string_view what, std::string_view instead) {
    std::string other = text;
    other.replace(other.find(what), what.size(), instead);
    const auto refused = ReadModelFile(other, "model.toml", campaign.units);
    return refused ? std::string() : refused.error().text;
  };
  const auto& groups = diagnosis.model.terms[0].group_of_unit;
  const auto units = static_cast<std::size_t>(
      std::ranges::count_if(groups, [](std::uint32_t group) { return group != sim::kNoGroup; }));
  ASSERT_GE(units, 20u);
  EXPECT_THAT(
      error_of("shapes = [", "shapes = [1, "),
      HasSubstr(std::to_string(units + 1) + " numbers for " + std::to_string(units) + " units"));
  const std::size_t first = text.find("shapes = [") + 10;
  EXPECT_THAT(error_of(text.substr(first, text.find(',', first) - first), "nan"),
              HasSubstr("one is no number"));
  EXPECT_THAT(error_of("\nshapes = [", "\nshapes = 3 # ["), HasSubstr("not a list"));
  const std::size_t kind = text.find("cause = \"tooth_damage\"");
  const std::size_t shape = text.find("shape = ", kind);
  EXPECT_THAT(error_of(text.substr(kind, shape - kind),
                       "cause = \"load_angle_lag\"\naxis = \"theta\"\nform = 0\n"),
              HasSubstr("none of their own"));
}

TEST(PatchedModel, KeepsWhoSharesAnAmplitude) {
  const sim::Campaign campaign = DampCampaign();
  const sim::Diagnosis diagnosis = PatchedDiagnosis(campaign);
  const auto read =
      ReadModelFile(WriteModel(diagnosis, kNames, campaign), "model.toml", campaign.units);
  ASSERT_TRUE(read) << read.error().text;
  ASSERT_EQ(diagnosis.model.terms.back().sharing, sim::Sharing::kFleet);
  EXPECT_EQ(read->model.terms.back().sharing, sim::Sharing::kFleet);
  EXPECT_EQ(read->model.terms.back().groups(), 1u);
}

TEST(PatchedModel, IsCalledEmpiricalInEveryReport) {
  const sim::Campaign campaign = DampCampaign();
  const sim::Diagnosis diagnosis = PatchedDiagnosis(campaign);
  const nlohmann::json report = ReportJson(diagnosis, kNames);
  EXPECT_EQ(report["verdict"], "unknown");
  const nlohmann::json& unknown = report["unknown"][0];
  EXPECT_EQ(unknown["covariate"], "humidity_pct");
  EXPECT_EQ(unknown["patched"]["term"], "empirical_curve");
  EXPECT_GT(unknown["patched"]["rms_um"], 3);
  EXPECT_THAT(VerdictSentence(diagnosis), HasSubstr("patched by empirical terms"));
  EXPECT_THAT(DiagnosisPage(campaign, diagnosis, kNames), HasSubstr("empirical_curve"));
  for (const auto& cause : report["causes"])
    EXPECT_THAT(std::string(cause["cause"]), ::testing::Not(HasSubstr("empirical")));
  const sim::Diagnosis plain = sim::Diagnose(campaign, {.with_gain = false});
  EXPECT_FALSE(ReportJson(plain, kNames)["unknown"][0].contains("patched"));
}

TEST(PatchedModel, AFileThatNoPatchWroteIsRefused) {
  const std::vector<sim::CampaignUnit> units = sim::test::Planted({}).units;
  const auto error_of = [&](const std::string& text) {
    const auto read = ReadModelFile(text, "m.toml", units);
    return read ? std::string() : read.error().text;
  };
  const std::string begin = "[[effect]]\nform = 0\nmemory = 0\nunits = [1]\n";
  const std::string curve = begin +
                            "cause = \"empirical_curve\"\nshape = 1\ncolumns = 2\n"
                            "amplitude = [0.1, 0.1]\nchannel = \"x\"\n";
  const std::string knots = "knot_values = [1, 2]\nknot_ranks = [0, 1]\n";
  EXPECT_EQ(error_of(curve + "covariate = \"t_s\"\n" + knots), "");
  EXPECT_THAT(error_of(curve + knots), HasSubstr("covariate is missing"));
  EXPECT_THAT(error_of(curve + "covariate = \"t_s\"\n"), HasSubstr("knot_values is missing"));
  EXPECT_THAT(error_of(curve + "covariate = \"t_s\"\nknot_values = [1, 2]\nknot_ranks = [1]\n"),
              HasSubstr("not of one length"));
  EXPECT_THAT(error_of(curve + "covariate = \"t_s\"\nknot_values = [2, 2]\nknot_ranks = [0, 1]\n"),
              HasSubstr("values that ascend"));
  EXPECT_THAT(error_of(curve + "covariate = \"t_s\"\nknot_values = [1, 2]\nknot_ranks = [0, 2]\n"),
              HasSubstr("ranks from 0 to 1"));
  std::string elsewhere = curve + "covariate = \"t_s\"\n" + knots;
  elsewhere.replace(elsewhere.find("\"x\""), 3, "\"z\"");
  EXPECT_THAT(error_of(elsewhere), HasSubstr("there is no channel 'z'"));
  const std::string ripple = begin +
                             "cause = \"empirical_ripple\"\nshape = 5\ncovariate = "
                             "\"theta_cmd_deg\"\naxis = \"theta\"\n";
  EXPECT_EQ(error_of(ripple + "columns = 2\namplitude = [0.1, 0.1]\n"), "");
  EXPECT_THAT(error_of(ripple + "columns = 1\namplitude = [0.1]\n"), HasSubstr("a ripple is of"));
}

}  // namespace
}  // namespace focalfleet
