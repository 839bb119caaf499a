// The diagnosis writes no NaN and no infinity, and the project's own programs read its model,
// whatever the campaign is like.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "daemon/campaign/campaign_files.h"
#include "daemon/campaign/compensation.h"
#include "daemon/campaign/diagnosis_files.h"
#include "daemon/campaign/diagnosis_page.h"
#include "daemon/campaign/model_file.h"
#include "daemon/campaign/next_moves_file.h"
#include "daemon/campaign/verdict_sentence.h"
#include "fleet/files/layout_file.h"
#include "sim/campaigns/diagnosis/decide/decide.h"
#include "tests/sim/campaigns/campaign/odd_places.h"
#include "tests/sim/campaigns/planting/planted_campaign.h"

namespace focalfleet {
namespace {

using sim::Campaign;
using sim::kPhi;
using sim::kTheta;
using sim::test::InSteps;
using sim::test::MovedInTurns;
using sim::test::ReadTwice;

constexpr double kMissing = std::numeric_limits<double>::quiet_NaN();

Campaign Made(sim::PlantedOptions options) {
  auto campaign = sim::PlantCampaign(options);
  EXPECT_TRUE(campaign) << campaign.error().text;
  return *campaign;
}
Campaign Plain() { return Made({.units = 12, .moves = 40}); }
Campaign WithEffects() {
  return Made({.units = 12,
               .moves = 40,
               .effects = {{.cause = "backlash", .amplitude = 0.2, .axis = "phi"},
                           {.cause = "eccentricity", .amplitude = 0.1, .axis = "theta"}}});
}

Campaign Measured(Campaign campaign,
                  const std::function<sim::PlacePoint(std::size_t unit, std::size_t row)>& place) {
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit)
    for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row) {
      const sim::PlacePoint at = place(unit, row);
      campaign.x_mm[row] = at.x_mm, campaign.y_mm[row] = at.y_mm;
    }
  return campaign;
}

Campaign OneAxisParked(std::size_t parked, double noise_mm) {
  Campaign campaign = Plain();
  Rng rng = Rng::Stream(3, "parked");
  for (std::vector<double>* angles : {&campaign.from_deg[parked], &campaign.cmd_deg[parked]})
    for (double& angle_deg : *angles) angle_deg = 50;
  return Measured(campaign, [&](std::size_t unit, std::size_t row) {
    const sim::PlacePoint at =
        PlaceOf(campaign.units[unit], campaign.cmd_deg[kTheta][row], campaign.cmd_deg[kPhi][row]);
    return sim::PlacePoint{at.x_mm + noise_mm * rng.Normal(), at.y_mm + noise_mm * rng.Normal()};
  });
}

Campaign Dead(double noise_mm) {
  Rng rng = Rng::Stream(4, "dead");
  const Campaign campaign = Plain();
  return Measured(campaign, [&](std::size_t unit, std::size_t) {
    const sim::PlacePoint at = PlaceOf(campaign.units[unit], 10, 80);
    return sim::PlacePoint{at.x_mm + noise_mm * rng.Normal(), at.y_mm + noise_mm * rng.Normal()};
  });
}

Campaign OneUnitOfFewMoves() {
  const Campaign campaign = Plain();
  std::vector<bool> keep(campaign.rows(), true);
  for (std::size_t row = campaign.first_row[4] + 3; row < campaign.first_row[5]; ++row)
    keep[row] = false;
  return Keep(campaign, keep);
}

// Returns a campaign with places that belong to none of its units.
Campaign Anywhere(double far_mm) {
  Rng rng = Rng::Stream(5, "anywhere");
  return Measured(Plain(), [&](std::size_t, std::size_t) {
    return sim::PlacePoint{rng.Uniform(-far_mm, far_mm), rng.Uniform(-far_mm, far_mm)};
  });
}

// Returns a campaign in which one unit turns as commanded, but about another base and with other
// arm lengths.
Campaign OneUnitIsAnother() {
  Campaign campaign = Plain();
  sim::CampaignUnit other = campaign.units[2];
  other.base_x_mm += 14, other.arm_mm[kTheta] *= 0.3;
  for (std::size_t row = campaign.first_row[2]; row < campaign.first_row[3]; ++row) {
    const sim::PlacePoint at =
        PlaceOf(other, campaign.cmd_deg[kTheta][row], campaign.cmd_deg[kPhi][row]);
    campaign.x_mm[row] = at.x_mm, campaign.y_mm[row] = at.y_mm;
  }
  return campaign;
}

