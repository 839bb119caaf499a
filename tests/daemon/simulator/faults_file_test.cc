#include "daemon/simulator/faults_file.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <string_view>

#include "protocol/base/rng.h"
#include "tests/support/seed.h"

namespace focalfleet::simulator {
namespace {

std::vector<sim::UnitDescription> TwelveUnitsOnTwoBuses() {
  std::vector<sim::UnitDescription> units(12);
  for (std::uint32_t n = 0; n < 12; ++n) {
    units[n].id = {n + 1};
    units[n].bus = {n / 6};
    units[n].node = {static_cast<std::uint8_t>(n % 6 + 1)};
  }
  return units;
}

constexpr const char* kHeader = "fault,bus_id,unit_id,from_s,to_s,chance,value\n";

Result<std::vector<sim::PlannedFault>> Read(const std::string& rows, bool bit_clock = true) {
  static const std::vector<sim::UnitDescription> units = TwelveUnitsOnTwoBuses();
  return ReadFaults(kHeader + rows, "f.csv", {units, bit_clock});
}

TEST(FaultsFile, EachRowIsOneFaultForEachThatItNames) {
  const auto plan = Read("noise,all,,,,1e-5,\nlate,,2-4,1.5,2,0.5,0.25\nbabble,,7,3,,,\n");
  ASSERT_TRUE(plan) << plan.error().text;
  ASSERT_EQ(plan->size(), 2u + 3 + 1);
  EXPECT_EQ((*plan)[1].bus, BusId{1});
  EXPECT_EQ((*plan)[1].chance, 1e-5);
  EXPECT_EQ((*plan)[1].from.ns, 0);
  EXPECT_EQ((*plan)[1].to.ns, kNever.ns);
  EXPECT_EQ((*plan)[4].unit, UnitId{4});
  EXPECT_EQ((*plan)[4].from, Milliseconds(1500));
  EXPECT_EQ((*plan)[4].to, Milliseconds(2000));
  EXPECT_EQ((*plan)[4].value, 0.25);
  EXPECT_EQ((*plan)[5].kind, sim::FaultKind::kBabble);
  EXPECT_EQ((*plan)[5].value, 1) << "its priority, where none is given";
  EXPECT_EQ((*plan)[5].chance, 1);
}

TEST(FaultsFile, TellsAllBadRows) {
  const auto plan = Read("noize,0,,,,1e-5,\nsilent,,13,,,,\nnoise,0,,,,1e-5,\n");
  ASSERT_FALSE(plan);
  EXPECT_EQ(std::count(plan.error().text.begin(), plan.error().text.end(), '\n'), 1);
  EXPECT_NE(plan.error().text.find("f.csv:2: column fault: 'noize'"), std::string::npos);
  EXPECT_NE(plan.error().text.find("f.csv:3: column unit_id: there is no unit 13"),
            std::string::npos);
}

TEST(FaultsFile, PassesOverAColumnWithoutANameAndNoOther) {
  static const std::vector<sim::UnitDescription> units = TwelveUnitsOnTwoBuses();
  const auto read = [&](const std::string& column) {
    return ReadFaults(column + "," + kHeader + "0,noise,0,,,,1e-5,\n", "f.csv", {units, true});
  };
  EXPECT_TRUE(read(""));
  EXPECT_TRUE(read("Unnamed: 0"));
  ASSERT_FALSE(read("chanse"));
  EXPECT_EQ(read("chanse").error().text, "f.csv: no column is called 'chanse'");
}

TEST(FaultsFile, WhatIsWrongIsNamedWithFileLineAndReason) {
  const std::pair<const char*, const char*> wrong[] = {
      {"noize,0,,,,1e-5,\n", "f.csv:2"},
      {"noise,0,,,,1e-5,\nnoise,7,,,,1e-5,\n", "f.csv:3"},
      {"noise,7,,,,1e-5,\n", "there is no bus 7"},
      {"silent,,13,,,,\n", "there is no unit 13"},
      {"silent,1,,,,,\n", "leave this empty"},
      {"noise,0,,,,,\n", "is the bit error rate"},
      {"drop,0,,,,1.5,\n", "not within 0..1"},
      {"drop,0,,5,5,,\n", "not behind from_s"},
      {"drop,0,,-1,,,\n", "from_s"},
      {"copies,,1,,,,\n", "needs one"},
      {"copies,,1,,,,0\n", "not within 1..100"},
      {"stuck,0,,,,,3\n", "has none"},
      {"stuck,x,,,,,\n", "neither 'all' nor numbers"},
      {"stuck,0,,1,5,,\nstuck,all,,4,6,,\n", "by line 2"},
      {"drop,0,,1,x,,\n", "to_s"},
  };
  for (const auto& [rows, part] : wrong) {
    const auto plan = Read(rows);
    ASSERT_FALSE(plan) << rows;
    EXPECT_NE(plan.error().text.find(part), std::string::npos) << plan.error().text;
    EXPECT_NE(plan.error().text.find("f.csv:"), std::string::npos) << plan.error().text;
  }
  EXPECT_TRUE(Read("stuck,0,,1,5,,\nstuck,all,,5,6,,\n")) << "one ends when the next begins";
}

TEST(FaultsFile, WhatIsOfTheWireIsRefusedWhereAnInterfaceCarriesTheFrames) {
  EXPECT_TRUE(Read("silent,,1,,,,\n", false));
  EXPECT_TRUE(Read("drop,0,,,,0.1,\n", false));
  for (const char* row : {"noise,0,,,,1e-5,\n", "stuck,0,,,,,\n", "babble,,1,,,,\n"}) {
    const auto plan = Read(row, false);
    ASSERT_FALSE(plan) << row;
    EXPECT_NE(plan.error().text.find("interface"), std::string::npos) << plan.error().text;
  }
}

TEST(FaultsFile, TheExampleOfTheHouseIsGood) {
  std::ifstream in(FOCALFLEET_SOURCE_DIR "/deploy/faults.csv", std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  const std::vector<sim::UnitDescription> units = TwelveUnitsOnTwoBuses();
  const auto plan = ReadFaults(text, "deploy/faults.csv", {units});
  ASSERT_TRUE(plan) << plan.error().text;
  EXPECT_GT(plan->size(), 8u);
}

TEST(FaultsFile, AnyBytesGiveAPlanOrAnError) {
  const std::uint64_t seed = focalfleet::test::TestSeed(61);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  const std::string good = "noise,all,,,,1e-5,\nlate,,2-4,1.5,2,0.5,0.25\nbabble,,7,3,,,\n";
  int refused = 0;
  for (int i = 0; i < 3000; ++i) {
    std::string text = good;
    for (int k = 0; k < 3; ++k) {
      constexpr std::string_view kLikely = ",-.0129ax\n";
      const char likely = kLikely[rng.Below(kLikely.size())];
      text[rng.Below(text.size())] = rng.Below(2) != 0 ? static_cast<char>(rng.Below(256)) : likely;
    }
    refused += Read(text) ? 0 : 1;
  }
  EXPECT_GT(refused, 1000);
}

}  // namespace
}  // namespace focalfleet::simulator
