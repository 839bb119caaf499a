// The fields of report.json and the rows of units_by_class.csv, from a diagnosis that is made by
// hand.
#include "daemon/campaign/diagnosis_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "daemon/campaign/class_table.h"
#include "sim/campaigns/diagnosis/decide/decide.h"

namespace focalfleet {
namespace {

using nlohmann::json;

sim::Diagnosis WithCause(const sim::CauseFound& cause) {
  sim::Diagnosis diagnosis;
  diagnosis.causes = {cause};
  return diagnosis;
}

json CauseOf(const sim::Diagnosis& diagnosis) { return ReportJson(diagnosis, {})["causes"][0]; }

TEST(ReportJson, SharesAProbabilityOutAmongTheCandidates) {
  sim::CauseFound cause = sim::CauseNamed("backlash");
  EXPECT_EQ(CauseOf(WithCause(cause))["posterior"], json::object({{"backlash", 1.0}}));
  // Nothing is known of the third: it is as probable as the cause.
  cause.candidates = {"backlash", "friction_windup", "load_angle_lag", "stiction"};
  cause.log_odds = {{"friction_windup", -sim::kTemperature * std::log(4)},
                    {"stiction", -2000},
                    {"relaxation", 0}};
  const json posterior = CauseOf(WithCause(cause))["posterior"];
  EXPECT_EQ(posterior.size(), 4u) << posterior;
  EXPECT_NEAR(posterior["backlash"], 4.0 / 9, 1e-12);
  EXPECT_NEAR(posterior["friction_windup"], 1.0 / 9, 1e-12);
  EXPECT_NEAR(posterior["load_angle_lag"], 4.0 / 9, 1e-12);
  EXPECT_EQ(posterior["stiction"], 0.0);
}

TEST(ReportJson, LeavesADoubtThatNoCandidateIsRight) {
  sim::CauseFound cause = sim::CauseNamed("backlash");
  cause.doubt = 0.25;
  EXPECT_EQ(CauseOf(WithCause(cause))["posterior"], json::object({{"backlash", 0.75}}));
  cause.candidates = {"backlash", "friction_windup"};
  EXPECT_NEAR(CauseOf(WithCause(cause))["posterior"]["friction_windup"], 0.375, 1e-12);
}

TEST(ReportJson, SaysWhereAnAmplitudeMeetsItsBound) {
  sim::CauseFound cause = sim::CauseNamed("gear_scale");
  EXPECT_EQ(CauseOf(WithCause(cause))["at_bound"], false);
  cause.at_bound = true;
  EXPECT_EQ(CauseOf(WithCause(cause))["at_bound"], true);
}

sim::Diagnosis WithAxes() {
  sim::Diagnosis diagnosis;
  diagnosis.axes = {{.unit_id = 7,
                     .axis = sim::kTheta,
                     .is = sim::AxisClass::kScale,
                     .scale_cw = 0.61234,
                     .scale_ccw = 1,
                     .stalls = 2,
                     .wraps = 1,
                     .moves = 40,
                     .rms_um = 1234.56},
                    {.unit_id = 7,
                     .axis = sim::kPhi,
                     .is = sim::AxisClass::kStuck,
                     .stalls = 38,
                     .moves = 39,
                     .stuck_at_deg = -12.346,
                     .rms_um = 1234.56},
                    {.unit_id = 9,
                     .axis = sim::kTheta,
                     .is = sim::AxisClass::kStuck,
                     .stuck_at_deg = 3,
                     .rms_um = std::numeric_limits<double>::quiet_NaN()},
                    {.unit_id = 9, .axis = sim::kPhi, .is = sim::AxisClass::kUnknown}};
  return diagnosis;
}

TEST(UnitsByClass, HaveARowForEachUnitAndAxis) {
  EXPECT_EQ(WriteUnitsByClass(WithAxes()),
            "unit_id,axis,class,scale_cw,scale_ccw,stalls,stuck_at_deg,wraps,rms_um,moves\n"
            "7,theta,scale,0.6123,1.0000,2,,1,1234.6,40\n"
            "7,phi,stuck,,,38,-12.35,0,1234.6,39\n"
            "9,theta,stuck,,,0,3.00,0,,0\n"
            "9,phi,unknown,,,0,,0,0.0,0\n");
}

TEST(UnitsByClass, AreATableOfThoseToRepair) {
  EXPECT_EQ(
      ClassRows(WithAxes().axes),
      (std::vector<std::vector<std::string>>{
          {"scale", "1", "theta 7"}, {"stuck", "2", "phi 7, theta 9"}, {"unknown", "1", ""}}));
  const std::vector<sim::AxisReport> many(11, {.unit_id = 3, .is = sim::AxisClass::kSlipping});
  EXPECT_THAT(ClassRows(many)[0][2], testing::EndsWith("theta 3, theta 3 and 3 more"));
}

TEST(UnitsByClass, AreCountedInTheReport) {
  EXPECT_EQ(ReportJson(WithAxes(), {})["units_by_class"],
            json::object({{"scale", 1}, {"stuck", 2}, {"unknown", 1}}));
  EXPECT_EQ(ReportJson({}, {})["units_by_class"], json::object());
}

}  // namespace
}  // namespace focalfleet