Campaign EveryRowItsOwnExposure() {
  Campaign campaign = WithEffects();
  for (std::size_t row = 0; row < campaign.rows(); ++row)
    campaign.move_id[row] = static_cast<std::int64_t>(row);
  return campaign;
}

Campaign AllReadTwice() {
  Campaign campaign = WithEffects();
  for (std::size_t exposure = 1; exposure < 40; ++exposure)
    campaign = ReadTwice(campaign, exposure);
  return campaign;
}

Campaign SomeMissing(double share) {
  Campaign campaign = WithEffects();
  Rng rng = Rng::Stream(6, "missing");
  for (std::size_t row = 0; row < campaign.rows(); ++row)
    if (rng.Uniform() < share) campaign.x_mm[row] = campaign.y_mm[row] = kMissing;
  return campaign;
}

Campaign OfColumnsThatSayNothing() {
  Campaign campaign = WithEffects();
  for (sim::Covariate& column : campaign.covariates)
    column.values.assign(campaign.rows(), column.name == "temp_C" ? kMissing : 1);
  return campaign;
}

struct Odd {
  const char* name;
  Campaign (*make)();
};

const Odd kOdd[] = {
    {"Plain", Plain},
    {"WithEffects", WithEffects},
    {"WholePixelsOf200um", [] { return InSteps(WithEffects(), 0.2); }},
    {"WholePixelsOf90um", [] { return InSteps(WithEffects(), 0.09); }},
    {"WholePixelsOf50um", [] { return InSteps(Plain(), 0.05); }},
    {"WholeMillimetres", [] { return InSteps(Plain(), 1); }},
    {"HalfCarriedOn", [] { return MovedInTurns(Plain(), 0.5, true); }},
    {"MostlyCarriedOn", [] { return MovedInTurns(Plain(), 0.1, true); }},
    {"CarriedOnInWholePixels", [] { return InSteps(MovedInTurns(Plain(), 0.5, true), 0.1); }},
    {"WithoutCameraNoise", [] { return Made({.units = 12, .moves = 40, .noise_um = 0}); }},
    {"WithoutAnyNoise",
     [] { return Made({.units = 12, .moves = 40, .noise_um = 0, .rest_noise_deg = 0}); }},
    {"EffectsWithoutAnyNoise",
     [] {
       return Made({.units = 12,
                    .moves = 40,
                    .noise_um = 0,
                    .rest_noise_deg = 0,
                    .effects = {{.cause = "backlash", .amplitude = 0.2, .axis = "phi"}}});
     }},
    {"PulledByRotorsAnywhere",
     [] { return sim::test::Pulled(sim::test::RandomPhases_deg(24, 6), 6); }},
    {"OneUnit", [] { return Made({.units = 1, .moves = 40}); }},
    {"OneUnitInWholePixels", [] { return InSteps(Made({.units = 1, .moves = 40}), 0.2); }},
    {"OneUnitWithoutNoise",
     [] { return Made({.units = 1, .moves = 40, .noise_um = 0, .rest_noise_deg = 0}); }},
    {"TwoUnits", [] { return Made({.units = 2, .moves = 40}); }},
    {"OneMove", [] { return Made({.units = 12, .moves = 1}); }},
    {"TwoMoves", [] { return Made({.units = 12, .moves = 2}); }},
    {"EightMoves", [] { return Made({.units = 12, .moves = 8}); }},
    {"NineMovesInWholePixels", [] { return InSteps(Made({.units = 12, .moves = 9}), 0.2); }},
    {"Dead", [] { return Dead(3e-3); }},
    {"DeadWithoutNoise", [] { return Dead(0); }},
    {"NothingSeen", [] { return SomeMissing(1); }},
    {"HardlyAnythingSeen", [] { return SomeMissing(0.75); }},
    {"PhiParked", [] { return OneAxisParked(kPhi, 3e-3); }},
    {"PhiParkedWithoutNoise", [] { return OneAxisParked(kPhi, 0); }},
    {"ThetaParked", [] { return OneAxisParked(kTheta, 3e-3); }},
    {"ThetaParkedInWholePixels", [] { return InSteps(OneAxisParked(kTheta, 3e-3), 0.1); }},
    {"OneUnitOfThreeMoves", OneUnitOfFewMoves},
    {"AnywhereNear", [] { return Anywhere(3); }},
    {"AnywhereFar", [] { return Anywhere(1e4); }},
    {"AllAtZero",
     [] { return Measured(Plain(), [](auto, auto) {
            return sim::PlacePoint{0, 0};
          }); }},
    {"HalfOutliers", [] { return Made({.units = 12, .moves = 40, .outlier_share = 0.5}); }},
    {"OneUnitIsAnother", OneUnitIsAnother},
    {"EveryRowItsOwnExposure", EveryRowItsOwnExposure},
    {"AllReadTwice", AllReadTwice},
    {"OfColumnsThatSayNothing", OfColumnsThatSayNothing},
};

