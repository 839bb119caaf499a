#include "fleet/files/layout_file.h"

#include <gtest/gtest.h>

#include "fleet/hex_layout.h"

namespace focalfleet {
namespace {

const std::string kHeader =
    "unit_id,base_x_mm,base_y_mm,arm_theta_mm,arm_phi_mm,theta_zero_deg,phi_zero_deg,theta_gear,"
    "phi_gear,theta_min_deg,theta_max_deg,phi_min_deg,phi_max_deg";
const std::string kFirst = "1,0,0,8,8,0,0,892,892,-190,190,0,180";

std::string ErrorOf(const std::string& text) {
  const auto layout = ReadLayout(text, "units.csv", {});
  return layout ? "" : layout.error().text;
}

bool SameUnit(const Unit& a, const Unit& b) {
  const auto same_axis = [](const AxisGeometry& p, const AxisGeometry& q) {
    return p.arm_mm == q.arm_mm && p.zero_deg == q.zero_deg && p.gear == q.gear &&
           p.min_deg == q.min_deg && p.max_deg == q.max_deg;
  };
  return a.id == b.id && a.base_fp.x_mm == b.base_fp.x_mm && a.base_fp.y_mm == b.base_fp.y_mm &&
         same_axis(a.axis[0], b.axis[0]) && same_axis(a.axis[1], b.axis[1]) &&
         a.arm_half_width_mm == b.arm_half_width_mm && a.rail == b.rail && a.bus == b.bus &&
         a.node == b.node && a.enabled == b.enabled && a.rail_slot == b.rail_slot &&
         a.bus_slot == b.bus_slot && a.group == b.group;
}

TEST(LayoutFile, ReadsTheColumnsOfTheDesiTable) {
  const auto file = ReadUnits(
      "# DESI focal plane\n" + kHeader +
          ",rail_id,bus_id,enabled\n"
          "2910,7.6446,-81.3305,3.0000,3.0606,122.8219,0.7354,337.36,337.36,-195.640,195.640,-5,"
          "186.508,4,410,0\n",
      "units.csv");
  ASSERT_TRUE(file) << file.error().text;
  const Unit& unit = file->units.at(0);
  EXPECT_EQ(unit.id, UnitId{2910});
  EXPECT_EQ(unit.base_fp.y_mm, -81.3305);
  EXPECT_EQ(unit.phi().arm_mm, 3.0606);
  EXPECT_EQ(unit.theta().zero_deg, 122.8219);
  EXPECT_EQ(unit.phi().max_deg, 186.508);
  EXPECT_EQ(unit.rail, RailId{4});
  EXPECT_EQ(unit.bus, BusId{410});
  EXPECT_EQ(unit.node, kNoNode);
  EXPECT_FALSE(unit.enabled);
  EXPECT_TRUE(file->ignored_columns.empty());
  EXPECT_EQ(file->lines.at(0), 3);
}

TEST(LayoutFile, WhatIsWrittenReadsBackEqual) {
  auto units = MakeHexLayout({.count = 300, .pitch_mm = 10.4});
  units[2].enabled = false;
  units[3].arm_half_width_mm = 0.7;
  units[4].node = kNoNode;
  units[5].bus = kNoBus;
  units[5].node = kNoNode;
  units[6].rail_slot = 6;
  units[7].bus_slot = 7;
  units[8].group = 8;
  const auto read = ReadUnits(WriteUnits(units), "units.csv");
  ASSERT_TRUE(read) << read.error().text;
  ASSERT_EQ(read->units.size(), units.size());
  for (std::size_t i = 0; i < units.size(); ++i)
    EXPECT_TRUE(SameUnit(read->units[i], units[i])) << i;
}

TEST(LayoutFile, TellsColumnsThatItPassesOver) {
  const auto file = ReadUnits(kHeader + ",enabeld\n" + kFirst + ",0\n", "units.csv");
  ASSERT_TRUE(file);
  EXPECT_EQ(file->ignored_columns, std::vector<std::string>{"enabeld"});
}

TEST(LayoutFile, NamesFileLineAndReason) {
  EXPECT_EQ(ErrorOf(""), "units.csv: empty, a header line is expected");
  EXPECT_EQ(ErrorOf(kHeader + "\n"), "units.csv: a header, but no units");
  EXPECT_TRUE(ErrorOf("unit_id,x\n1,2\n").starts_with("units.csv:1: column base_x_mm, "));
  EXPECT_EQ(ErrorOf(kHeader + "\n" + kFirst + "\n" + kFirst + "\n"),
            "units.csv:3: unit 1: is there twice, first in line 2");
  EXPECT_EQ(ErrorOf(kHeader + "\n1,0,0,8,nan,0,0,892,892,-190,190,0,180\n"),
            "units.csv:2: column arm_phi_mm: the value is missing (empty or nan)");
  EXPECT_EQ(ErrorOf(kHeader + "\n1,0,0,8,-8,0,0,892,892,-190,190,0,180\n"),
            "units.csv:2: unit 1: arm_phi_mm -8 is not a length between 0 and 10000");
  EXPECT_EQ(ErrorOf(kHeader + "\n1,0,0,8,8,0,0,892,892,190,-190,0,180\n"),
            "units.csv:2: unit 1: theta range 190..-190 deg is empty");
  EXPECT_EQ(ErrorOf(kHeader + "\n-1,0,0,8,8,0,0,892,892,-190,190,0,180\n"),
            "units.csv:2: column unit_id: '-1' is not between 0 and 4294967294");
  EXPECT_EQ(ErrorOf(kHeader + "\n1,0,0,8,8,0,0,892,89"),
            "units.csv:2: the last line does not end: the file is cut short (or end it with a "
            "newline)");
  EXPECT_EQ(ErrorOf(kHeader + ",enabled\n" + kFirst + ",2\n"),
            "units.csv:2: column enabled: '2' is neither 0 nor 1 (nor false nor true)");
  EXPECT_EQ(ErrorOf(kHeader + ",node_id\n" + kFirst + ",7\n"),
            "units.csv:2: column bus_id: a node_id needs a bus_id");
  EXPECT_EQ(ErrorOf(kHeader + ",arm_half_width_mm\n" + kFirst + ",0\n"),
            "units.csv:2: column arm_half_width_mm: 0 is not above 0");
}

TEST(LayoutFile, TellsAllBadRows) {
  EXPECT_EQ(ErrorOf(kHeader + "\n" + kFirst + "\n" + kFirst +
                    "\n2,30,0,8,nan,0,0,892,892,-190,190,0,180\n"
                    "3,60,0,8,-8,0,0,892,892,-190,190,0,180\n"),
            "units.csv:3: unit 1: is there twice, first in line 2\n"
            "  units.csv:4: column arm_phi_mm: the value is missing (empty or nan)\n"
            "  units.csv:5: unit 3: arm_phi_mm -8 is not a length between 0 and 10000");
}

TEST(LayoutFile, ReadsFlagsAsOthersWriteThem) {
  for (const auto& [cell, enabled] : {std::pair("True", true),
                                      {"False", false},
                                      {"1", true},
                                      {"0", false},
                                      {"F", false},
                                      {"", true}}) {
    const auto file = ReadUnits(kHeader + ",enabled\n" + kFirst + "," + cell + "\n", "units.csv");
    ASSERT_TRUE(file) << file.error().text;
    EXPECT_EQ(file->units[0].enabled, enabled) << cell;
  }
}

TEST(LayoutFile, NamesTheLinesOfAllFaultsBetweenUnits) {
  const std::string at = ",8,8,0,0,892,892,-190,190,0,180";
  EXPECT_EQ(ErrorOf(kHeader + "\n1,0,0" + at + "\n2,30,0" + at + "\n3,0,0" + at + "\n4,30,0" + at +
                    "\n5,0,0" + at + "\n6,60,0" + at + "\n"),
            "units.csv:2: unit 1 and unit 3 sit at one place\n"
            "  units.csv:3: unit 2 and unit 4 sit at one place\n"
            "  units.csv:6: unit 5 and unit 1 sit at one place");
  EXPECT_EQ(ErrorOf(kHeader + ",bus_id,node_id\n1,0,0" + at + ",3,9\n2,30,0" + at + ",3,9\n3,60,0" +
                    at + ",3,9\n"),
            "units.csv:3: unit 2: bus 3 node 9 is also that of unit 1\n"
            "  units.csv:4: unit 3: bus 3 node 9 is also that of unit 1");
}

TEST(LayoutFile, NamesTheLineOfFaultsBetweenUnitsToo) {
  EXPECT_EQ(ErrorOf(kHeader + "\n" + kFirst + "\n2" + kFirst.substr(1) + "\n"),
            "units.csv:2: unit 1 and unit 2 sit at one place");
  EXPECT_EQ(ErrorOf("# c\n" + kHeader + ",bus_id,node_id\n" + kFirst +
                    ",3,9\n2,30,0,8,8,0,0,892,892,-190,190,0,180,3,9\n"),
            "units.csv:4: unit 2: bus 3 node 9 is also that of unit 1");
}

}  // namespace
}  // namespace focalfleet
