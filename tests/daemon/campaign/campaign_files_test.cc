#include "daemon/campaign/campaign_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

namespace focalfleet {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::IsNan;

constexpr const char* kUnits =
    "unit_id,base_x_mm,base_y_mm,arm_theta_mm,arm_phi_mm,theta_zero_deg,phi_zero_deg,theta_gear,"
    "phi_gear,theta_min_deg,theta_max_deg,phi_min_deg,phi_max_deg,rail_id\n"
    "7,0,0,3,3,0,0,337,337,-190,190,0,180,2\n"
    "9,30,0,3,3,0,0,337,337,-190,190,0,180,\n"
    "8,60,0,3,3,0,0,337,337,-190,190,0,180,1\n";
const std::string kHeader =
    "unit_id,move_id,theta_from_deg,theta_cmd_deg,phi_from_deg,phi_cmd_deg,x_mm,y_mm,temp_C,mode,"
    "oil\n";

Result<sim::Campaign> Read(const std::string& moves, std::string_view units = kUnits) {
  return ReadCampaign({.moves = moves, .units = units});
}

std::string WhyNot(const std::string& moves, std::string_view units = kUnits) {
  const auto campaign = Read(moves, units);
  return campaign ? "it was read" : campaign.error().text;
}

TEST(CampaignFiles, SortsRowsByUnitAndKeepsTheirOrder) {
  const auto campaign = Read(kHeader +
                             "9,1,0,10,0,20,5,1,nan,asymmetric,0.5\n"
                             "7,5,0,11,0,21,4,2,12.5,,\n"
                             "9,2,10,12,20,22,,,13,seven_segment,1\n"
                             "7,3,11,13,21,23,3,3,14,five_segment,2\n");
  ASSERT_TRUE(campaign) << campaign.error().text;
  ASSERT_EQ(campaign->units.size(), 2u);
  EXPECT_EQ(campaign->units[0].id, 7u);
  EXPECT_EQ(campaign->units[0].rail, 2);
  EXPECT_EQ(campaign->move_id, (std::vector<std::int64_t>{5, 3, 1, 2}));
  EXPECT_EQ(campaign->first_row, (std::vector<std::size_t>{0, 2, 4}));
  EXPECT_TRUE(std::isnan(campaign->x_mm[3]));
  EXPECT_EQ(campaign->Find("oil")[1], 2);
  EXPECT_TRUE(std::isnan(campaign->Find("temp_C")[2]));
  EXPECT_TRUE(campaign->Find("delay_s").empty());
  EXPECT_EQ(campaign->FindWords("mode")->values, (std::vector<int>{-1, 1, 0, 2}));
}

TEST(CampaignFiles, ReadsBackWhatItWrites) {
  const auto first = Read(kHeader +
                          "9,1,0,10.25,0,20,5.125,1,nan,asymmetric,0.5\n"
                          "7,5,0,11,0,21,,,12.5,,\n");
  ASSERT_TRUE(first);
  const std::string moves = WriteMoves(*first);
  const std::string units = WriteCampaignUnits(*first);
  const auto second = Read(moves, units);
  ASSERT_TRUE(second) << second.error().text;
  EXPECT_EQ(WriteMoves(*second), moves);
  EXPECT_EQ(WriteCampaignUnits(*second), units);
}

// As a table comes out of a database or out of pandas: an index, names, dates, notes, flags.
TEST(CampaignFiles, ColumnsOfWordsArePassedOverAndThoseOfFlagsAreNumbers) {
  PassedOver passed_over;
  const std::string moves =
      ",unit_id,move_id,theta_from_deg,theta_cmd_deg,phi_from_deg,phi_cmd_deg,x_mm,y_mm,pos_id,"
      "date,rehomed,ok,flag,grease,load,Unnamed: 0,filter\n"
      "0,7,1,0,10,0,20,5,1,M00007,2026-03-17T03:04:05,True,True,T,,0.5,0,F\n"
      "1,9,1,0,10,0,20,5,1,M00009,2026-03-17T03:05:05,False,False,,2,high,1,G\n"
      "2,7,2,10,11,20,21,4,2,,,,nan,F,3,inf,2,R\n";
  const auto campaign = ReadCampaign({.moves = moves, .units = kUnits}, &passed_over);
  ASSERT_TRUE(campaign) << campaign.error().text;
  EXPECT_THAT(passed_over.of_moves,
              ElementsAre("column 1 (no name)", "pos_id", "date",
                          "load (not all numbers: 'high' in line 3)", "Unnamed: 0", "filter"));
  EXPECT_THAT(passed_over.of_units, IsEmpty());
  const auto values = [&](const char* name) {
    const auto found = campaign->Find(name);
    return std::vector<double>(found.begin(), found.end());
  };
  EXPECT_THAT(values("rehomed"), ElementsAre(1, IsNan(), 0));
  EXPECT_THAT(values("ok"), ElementsAre(1, IsNan(), 0));
  EXPECT_THAT(values("flag"), ElementsAre(1, 0, IsNan()));
  EXPECT_THAT(values("grease"), ElementsAre(IsNan(), 3, 2));
  EXPECT_TRUE(campaign->Find("load").empty());
}

TEST(CampaignFiles, AWordInAColumnThatIsKnownStaysRefused) {
  for (const char* column :
       {"t_s", "sigma_um", "rehomed", "from_measured", "frame_id", "temp_C", "v_bus_V",
        "elevation_deg", "rail_id", "rail_slot", "movers_on_rail", "bus_id", "bus_slot", "delay_s",
        "drive_amplitude", "counter1", "repeat", "cycles_theta", "cycles_phi"}) {
    const std::string text =
        "unit_id,move_id,theta_from_deg,theta_cmd_deg,phi_from_deg,phi_cmd_deg,x_mm,y_mm," +
        std::string(column) + "\n9,1,0,10,0,20,5,1,high\n";
    EXPECT_THAT(WhyNot(text), HasSubstr("moves.csv:2: column " + std::string(column) + ": 'high'"));
  }
}

TEST(CampaignFiles, TellsAllBadRows) {
  EXPECT_EQ(
      WhyNot(kHeader + "9,1,0,10,0,20,5,1,warm,,\n9,2,0,,0,20,5,1,1,,\n9,3,0,1,0,2,5,1,1,fast,\n"
                       "6,1,0,10,0,20,5,1,1,,\n9,4,0,1,0,2,5,1,1,,\n9,4,0,1,0,2,5,1,1,,\n"),
      "moves.csv:2: column temp_C: 'warm' is not a number\n"
      "  moves.csv:3: column theta_cmd_deg: the value is missing (empty or nan)\n"
      "  moves.csv:4: column mode: 'fast' is not asymmetric, five_segment or seven_segment\n"
      "  moves.csv:5: column unit_id: unit 6 is not in units.csv\n"
      "  moves.csv:7: column move_id: unit 9 has move 4 twice, first in line 6");
}

TEST(CampaignFiles, ColumnsOfUnitsAreThoseOfTheHeader) {
  // Nobody else's column whose name holds "rail_id", and not what a comment says.
  std::string units = std::string("# rail_id, bus_id: see the drawing\n\n") + kUnits;
  units.replace(units.find(",rail_id\n"), 9, ",guiderail_id\n");
  PassedOver passed_over;
  const std::string moves = kHeader + "9,1,0,10,0,20,5,1,1,,\n";
  const auto campaign = ReadCampaign({.moves = moves, .units = units}, &passed_over);
  ASSERT_TRUE(campaign) << campaign.error().text;
  EXPECT_TRUE(std::isnan(campaign->units[0].rail));
  EXPECT_THAT(passed_over.of_units, ElementsAre("guiderail_id"));
}

TEST(CampaignFiles, NamesFileLineAndColumnOfWhatIsWrong) {
  EXPECT_THAT(WhyNot(kHeader + "9,1,0,10,0,20,5,1,warm,,\n"),
              HasSubstr("moves.csv:2: column temp_C: 'warm' is not a number"));
  EXPECT_THAT(WhyNot(kHeader + "9,1,0,10,0,20,5,1,1,,\n9,1,0,,0,20,5,1,1,,\n"),
              HasSubstr("moves.csv:3: column theta_cmd_deg: the value is missing"));
  EXPECT_THAT(WhyNot(kHeader + "9,1,0,10,0,20,5,1,1,,\n9,1,0,10,0,20,5,1,1,,\n"),
              HasSubstr("moves.csv:3: column move_id: unit 9 has move 1 twice, first in line 2"));
  EXPECT_THAT(WhyNot(kHeader + "6,1,0,10,0,20,5,1,1,,\n"),
              HasSubstr("column unit_id: unit 6 is not in units.csv"));
  EXPECT_THAT(WhyNot(kHeader + "9,1,0,10,0,20,5,,1,,\n"), HasSubstr("column y_mm: the other"));
  EXPECT_THAT(WhyNot(kHeader + "9,1,0,10,0,20,5,1,1,fast,\n"), HasSubstr("column mode: 'fast'"));
  EXPECT_THAT(WhyNot(kHeader + "9,1,0,1e9,0,20,5,1,1,,\n"), HasSubstr("column theta_cmd_deg"));
  EXPECT_THAT(WhyNot(kHeader), HasSubstr("no moves"));
  EXPECT_THAT(WhyNot("unit_id,move_id\n1,2\n"), HasSubstr("y_mm is missing"));
  EXPECT_THAT(WhyNot(kHeader + "9,1,0,10,0,20,5,1"), HasSubstr("cut short"));
}

}  // namespace
}  // namespace focalfleet