// Returns the words that stand for no number: nan, -nan, inf, infinity.
std::vector<std::string> NoNumbersIn(const std::string& text) {
  std::vector<std::string> found;
  std::string word;
  for (const char c : text + " ") {
    if (std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_') {
      word += static_cast<char>(std::tolower(c));
      continue;
    }
    if (word == "nan" || word == "inf" || word == "infinity") found.push_back(word);
    word.clear();
  }
  return found;
}

// Each cause shares out among its candidates what its doubt leaves of 1. "unknown" has the doubt
// where it is one of them, and is one where the doubt is above a tenth.
void ExpectPosteriors(const sim::Diagnosis& diagnosis, const nlohmann::json& report) {
  ASSERT_EQ(report["causes"].size(), diagnosis.causes.size());
  for (std::size_t k = 0; k < diagnosis.causes.size(); ++k) {
    const nlohmann::json& cause = report["causes"][k];
    const double doubt = sim::DoubtOf(diagnosis.causes[k], diagnosis.unknown);
    double sum = 0;
    EXPECT_EQ(cause["posterior"].size(), cause["candidates"].size()) << cause;
    for (const nlohmann::json& candidate : cause["candidates"]) {
      const std::string name = candidate;
      ASSERT_TRUE(cause["posterior"].contains(name)) << cause;
      const double probability = cause["posterior"][name];
      EXPECT_GE(probability, 0) << cause;
      sum += probability;
    }
    const bool has_unknown = cause["posterior"].contains("unknown");
    EXPECT_EQ(has_unknown, doubt > 0.1) << cause;
    EXPECT_NEAR(sum, has_unknown ? 1 : 1 - doubt, 1e-9) << cause;
    const double of_unknown = cause["posterior"].value("unknown", doubt);
    EXPECT_NEAR(of_unknown, doubt, 1e-9) << cause;
    EXPECT_TRUE(cause["at_bound"].is_boolean()) << cause;
  }
}

// The table has each axis of each unit once, and the report counts them all.
void ExpectUnitsByClass(const Campaign& campaign, const std::string& table,
                        const nlohmann::json& counts) {
  std::istringstream lines(table);
  std::string line;
  std::getline(lines, line);
  EXPECT_EQ(line, "unit_id,axis,class,scale_cw,scale_ccw,stalls,stuck_at_deg,wraps,rms_um,moves");
  std::map<std::string, int> counted;
  for (const sim::CampaignUnit& unit : campaign.units)
    for (const char* axis : {"theta", "phi"}) {
      ASSERT_TRUE(std::getline(lines, line)) << unit.id;
      EXPECT_THAT(line, ::testing::StartsWith(std::to_string(unit.id) + "," + axis + ","));
      EXPECT_EQ(std::ranges::count(line, ','), 9) << line;
      std::istringstream cells(line);
      std::string cell;
      for (int k = 0; k < 3; ++k) std::getline(cells, cell, ',');
      ++counted[cell];
    }
  EXPECT_FALSE(std::getline(lines, line)) << line;
  EXPECT_EQ(counts, nlohmann::json(counted));
}

