#include "fleet/layout.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "fleet/hex_layout.h"
#include "protocol/base/limits.h"
#include "protocol/base/rng.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

Unit UnitAt(std::uint32_t id, double x_mm, double y_mm) {
  Unit unit;
  unit.id = UnitId{id};
  unit.base_fp = {x_mm, y_mm};
  unit.axis[0] = {8.25, 0, 892.0588, -190, 190};
  unit.axis[1] = {8.25, 0, 892.0588, 0, 180};
  return unit;
}

std::string ErrorOf(std::vector<Unit> units, Layout::Options options = {}) {
  const auto layout = Layout::Create(std::move(units), std::move(options));
  return layout ? "" : layout.error().text;
}

TEST(Layout, PitchHalfWidthAndClearanceFollowTheNearestNeighbour) {
  const auto layout = Layout::Create(
      {UnitAt(1, 0, 0), UnitAt(2, 25.6, 0), UnitAt(3, 51.2, 0), UnitAt(4, 81.2, 0)}, {});
  ASSERT_TRUE(layout) << layout.error().text;
  EXPECT_DOUBLE_EQ(layout->pitch_mm(), 25.6);
  EXPECT_NEAR(layout->clearance_mm(), 0.3072, 1e-12);
  EXPECT_NEAR(layout->unit({0}).arm_half_width_mm, 2.048, 1e-12);
  EXPECT_NEAR(layout->unit({3}).arm_half_width_mm, 2.4, 1e-9);
  EXPECT_NEAR(layout->nearest_mm({3}), 30, 1e-9);
}

TEST(Layout, GivenHalfWidthAndClearanceAreKept) {
  auto units = std::vector{UnitAt(1, 0, 0), UnitAt(2, 25.6, 0)};
  units[0].arm_half_width_mm = 1.5;
  const auto layout = Layout::Create(units, {.clearance_mm = 0.5, .obstacles = {}});
  ASSERT_TRUE(layout);
  EXPECT_EQ(layout->unit({0}).arm_half_width_mm, 1.5);
  EXPECT_EQ(layout->clearance_mm(), 0.5);
}

TEST(Layout, OneUnitAlonePitchesTwiceItsReach) {
  const auto layout = Layout::Create({UnitAt(7, 3, 4)}, {});
  ASSERT_TRUE(layout);
  EXPECT_DOUBLE_EQ(layout->pitch_mm(), 2 * layout->unit({0}).reach_mm());
  EXPECT_NEAR(layout->unit({0}).arm_half_width_mm, 0.08 * 33, 1e-12);
  EXPECT_TRUE(layout->neighbours({0}).empty());
  EXPECT_EQ(layout->Find(UnitId{7}), PositionerIndex{0});
  EXPECT_EQ(layout->Find(BusId{0}, NodeId{1}), PositionerIndex{0});
}

