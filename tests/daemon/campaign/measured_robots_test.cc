// Moves that real robots made in service and on a bench, with the loop closed: the causes are found
// that independent fits of the same moves found, and each robot gets the class that it got by hand.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <string>

#include "daemon/campaign/campaign_files.h"
#include "daemon/files/text_file.h"
#include "fleet/files/csv.h"
#include "sim/campaigns/diagnosis/decide/diagnosis.h"
#include "sim/campaigns/diagnosis/use/axis_classes.h"

namespace focalfleet {
namespace {

using testing::Contains;
using testing::ElementsAre;

sim::Campaign Measured(const std::string& folder) {
  const std::string path = FOCALFLEET_MEASURED_DATA "/" + folder;
  const std::string moves = ReadTextFile(path + "/moves.csv").value();
  const std::string units = ReadTextFile(path + "/units.csv").value();
  return ReadCampaign({.moves = moves, .units = units}).value();
}

// 13 sessions of one robot, 100 mm apart on the plate of the table. Both axes turn 2 degrees less a
// move than the bench subtracted for ramps, and lose 1.6 and 1.4 degrees where they turn back.
TEST(MeasuredRobots, TravelOfRampsAndPlayAreFoundInAClosedLoop) {
  const sim::Diagnosis diagnosis = sim::Diagnose(Measured("desi-4852-xy-may/sent"), {});
  ASSERT_GE(diagnosis.causes.size(), 2u);
  // Which of the two comes first is a matter of how the evidence is shared out between them.
  const bool travel_first = diagnosis.causes[0].cause == "ramp_travel";
  const sim::CauseFound& travel = diagnosis.causes[travel_first ? 0 : 1];
  const sim::CauseFound& play = diagnosis.causes[travel_first ? 1 : 0];
  EXPECT_THAT(travel.candidates, ElementsAre("ramp_travel"));
  EXPECT_EQ(travel.axis, "both");
  EXPECT_THAT(play.candidates, Contains("backlash"));
  EXPECT_LT(diagnosis.gain.rms_after_um, 0.1 * diagnosis.gain.rms_before_um);
}

// Theta of 146 robots of which many slip. `by-hand.csv`: an independent robust fit. A robot slips
// there that turns another share of what it is asked, with stalls or without.
TEST(MeasuredRobots, ThetaIsOfTheClassAndScaleThatItGotByHand) {
  const sim::Campaign campaign = Measured("desi-lintheta/motor");
  std::map<std::uint32_t, sim::AxisReport> theta;
  for (const sim::AxisReport& axis : sim::ClassifyAxes(campaign, campaign.units))
    if (axis.axis == sim::kTheta) theta[axis.unit_id] = axis;
  const std::string file = FOCALFLEET_MEASURED_DATA "/desi-lintheta/by-hand.csv";
  const CsvTable by_hand = CsvTable::Parse(ReadTextFile(file).value(), file).value();
  int robots = 0, alike = 0, scales = 0, near = 0;
  ASSERT_TRUE(by_hand.ReadRows([&](CsvRow& row) {
    const sim::AxisReport& axis =
        theta.at(static_cast<std::uint32_t>(row.Integer("unit_id", {0, UINT32_MAX})));
    const std::string by = row.Text("class");
    const bool slips = axis.is == sim::AxisClass::kScale || axis.is == sim::AxisClass::kSlipping;
    ++robots;
    alike += by == "healthy" ? axis.is == sim::AxisClass::kHealthy
             : by == "dead"  ? axis.is == sim::AxisClass::kStuck
                             : by == "slipping" && slips;
    if (row.Number("stalls") > 0) return;
    for (const auto& [column, scale] :
         {std::pair{"scale_cw", axis.scale_cw}, {"scale_ccw", axis.scale_ccw}}) {
      const auto expected = row.NumberIfAny(column);
      if (!expected) continue;
      ++scales;
      near += scale && std::abs(*scale - *expected) < 0.03;
    }
  }));
  EXPECT_EQ(robots, 146);
  EXPECT_GE(alike, 0.9 * robots);
  EXPECT_GE(near, 0.95 * scales);
  RecordProperty("alike", alike);
  RecordProperty("near", near);
}

}  // namespace
}  // namespace focalfleet
