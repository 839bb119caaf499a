#include "daemon/campaign/campaign_log.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "daemon/campaign/campaign_files.h"
#include "fleet/hex_layout.h"

namespace focalfleet {
namespace {

LoggedMove Row(std::uint32_t unit, std::int64_t move, double from_deg, double to_deg) {
  return {.unit = {unit},
          .move = move,
          .from = {from_deg, 20},
          .to = {to_deg, 20},
          .x_mm = 1,
          .y_mm = 2,
          .sigma_um = 3,
          .t_s = 10.0 * static_cast<double>(move),
          .delay_s = unit == 1 ? 0.5 : std::numeric_limits<double>::quiet_NaN(),
          .v_bus_V = 1.8,
          .counter1 = 500,
          .repeat = 100.0 + unit,
          .mode = unit == 1 ? "asymmetric" : "seven_segment"};
}

TEST(CampaignLog, HasEveryCovariateOfTheFormatThatIsKnownAndReadsBack) {
  // The layout has four units: two share a bus, three a rail.
  const auto layout =
      Layout::Create(MakeHexLayout({.count = 4, .units_per_bus = 2, .units_per_rail = 3}), {});
  ASSERT_TRUE(layout);
  const auto units_on_plate = layout->units();
  const auto beside = std::ranges::find_if(units_on_plate.subspan(1), [&](const Unit& unit) {
    return unit.rail == units_on_plate[0].rail;
  });
  ASSERT_NE(beside, units_on_plate.end());
  const std::uint32_t one = units_on_plate[0].id.value, other = beside->id.value;
  CampaignLog log(&*layout);
  log.Add({Row(one, 1, 0, 90), Row(other, 1, 0, 0)});
  log.Add({Row(one, 2, 90, -90), Row(other, 2, 0, 180)});
  const sim::Campaign campaign = log.Campaign("night");
  ASSERT_EQ(campaign.rows(), 4u);
  for (const char* name : {"t_s", "sigma_um", "delay_s", "rail_id", "rail_slot", "bus_id",
                           "bus_slot", "movers_on_rail", "v_bus_V", "counter1", "repeat",
                           "drive_amplitude", "cycles_theta", "cycles_phi"})
    EXPECT_EQ(campaign.Find(name).size(), 4u) << name;
  EXPECT_EQ(campaign.Find("repeat")[0], 100 + one);
  EXPECT_EQ(campaign.Find("repeat")[2], 100 + other);
  EXPECT_EQ(campaign.Find("delay_s")[0], 0.5);
  EXPECT_TRUE(std::isnan(campaign.Find("delay_s")[2]));
  EXPECT_EQ(campaign.Find("bus_id")[0], layout->units()[0].bus.value);
  EXPECT_EQ(campaign.Find("rail_id")[0], layout->units()[0].rail.value);
  EXPECT_EQ(campaign.Find("cycles_theta")[1], 0.75);
  EXPECT_EQ(campaign.Find("drive_amplitude")[3], 1);
  // The rail feeds two of the units that move: one moved first, both in the second move.
  EXPECT_EQ(campaign.Find("movers_on_rail")[0], 1);
  EXPECT_EQ(campaign.Find("movers_on_rail")[1], 2);
  const auto mode =
      std::ranges::find(campaign.word_columns, std::string("mode"), &sim::WordColumn::name);
  ASSERT_NE(mode, campaign.word_columns.end());
  EXPECT_EQ(mode->words.at(static_cast<std::size_t>(mode->values[0])), "asymmetric");
  EXPECT_EQ(mode->words.at(static_cast<std::size_t>(mode->values[2])), "seven_segment");
  const std::string moves = WriteMoves(campaign);
  const std::string units = WriteCampaignUnits(campaign);
  const auto again = ReadCampaign({.moves = moves, .units = units});
  ASSERT_TRUE(again) << again.error().text;
  EXPECT_EQ(WriteMoves(*again), moves);
  EXPECT_EQ(WriteCampaignUnits(*again), units);
}

}  // namespace
}  // namespace focalfleet