TEST(Layout, NeighboursAreExactlyThoseWhoseReachesOverlap) {
  const std::uint64_t seed = test::TestSeed(20240611);
  FOCALFLEET_TRACE_SEED(seed);
  struct Plate {
    double height_mm;
    double stray_mm;
  };
  for (const Plate& plate : {Plate{600, 600}, Plate{0.6, 0.6}, Plate{600, 90'000}}) {
    Rng rng(seed);
    std::vector<Unit> units;
    for (std::uint32_t i = 0; i < 400; ++i) {
      units.push_back(UnitAt(i + 1, rng.Uniform(0, 600), rng.Uniform(0, plate.height_mm)));
      units.back().axis[0].arm_mm = rng.Uniform(1, plate.height_mm > 1 ? 40 : 4);
      units.back().axis[1].arm_mm = 4;
    }
    units.push_back(UnitAt(9999, plate.stray_mm, -plate.stray_mm));
    const auto layout = Layout::Create(units, {});
    ASSERT_TRUE(layout) << layout.error().text;
    for (std::uint32_t i = 0; i < layout->size(); ++i) {
      std::vector<PositionerIndex> expected;
      double nearest = std::numeric_limits<double>::infinity();
      for (std::uint32_t j = 0; j < layout->size(); ++j) {
        const Unit& a = layout->unit({i});
        const Unit& b = layout->unit({j});
        const double d =
            std::hypot(a.base_fp.x_mm - b.base_fp.x_mm, a.base_fp.y_mm - b.base_fp.y_mm);
        if (j == i) continue;
        nearest = std::min(nearest, d);
        if (d < a.reach_mm() + b.reach_mm() + layout->clearance_mm())
          expected.push_back(PositionerIndex{j});
      }
      const auto found = layout->neighbours({i});
      EXPECT_EQ(std::vector(found.begin(), found.end()), expected) << "unit index " << i;
      EXPECT_NEAR(layout->nearest_mm({i}), nearest, 1e-9);
    }
  }
}

TEST(Layout, MissingNodesAreGivenInFileOrderPerBus) {
  auto units = std::vector{UnitAt(1, 0, 0), UnitAt(2, 30, 0), UnitAt(3, 60, 0), UnitAt(4, 90, 0)};
  units[0].bus = units[2].bus = units[3].bus = BusId{923};
  units[1].bus = BusId{10};
  units[2].node = NodeId{1};
  const auto layout = Layout::Create(units, {});
  ASSERT_TRUE(layout) << layout.error().text;
  EXPECT_EQ(layout->unit({0}).node, NodeId{2}) << "1 was given to another unit";
  EXPECT_EQ(layout->unit({1}).node, NodeId{1});
  EXPECT_EQ(layout->unit({3}).node, NodeId{3});
  EXPECT_EQ(layout->Find(BusId{923}, NodeId{3}), PositionerIndex{3});
  EXPECT_EQ(layout->Find(BusId{923}, NodeId{4}), std::nullopt);
  ASSERT_EQ(layout->buses().size(), 2u);
  EXPECT_EQ(layout->buses()[0], BusId{10});
}

TEST(Layout, UnitsWithoutABusAreSpreadOneHundredABus) {
  std::vector<Unit> units;
  for (std::uint32_t i = 0; i < 250; ++i) units.push_back(UnitAt(i, 30.0 * i, 0));
  const auto layout = Layout::Create(units, {});
  ASSERT_TRUE(layout);
  EXPECT_EQ(layout->buses().size(), 3u);
  EXPECT_EQ(layout->unit({99}).bus, BusId{0});
  EXPECT_EQ(layout->unit({100}).bus, BusId{1});
  EXPECT_EQ(layout->unit({100}).node, NodeId{1});
  EXPECT_EQ(layout->unit({249}).node, NodeId{50});
}

TEST(Layout, NamesTheUnitThatCannotBe) {
  const auto with = [](auto change) {
    auto units = std::vector{UnitAt(1, 0, 0), UnitAt(17, 30, 0)};
    change(units[1]);
    return ErrorOf(units);
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const std::string& text :
       {with([](Unit& u) { u.id = UnitId{1}; }), with([&](Unit& u) { u.base_fp.x_mm = nan; }),
        with([](Unit& u) { u.base_fp.x_mm = 0; }), with([](Unit& u) { u.axis[0].arm_mm = 0; }),
        with([](Unit& u) { u.axis[1].arm_mm = -1; }), with([&](Unit& u) { u.axis[1].gear = nan; }),
        with([](Unit& u) { u.axis[0].max_deg = -190; }),
        with([](Unit& u) { u.axis[0].max_deg = 1e9; }),
        with([](Unit& u) { u.axis[0].gear = 1e12; }), with([](Unit& u) { u.node = NodeId{3}; }),
        with([](Unit& u) { u.arm_half_width_mm = -2; })}) {
    EXPECT_TRUE(text.find("unit 17") != std::string::npos ||
                text.find("unit 1 ") != std::string::npos)
        << '"' << text << '"';
  }
  EXPECT_NE(ErrorOf({}), "");
}

TEST(Layout, RefusesTwoUnitsAtOneAddress) {
  auto units = std::vector{UnitAt(1, 0, 0), UnitAt(2, 30, 0)};
  for (Unit& unit : units) {
    unit.bus = BusId{4};
    unit.node = NodeId{9};
  }
  EXPECT_EQ(ErrorOf(units), "unit 2: bus 4 node 9 is also that of unit 1");
}

TEST(Layout, RefusesMoreUnitsOnABusThanItCarries) {
  std::vector<Unit> units;
  for (std::uint32_t i = 0; i <= limits::kNodesPerBus; ++i) {
    units.push_back(UnitAt(i, 30.0 * i, 0));
    units.back().bus = BusId{5};
  }
  EXPECT_EQ(ErrorOf(units), "unit 128: bus 5 has more than 128 units");
  units.pop_back();
  EXPECT_EQ(ErrorOf(units), "");
}

TEST(Layout, RefusesArmsThatReachOverTheWholePlate) {
  std::vector<Unit> units;
  for (std::uint32_t i = 0; i < 2000; ++i) {
    units.push_back(UnitAt(i, 30.0 * i, 0));
    units.back().axis[0].arm_mm = 8250;  // micrometres by mistake
  }
  EXPECT_NE(ErrorOf(units).find("are its arms in mm?"), std::string::npos);
}

TEST(Layout, RefusesAnObstacleThatIsNotAPlace) {
  EXPECT_NE(ErrorOf({UnitAt(1, 0, 0)}, {.clearance_mm = 0, .obstacles = {{3, {0, 0}, -1}}}), "");
  EXPECT_NE(ErrorOf({UnitAt(1, 0, 0)}, {.clearance_mm = -1, .obstacles = {}}), "");
}

TEST(HexLayout, FiveThousandUnitsFillFiftyBusesAndTenRails) {
  const auto units = MakeHexLayout({.count = 5000});
  ASSERT_EQ(units.size(), 5000u);
  const auto layout = Layout::Create(units, {});
  ASSERT_TRUE(layout) << layout.error().text;
  EXPECT_NEAR(layout->pitch_mm(), 25.6, 1e-9);
  EXPECT_EQ(layout->buses().size(), 50u);
  std::map<std::uint32_t, int> per_rail;
  std::map<std::uint32_t, std::set<std::uint32_t>> rails_of_bus;
  std::map<std::uint32_t, int> per_bus;
  for (const Unit& unit : layout->units()) {
    ++per_rail[unit.rail.value];
    ++per_bus[unit.bus.value];
    rails_of_bus[unit.bus.value].insert(unit.rail.value);
  }
  EXPECT_EQ(per_rail.size(), 10u);
  for (const auto& [rail, count] : per_rail) EXPECT_EQ(count, 500) << "rail " << rail;
  for (const auto& [bus, count] : per_bus) EXPECT_EQ(count, 100) << "bus " << bus;
  for (const auto& [bus, rails] : rails_of_bus) EXPECT_EQ(rails.size(), 1u) << "bus " << bus;
}

TEST(HexLayout, StartsAtTheCentreWithArmsInProportion) {
  const auto units = MakeHexLayout({.count = 7, .pitch_mm = 10});
  EXPECT_EQ(units[0].base_fp.x_mm, 0);
  EXPECT_EQ(units[0].base_fp.y_mm, 0);
  for (std::size_t i = 1; i < 7; ++i)
    EXPECT_NEAR(std::hypot(units[i].base_fp.x_mm, units[i].base_fp.y_mm), 10, 1e-12);
  EXPECT_NEAR(units[3].theta().arm_mm + units[3].phi().arm_mm, 16.5 / 2.56, 1e-12);
  EXPECT_NEAR(units[3].theta().gear, 892.0588235, 1e-6);
}

TEST(HexLayout, EveryCountIsALayout) {
  for (std::uint32_t count = 1; count < 400; ++count) {
    const auto layout = Layout::Create(MakeHexLayout({.count = count}), {});
    ASSERT_TRUE(layout) << count << ": " << layout.error().text;
    EXPECT_EQ(layout->size(), count);
  }
}

}  // namespace
}  // namespace focalfleet
