// Contrived verdicts test the score: they must give figures that can be counted by hand.
#include "tests/hidden/score/score.h"

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

namespace focalfleet::hidden {
namespace {

using Json = nlohmann::json;

Json Effect(const std::string& cause, double lambda) {
  return {{"cause", cause},
          {"axis", "theta"},
          {"scope", "unit"},
          {"scope_also", {"plate"}},
          {"units", "all"},
          {"lambda_per_freedom", lambda},
          {"survival", 0.9},
          {"rms_um", 10},
          {"rms_left_um", 8},
          {"equivalent", Json::array()},
          {"inseparable", Json::array()},
          {"missing_columns", Json::array()}};
}
Json KeyOf(const std::string& kind, const std::vector<Json>& effects) {
  return {{"kind", kind},
          {"class", "clean"},
          {"design", "diagnostic"},
          {"effects", effects},
          {"also_true", Json::array()},
          {"static", {{"planted", false}, {"lambda", Json::object()}}},
          {"oracle", {{"rms_before_um", 10.0}, {"rms_after_um", 6.0}}}};
}
Json Cause(const std::string& cause, const std::vector<std::string>& candidates = {}) {
  return {{"cause", cause},  {"candidates", candidates.empty() ? Json{cause} : Json(candidates)},
          {"axis", "theta"}, {"scope", "unit"},
          {"units", "all"},  {"rms_um", 9}};
}
Json ReportOf(const std::string& verdict, const std::vector<Json>& causes) {
  return {{"verdict", verdict},
          {"causes", causes},
          {"unknown", Json::array()},
          {"not_testable", Json::array()},
          {"gain", {{"rms_before_um", 10.0}, {"rms_after_um", 6.0}}}};
}
Case CaseOf(const Json& key, const Json& report) {
  auto one = ReadCase("c", key.dump(), report.dump());
  EXPECT_TRUE(one.has_value());
  return std::move(*one);
}
Figure Of(const Score& score, const std::string& id) {
  for (const Figure& figure : score.figures)
    if (figure.id == id) return figure;
  ADD_FAILURE() << "no figure " << id;
  return {};
}
void ExpectShare(const Score& score, const std::string& id, int hits, int trials) {
  const Figure figure = Of(score, id);
  EXPECT_EQ(figure.hits, hits) << id;
  EXPECT_EQ(figure.trials, trials) << id;
}

TEST(HiddenIntervals, AreTheTextbooks) {
  // With no hit in n the exact bound is 1 - 0.025^(1/n).
  EXPECT_NEAR(ClopperPearson(0, 300).high, 1 - std::pow(0.025, 1.0 / 300), 1e-9);
  EXPECT_EQ(ClopperPearson(0, 300).low, 0);
  EXPECT_NEAR(ClopperPearson(300, 300).low, std::pow(0.025, 1.0 / 300), 1e-9);
  EXPECT_NEAR(ClopperPearson(5, 10).low, 0.187086, 1e-5);  // tables of the binomial
  EXPECT_NEAR(ClopperPearson(5, 10).high, 0.812914, 1e-5);
  EXPECT_NEAR(Wilson(50, 100).low, 0.403832, 1e-5);
  EXPECT_NEAR(Wilson(50, 100).high, 0.596168, 1e-5);
  EXPECT_EQ(Wilson(0, 0).high, 1);
}

TEST(HiddenScore, CountsFalseNamesOnNulls) {
  Json moved = KeyOf("null", {});
  moved["static"] = {{"planted", true}, {"lambda", {{"zero_offset", 500.0}, {"arm_length", 3.0}}}};
  Json shaken = KeyOf("null", {});
  shaken["class"] = "dirty";
  shaken["also_true"] = {"air_turbulence"};
  const Score score = ScoreCases({
      CaseOf(KeyOf("null", {}), ReportOf("consistent", {})),
      CaseOf(KeyOf("null", {}), ReportOf("explained", {Cause("backlash")})),
      CaseOf(KeyOf("null", {}), ReportOf("explained", {Cause("zero_offset")})),
      CaseOf(moved, ReportOf("explained", {Cause("zero_offset")})),
      CaseOf(shaken, ReportOf("explained", {Cause("air_turbulence")})),
      CaseOf(shaken, ReportOf("ambiguous", {Cause("wear", {"wear", "gear_scale"})})),
  });
  ExpectShare(score, "null_clean", 1, 4);
  ExpectShare(score, "null_dirty", 1, 2);
  ExpectShare(score, "null_unknown", 0, 6);
  ExpectShare(score, "static_false", 1, 5);
  ExpectShare(score, "static_found", 1, 1);
}

TEST(HiddenScore, TellsExactFromAmbiguousFromWrong) {
  const Json key = KeyOf("single", {Effect("backlash", 150)});
  const Score score = ScoreCases({
      CaseOf(key, ReportOf("explained", {Cause("backlash")})),
      CaseOf(key, ReportOf("explained", {Cause("zero_offset"), Cause("backlash")})),
      CaseOf(key, ReportOf("ambiguous", {Cause("backlash", {"backlash", "relaxation"})})),
      CaseOf(key, ReportOf("ambiguous", {Cause("wear", {"wear", "backlash"})})),
      CaseOf(key, ReportOf("explained", {Cause("relaxation")})),
      CaseOf(key, ReportOf("unknown", {})),
      CaseOf(key, ReportOf("consistent", {})),
      CaseOf(key, ReportOf("explained", {Cause("backlash"), Cause("wear")})),
  });
  ExpectShare(score, "exact_bin_100", 2, 8);
  ExpectShare(score, "exact_100", 2, 8);
  ExpectShare(score, "first_100", 4, 8);
  ExpectShare(score, "class_100", 4, 8);
  ExpectShare(score, "detected_bin_100", 7, 8);
  ExpectShare(score, "wrong_and_sure", 2, 8);
  ExpectShare(score, "coverage_50", 5, 6);
  EXPECT_NEAR(Of(score, "set_size_50").value, 8.0 / 6, 1e-12);
  EXPECT_EQ(score.worst.size(), 2u);
  EXPECT_EQ(score.confusion.at("backlash").at("backlash"), 4);
  EXPECT_EQ(score.confusion.at("backlash").at("(unknown)"), 1);
  EXPECT_EQ(score.confusion.at("backlash").at("(nothing)"), 1);
}

TEST(HiddenScore, WhatNobodyCouldTellApartIsNotAskedExactly) {
  Json twin = Effect("load_angle_lag", 400);
  twin["equivalent"] = {"backlash"};
  const Json key = KeyOf("single", {twin});
  const Score score = ScoreCases({
      CaseOf(key, ReportOf("explained", {Cause("backlash")})),
      CaseOf(key, ReportOf("ambiguous", {Cause("backlash", {"backlash", "load_angle_lag"})})),
      CaseOf(key, ReportOf("explained", {Cause("load_angle_lag")})),
  });
  ExpectShare(score, "exact_100", 0, 0);
  ExpectShare(score, "wrong_and_sure", 0, 3);
  ExpectShare(score, "equivalent_told", 1, 2);
  ExpectShare(score, "coverage_50", 2, 3);
}

TEST(HiddenScore, CompositesByClass) {
  const Json key = KeyOf("composite", {Effect("backlash", 200), Effect("wear", 300)});
  const Json weak = KeyOf("composite", {Effect("backlash", 200), Effect("wear", 30)});
  const Score score = ScoreCases({
      CaseOf(key, ReportOf("explained", {Cause("relaxation"), Cause("wear")})),
      CaseOf(key, ReportOf("explained", {Cause("backlash")})),
      CaseOf(key, ReportOf("explained", {Cause("backlash"), Cause("wear"), Cause("cogging")})),
      CaseOf(weak, ReportOf("consistent", {})),
  });
  ExpectShare(score, "composite_2", 1, 3);
  ExpectShare(score, "composite_recall", 5, 6);
  ExpectShare(score, "composite_precision", 5, 6);
}

TEST(HiddenScore, UnknownsFlaggedAndMisnamed) {
  Json effect = Effect("other_wind", 400);
  effect["covariates"] = {"wind"};
  const Json key = KeyOf("unknown", {effect});
  Json right = ReportOf("unknown", {});
  right["unknown"] = {{{"covariate", "wind_m_s"}, {"p_value", 0.001}, {"rms_um", 3}}};
  Json elsewhere = right;
  elsewhere["unknown"][0]["covariate"] = "phi_cmd_deg";
  const Score score = ScoreCases({
      CaseOf(key, right),
      CaseOf(key, elsewhere),
      CaseOf(key, ReportOf("explained", {Cause("wear")})),
      CaseOf(key, ReportOf("consistent", {})),
  });
  ExpectShare(score, "unknown_flagged_250", 2, 4);
  ExpectShare(score, "unknown_misnamed_250", 1, 4);
  ExpectShare(score, "unknown_covariate", 1, 2);
}

TEST(HiddenScore, GainIsHeldAgainstTheOracles) {
  const Json key = KeyOf("single", {Effect("backlash", 150)});  // oracle: 10 to 6, 64 %
  Json half = ReportOf("explained", {Cause("backlash")});
  half["gain"] = {{"rms_before_um", 10.0}, {"rms_after_um", std::sqrt(68.0)}};  // 32 %
  Json worse = half;
  worse["gain"]["rms_after_um"] = 11.0;
  const Score score =
      ScoreCases({CaseOf(key, ReportOf("explained", {Cause("backlash")})), CaseOf(key, half)});
  EXPECT_NEAR(Of(score, "gain_single").value, 0.75, 1e-9);
  EXPECT_NEAR(Of(score, "size_ratio").value, 0.9, 1e-9);
  EXPECT_NEAR(Of(score, "size_ratio_left").value, 9.0 / 8, 1e-9);
  ExpectShare(score, "gain_negative", 0, 2);
  ExpectShare(ScoreCases({CaseOf(key, worse)}), "gain_negative", 1, 1);
  ExpectShare(score, "scope", 2, 2);
  ExpectShare(score, "axis", 2, 2);
}

TEST(HiddenScore, MissingColumnsMustBeReported) {
  Json effect = Effect("gravity_sag", 500);
  effect["missing_columns"] = {"elevation_deg"};
  const Json key = KeyOf("single", {effect});
  Json reported = ReportOf("unknown", {});
  reported["not_testable"] = {{{"cause", "gravity_sag"}, {"why", "no elevation_deg"}}};
  const Score score = ScoreCases({CaseOf(key, reported), CaseOf(key, ReportOf("unknown", {}))});
  ExpectShare(score, "not_testable", 1, 2);
  ExpectShare(score, "exact_100", 0, 0);
}

TEST(HiddenScore, ABrokenReportCountsAsNone) {
  const Json key = KeyOf("single", {Effect("backlash", 150)});
  for (const char* text :
       {"", "{", "[]", "null", "3", R"({"verdict": 7})", R"({"causes": [1, {"cause": 3}]})",
        R"({"verdict": "explained", "causes": {"a": 1}, "gain": 4, "unknown": "no"})",
        R"({"verdict": "explained", "causes": [1, null, {"candidates": "x", "units": [{}]}]})"}) {
    const auto one = ReadCase("c", key.dump(), text);
    ASSERT_TRUE(one.has_value()) << text;
    const Score score = ScoreCases({*one});
    EXPECT_EQ(Of(score, "exact_100").hits, 0) << text;
    EXPECT_FALSE(TablesOf(score).empty());
    EXPECT_TRUE(Json::accept(JsonOf(score)));
  }
  ExpectShare(ScoreCases({*ReadCase("c", key.dump(), "{")}), "reports", 0, 1);
  EXPECT_FALSE(ReadCase("c", "{}", "{}").has_value());
}

TEST(HiddenScore, RequirementsAreMetOrNot) {
  const Figure figure{.id = "exact_100", .value = 0.95, .hits = 95, .trials = 100};
  const auto at_least = ParseRequirement("exact_100>=0.97");
  ASSERT_TRUE(at_least.has_value());
  EXPECT_EQ(at_least->id, "exact_100");
  EXPECT_FALSE(Meets(figure, *at_least, false));
  EXPECT_TRUE(Meets(figure, *at_least, true));  // 95 of 100 may well be 97 %
  const auto at_most = ParseRequirement("exact_100<=0.9");
  ASSERT_TRUE(at_most.has_value());
  EXPECT_FALSE(Meets(figure, *at_most, false));
  EXPECT_TRUE(Meets(figure, *at_most, true));
  EXPECT_FALSE(Meets({.id = "exact_100"}, *at_least, true)) << "nothing was tried";
  for (const char* text : {"", "exact", "exact>0.9", ">=1", "exact>=", "exact>=much"})
    EXPECT_FALSE(ParseRequirement(text).has_value()) << text;
}

// Two names of 0.9 of which one is right, and their rivals of 0.1 of which one is right.
TEST(HiddenScore, StatedProbabilitiesAreComparedWithWhatIsRight) {
  const auto named = [](const std::string& first, const std::string& second) {
    Json cause = Cause(first, {first, second});
    cause["posterior"] = {{first, 0.9}, {second, 0.1}};
    return cause;
  };
  const Json key = KeyOf("single", {Effect("backlash", 300)});
  Json geometry = Cause("zero_offset");
  geometry["posterior"] = {{"zero_offset", 1.0}};
  const Score score =
      ScoreCases({CaseOf(key, ReportOf("ambiguous", {named("backlash", "stiction"), geometry})),
                  CaseOf(key, ReportOf("ambiguous", {named("stiction", "backlash")}))});
  EXPECT_EQ(score.reliability[9].count, 2) << "0.9, without the geometry";
  EXPECT_EQ(score.reliability[9].right, 1);
  EXPECT_EQ(score.reliability[1].count, 2);
  EXPECT_EQ(score.reliability[1].right, 1);
  EXPECT_NEAR(score.reliability[9].stated(), 0.9, 1e-12);
  EXPECT_NEAR(Of(score, "calibration_error").value, 0.4, 1e-12);
  EXPECT_EQ(Of(ScoreCases({CaseOf(key, ReportOf("consistent", {}))}), "calibration_error").trials,
            0);
  EXPECT_NE(PictureOf(score.reliability).find("<circle cx=\"330.0\" cy=\"170.0\""),
            std::string::npos)
      << "0.9, of which a half is right";
}

}  // namespace
}  // namespace focalfleet::hidden
