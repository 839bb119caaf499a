#include "daemon/campaign/campaign_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <sstream>
#include <string>
#include <vector>

#include "daemon/campaign/diagnosis_files.h"
#include "protocol/base/rng.h"
#include "sim/campaigns/planting/planted.h"

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

std::vector<std::string> Lines(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

std::string WhyNot(const std::string& moves, std::string_view units = kUnits) {
  const auto campaign = Read(moves, units);
  return campaign ? "it was read" : campaign.error().text;
}

TEST(CampaignFiles, SortsRowsByUnitAndMove) {
  TableNotes notes;
  const std::string moves = kHeader +
                            "9,1,0,10,0,20,5,1,nan,asymmetric,0.5\n"
                            "7,5,0,11,0,21,4,2,12.5,,\n"
                            "9,2,10,12,20,22,,,13,seven_segment,1\n"
                            "7,3,11,13,21,23,3,3,14,five_segment,2\n";
  const auto campaign = ReadCampaign({.moves = moves, .units = kUnits}, &notes);
  ASSERT_TRUE(campaign) << campaign.error().text;
  EXPECT_EQ(notes.rows_out_of_order, 1u);
  ASSERT_EQ(campaign->units.size(), 2u);
  EXPECT_EQ(campaign->units[0].id, 7u);
  EXPECT_EQ(campaign->units[0].rail, 2);
  EXPECT_EQ(campaign->move_id, (std::vector<std::int64_t>{3, 5, 1, 2}));
  EXPECT_EQ(campaign->first_row, (std::vector<std::size_t>{0, 2, 4}));
  EXPECT_TRUE(std::isnan(campaign->x_mm[3]));
  EXPECT_EQ(campaign->Find("oil")[0], 2);
  EXPECT_TRUE(std::isnan(campaign->Find("temp_C")[2]));
  EXPECT_TRUE(campaign->Find("delay_s").empty());
  ASSERT_EQ(campaign->word_columns.size(), 1u);
  EXPECT_EQ(campaign->word_columns[0].name, "mode");
  EXPECT_EQ(campaign->word_columns[0].values, (std::vector<int>{1, -1, 0, 2}));
}

// Databases return rows in any order: descending, or by numbers as text.
TEST(CampaignFiles, AnyOrderOfRowsIsTheSameCampaign) {
  for (std::uint64_t seed = 1; seed <= 2; ++seed) {
    const auto planted =
        sim::PlantCampaign({.units = 12,
                            .moves = 40,
                            .seed = seed,
                            .homing_share = seed % 2 == 0 ? 0.1 : 0,
                            .effects = {{.cause = "backlash", .amplitude = 0.1, .axis = "phi"}}});
    ASSERT_TRUE(planted) << planted.error().text;
    const std::string units = WriteCampaignUnits(*planted);
    const std::string in_order = WriteMoves(*planted);
    const auto report = [&](const std::string& moves, std::size_t* out_of_order) {
      TableNotes notes;
      const auto campaign = ReadCampaign({.moves = moves, .units = units}, &notes);
      EXPECT_TRUE(campaign) << campaign.error().text;
      EXPECT_EQ(WriteMoves(*campaign), in_order);
      *out_of_order = notes.rows_out_of_order;
      const sim::Diagnosis diagnosis = sim::Diagnose(*campaign, {});
      return ReportJson(diagnosis, {}).dump() + WriteModel(diagnosis, {}, *campaign);
    };
    std::size_t out_of_order = 0;
    const std::string expected = report(in_order, &out_of_order);
    EXPECT_EQ(out_of_order, 0u);
    std::vector<std::string> lines = Lines(in_order);
    const auto joined = [&](const std::vector<std::string>& rows) {
      std::string text = lines.front() + "\n";
      for (const std::string& row : rows) text += row + "\n";
      return text;
    };
    std::vector<std::string> rows(lines.begin() + 1, lines.end());
    std::ranges::reverse(rows);
    EXPECT_EQ(report(joined(rows), &out_of_order), expected);
    EXPECT_EQ(out_of_order, 12 * 39u);
    std::ranges::stable_sort(rows, {}, [](const std::string& row) {
      const std::size_t comma = row.find(',') + 1;
      return row.substr(comma, row.find(',', comma) - comma);  // as text: move 10 before move 2
    });
    EXPECT_EQ(report(joined(rows), &out_of_order), expected);
    EXPECT_EQ(out_of_order, 96u);  // 2, 20, 21 .. and 3, 4 .. behind 10 to 19
    Rng rng = Rng::Stream(seed, "shuffled");
    for (std::size_t k = rows.size(); k > 1; --k) std::swap(rows[k - 1], rows[rng.Below(k)]);
    EXPECT_EQ(report(joined(rows), &out_of_order), expected);
    EXPECT_GT(out_of_order, 300u);
  }
}

TEST(CampaignFiles, TimesGoBeforeNumbersOfMoves) {
  const std::string header =
      "unit_id,move_id,theta_from_deg,theta_cmd_deg,phi_from_deg,phi_cmd_deg,x_mm,y_mm,t_s\n";
  const auto campaign = Read(header +
                             "7,1,20,30,0,0,1,1,300\n"
                             "7,2,0,10,0,0,1,1,100\n"
                             "7,3,10,20,0,0,1,1,200\n");
  ASSERT_TRUE(campaign) << campaign.error().text;
  EXPECT_EQ(campaign->move_id, (std::vector<std::int64_t>{2, 3, 1}));
  EXPECT_EQ(campaign->Find("t_s")[2], 300);
  EXPECT_THAT(WhyNot(header + "7,1,0,10,0,0,1,1,soon\n"),
              HasSubstr("moves.csv:2: column t_s: 'soon' is not a number"));
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

// Tables from a database or from pandas also have an index, names, dates, notes and flags.
TEST(CampaignFiles, ColumnsOfWordsArePassedOverAndThoseOfFlagsAreNumbers) {
  TableNotes notes;
  const std::string moves =
      ",unit_id,move_id,theta_from_deg,theta_cmd_deg,phi_from_deg,phi_cmd_deg,x_mm,y_mm,pos_id,"
      "date,rehomed,ok,flag,grease,load,Unnamed: 0,filter\n"
      "0,7,1,0,10,0,20,5,1,M00007,2026-03-17T03:04:05,True,True,T,,0.5,0,F\n"
      "1,9,1,0,10,0,20,5,1,M00009,2026-03-17T03:05:05,False,False,,2,high,1,G\n"
      "2,7,2,10,11,20,21,4,2,,,,nan,F,3,inf,2,R\n";
  const auto campaign = ReadCampaign({.moves = moves, .units = kUnits}, &notes);
  ASSERT_TRUE(campaign) << campaign.error().text;
  EXPECT_THAT(notes.ignored_of_moves,
              ElementsAre("column 1 (no name)", "pos_id", "date",
                          "load (not all numbers: 'high' in line 3)", "Unnamed: 0", "filter"));
  EXPECT_THAT(notes.ignored_of_units, IsEmpty());
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
  // A column is no rail if its name merely contains "rail_id", and a comment names no column.
  std::string units = std::string("# rail_id, bus_id: see the drawing\n\n") + kUnits;
  units.replace(units.find(",rail_id\n"), 9, ",guiderail_id\n");
  TableNotes notes;
  const std::string moves = kHeader + "9,1,0,10,0,20,5,1,1,,\n";
  const auto campaign = ReadCampaign({.moves = moves, .units = units}, &notes);
  ASSERT_TRUE(campaign) << campaign.error().text;
  EXPECT_TRUE(std::isnan(campaign->units[0].rail));
  EXPECT_THAT(notes.ignored_of_units, ElementsAre("guiderail_id"));
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
