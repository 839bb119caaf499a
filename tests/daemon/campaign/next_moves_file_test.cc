// next_moves.csv is written, read back and made by campaign run, and refused where it is wrong.
#include "daemon/campaign/next_moves_file.h"

#include <gmock/gmock.h>

#include <string>

#include "daemon/campaign/move_list.h"
#include "fleet/hex_layout.h"
#include "sim/campaigns/planting/planted.h"

namespace focalfleet {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

std::vector<sim::CampaignUnit> Units(std::size_t count) {
  return sim::PlantCampaign({.units = count, .moves = 1})->units;
}

const std::vector<sim::ProposedMove> kMoves = {
    {.theta_fp_deg = 0, .phi_fp_deg = 90, .separates = "backlash | load_angle_lag"},
    {.theta_fp_deg = 40, .phi_fp_deg = 90, .every = 2, .conditions = {.drive_amplitude = 0.6}},
    {.theta_fp_deg = 0, .phi_fp_deg = 90, .conditions = {.delay_s = 30, .home_first = true}}};

TEST(NextMovesFile, ReadsBackAsItWasWritten) {
  const auto units = Units(4);
  const auto read = ReadNextMoves(WriteNextMoves(units, kMoves), "next_moves.csv", units);
  ASSERT_TRUE(read) << read.error().text;
  const auto spread = sim::SpreadOver(units, kMoves);
  ASSERT_EQ(read->size(), spread.size());
  for (std::size_t m = 0; m < spread.size(); ++m) {
    EXPECT_EQ((*read)[m].to_deg, spread[m].to_deg) << m;
    EXPECT_EQ((*read)[m].conditions.drive_amplitude, spread[m].conditions.drive_amplitude);
    EXPECT_EQ((*read)[m].conditions.delay_s, spread[m].conditions.delay_s);
    EXPECT_EQ((*read)[m].conditions.home_first, spread[m].conditions.home_first);
  }
}

TEST(NextMovesFile, IsAListThatCampaignRunMakes) {
  const auto layout = Layout::Create(MakeHexLayout({.count = 4}), {});
  ASSERT_TRUE(layout);
  const std::string text = WriteNextMoves(Units(4), kMoves);
  const auto read = ReadMoveList(text, "next_moves.csv", *layout);
  ASSERT_TRUE(read) << read.error().text;
  EXPECT_THAT(read->ignored_columns, IsEmpty());
  ASSERT_EQ(read->moves.size(), 3u);
  EXPECT_EQ(read->moves[0].rows.size(), 4u);
  EXPECT_EQ(read->moves[1].rows.size(), 2u);
  const auto asked = ConditionsAsked(text, "next_moves.csv");
  ASSERT_TRUE(asked) << asked.error().text;
  EXPECT_THAT(*asked, ElementsAre("drive_amplitude in 1 move, first in move 2",
                                  "delay_s in 1 move, first in move 3",
                                  "rehomed in 1 move, first in move 3"));
  const auto plain = ConditionsAsked("move_id,unit_id,theta_deg,phi_deg\n1,1,0,90\n", "list.csv");
  ASSERT_TRUE(plain);
  EXPECT_THAT(*plain, IsEmpty());
}

TEST(NextMovesFile, WhatIsWrongIsRefusedByItsLine) {
  const auto units = Units(2);
  const std::string head = "move_id,unit_id,theta_deg,phi_deg,drive_amplitude\n";
  const auto error = [&](const std::string& rows) {
    const auto read = ReadNextMoves(head + rows, "next.csv", units);
    return read ? std::string("read") : read.error().text;
  };
  EXPECT_EQ(error("1,1,0,90,1\n1,2,0,90,1\n"), "read");
  EXPECT_THAT(error("1,1,0,90,1\n1,9,0,90,1\n"), HasSubstr("next.csv:3"));
  EXPECT_THAT(error("1,1,0,90,1\n1,1,0,90,1\n"), HasSubstr("unit 1 is twice in move 1"));
  EXPECT_THAT(error("1,1,0,90,1\n1,2,0,90,0.6\n"), HasSubstr("other conditions"));
  EXPECT_THAT(error("1,1,north,90,1\n"), HasSubstr("theta_deg"));
}

}  // namespace
}  // namespace focalfleet