class OddCampaign : public testing::TestWithParam<Odd> {};

TEST_P(OddCampaign, IsDiagnosedInNumbers) {
  const Campaign campaign = GetParam().make();
  ASSERT_TRUE(Validate(campaign));
  const ReportNames names{.sha256 = "12ab", .campaign = "odd"};
  const sim::Diagnosis diagnosis = sim::Diagnose(campaign, {.patch = true});
  using ::testing::IsEmpty;
  EXPECT_THAT(NoNumbersIn(VerdictSentence(diagnosis)), IsEmpty());
  EXPECT_THAT(NoNumbersIn(DiagnosisPage(campaign, diagnosis, names)), IsEmpty());
  EXPECT_THAT(NoNumbersIn(WriteNextMoves(campaign.units, diagnosis.next.moves)), IsEmpty());
  const nlohmann::json report = ReportJson(diagnosis, names);
  EXPECT_THAT(NoNumbersIn(report.dump()), IsEmpty());
  ExpectPosteriors(diagnosis, report);
  const std::string by_class = WriteUnitsByClass(diagnosis);
  EXPECT_THAT(NoNumbersIn(by_class), IsEmpty());
  ExpectUnitsByClass(campaign, by_class, report["units_by_class"]);
  for (const nlohmann::json& cause : report["causes"])
    for (const char* number : {"amplitude", "rms_um", "delta_log_likelihood", "predicted_gain_um"})
      EXPECT_TRUE(cause[number].is_number()) << cause;
  const bool is_reported = diagnosis.verdict != sim::Verdict::kInsufficient;
  EXPECT_EQ(report["gain"]["rms_after_um"].is_number(), is_reported) << report["gain"];
}

TEST_P(OddCampaign, LeavesAModelThatIsReadAndPredicts) {
  const Campaign campaign = GetParam().make();
  const sim::Diagnosis diagnosis = sim::Diagnose(campaign, {.patch = true, .with_gain = false});
  const std::string text = WriteModel(diagnosis, {.campaign = "odd"}, campaign);
  EXPECT_THAT(NoNumbersIn(text), ::testing::IsEmpty());
  const auto read = ReadModelFile(text, "model.toml", campaign.units);
  ASSERT_TRUE(read) << read.error().text;
  EXPECT_EQ(read->units_known + diagnosis.without_geometry.size(), campaign.units.size());
  const sim::CampaignFacts facts = sim::MakeFacts(campaign);
  sim::CampaignModel model = read->model;
  LeaveOutUntestable(facts, &model);
  const sim::Places places = Predict(model, facts, sim::OneAfterTheOther());
  const auto is_finite = [](double value) { return std::isfinite(value); };
  EXPECT_TRUE(std::ranges::all_of(places.x_mm, is_finite));
  EXPECT_TRUE(std::ranges::all_of(places.y_mm, is_finite));
  if (diagnosis.verdict == sim::Verdict::kInsufficient) return;
  const auto layout = ReadLayout(WriteCampaignUnits(campaign), "units.csv", {});
  ASSERT_TRUE(layout) << layout.error().text;
  const auto in_force = ReadModelInForce(text, "model.toml", *layout);
  EXPECT_TRUE(in_force) << in_force.error().text;
}

INSTANTIATE_TEST_SUITE_P(All, OddCampaign, testing::ValuesIn(kOdd),
                         [](const auto& odd) { return std::string(odd.param.name); });

TEST(OddCampaign, TellsTheUnitThatNoGeometryOfItsKindExplains) {
  const sim::Diagnosis diagnosis = sim::Diagnose(OneUnitIsAnother(), {});
  const std::uint32_t id = OneUnitIsAnother().units[2].id;
  EXPECT_THAT(diagnosis.without_geometry, ::testing::ElementsAre(id));
  EXPECT_THAT(diagnosis.remarks,
              ::testing::Contains(::testing::HasSubstr("puts unit " + std::to_string(id))));
  EXPECT_THAT(WriteModel(diagnosis, {}, OneUnitIsAnother()),
              ::testing::Not(::testing::HasSubstr("unit_id = " + std::to_string(id) + "\n")));
}

}  // namespace
}  // namespace focalfleet
