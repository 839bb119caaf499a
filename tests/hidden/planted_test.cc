// The draws, files and keys of a suite are as the README promises, and the files as those of every
// campaign.
#include "tests/hidden/generator/planted.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "tests/support/seed.h"

namespace focalfleet::hidden {
namespace {

using focalfleet::testing::TestSeed;

std::vector<std::string> Split(const std::string& line, char at) {
  std::vector<std::string> parts(1);
  for (const char c : line) {
    if (c == at)
      parts.emplace_back();
    else
      parts.back() += c;
  }
  return parts;
}

Spec SpecAt(std::uint64_t suite, std::uint64_t index, const Wishes& wishes = {}) {
  const auto spec = DrawSpec(suite, index, wishes);
  EXPECT_TRUE(spec.has_value());
  return spec.value_or(Spec{});
}

TEST(HiddenSuite, SameSeedSameBytes) {
  for (const std::uint64_t index : {0u, 5u, 11u}) {
    const Planted one = Plant(SpecAt(77, index));
    const Planted two = Plant(SpecAt(77, index));
    const CampaignText a = Write(one.spec, one.campaign, one.measured);
    const CampaignText b = Write(two.spec, two.campaign, two.measured);
    EXPECT_EQ(a.moves, b.moves);
    EXPECT_EQ(a.units, b.units);
    const Key key = MakeKey(one);
    EXPECT_EQ(key.json, MakeKey(two).json);
    const Planted other = Plant(SpecAt(78, index));
    EXPECT_NE(Write(other.spec, other.campaign, other.measured).moves, a.moves);
  }
}

TEST(HiddenSuite, DrawsItsSharesAndEveryCause) {
  std::map<std::string, int> kinds;
  std::map<std::string, int> singles;
  for (std::uint64_t i = 0; i < 400; ++i) {
    const Spec spec = SpecAt(5, i);
    ++kinds[spec.kind];
    for (const std::string& cause : spec.causes) ++singles[cause];
  }
  EXPECT_EQ(kinds["null"], 80);
  EXPECT_EQ(kinds["unknown"], 60);
  for (const EffectKind& kind : Catalogue())
    EXPECT_GE(singles[std::string(kind.cause)], 3) << kind.cause;
}

// The ids of the verdict's contract; the three of static geometry are planted as errors of
// units.csv.
TEST(HiddenSuite, KnowsEveryCauseOfTheContract) {
  const std::vector<std::string> contract = Split(
      "axis_tilt gear_scale scale_asymmetry ramp_travel backlash friction_windup stiction "
      "eccentricity pinion_runout stage_ripple tooth_mesh tooth_damage cogging phase_imbalance "
      "load_angle_lag step_loss supply_droop supply_drift thermal_backlash thermal_arm_growth "
      "self_heating plate_expansion plate_gradient gravity_sag gravity_torque relaxation "
      "axis_crosstalk fibre_torque hard_stop wear camera_similarity camera_distortion "
      "centroid_bias air_turbulence identity_swap start_skew lost_command neighbour_coupling "
      "collision_contact command_quantisation sensor_bias mode_threshold",
      ' ');
  EXPECT_EQ(contract.size(), 42u);
  for (const std::string& cause : contract) EXPECT_NE(FindKind(cause), nullptr) << cause;
}

struct Table {
  std::vector<std::string> names;
  std::vector<std::map<std::string, std::string>> rows;
};

Table Parse(const std::string& text) {
  Table table;
  std::istringstream in(text);
  std::string line;
  std::getline(in, line);
  table.names = Split(line, ',');
  while (std::getline(in, line)) {
    const auto cells = Split(line, ',');
    EXPECT_EQ(cells.size(), table.names.size());
    table.rows.emplace_back();
    for (std::size_t i = 0; i < std::min(cells.size(), table.names.size()); ++i)
      table.rows.back()[table.names[i]] = cells[i];
  }
  return table;
}

double NumberOf(const std::string& cell) {
  char* end = nullptr;
  const double value = std::strtod(cell.c_str(), &end);
  EXPECT_TRUE(!cell.empty() && *end == '\0' && std::isfinite(value)) << cell;
  return value;
}

void CheckFiles(const Planted& planted) {
  const CampaignText text = Write(planted.spec, planted.campaign, planted.measured);
  const Table moves = Parse(text.moves);
  const Table units = Parse(text.units);
  ASSERT_EQ(units.rows.size(), planted.campaign.unit_count());
  ASSERT_EQ(moves.rows.size(), planted.campaign.rows.size());
  std::map<std::string, const std::map<std::string, std::string>*> unit_of;
  for (const auto& unit : units.rows) {
    EXPECT_TRUE(unit_of.emplace(unit.at("unit_id"), &unit).second) << "a unit twice";
    for (const std::string& name : units.names) NumberOf(unit.at(name));
  }
  std::map<std::string, const std::map<std::string, std::string>*> before;
  std::size_t missing = 0;
  for (const auto& row : moves.rows) {
    ASSERT_EQ(unit_of.count(row.at("unit_id")), 1u);
    const auto& unit = *unit_of[row.at("unit_id")];
    missing += row.at("x_mm").empty() ? 1u : 0u;
    ASSERT_EQ(row.at("x_mm").empty(), row.at("y_mm").empty());
    for (const std::string& name : moves.names)
      if (!row.at(name).empty()) NumberOf(row.at(name));
    for (const std::string axis : {"theta", "phi"}) {
      const double cmd = NumberOf(row.at(axis + "_cmd_deg"));
      const bool inside = cmd >= NumberOf(unit.at(axis + "_min_deg")) &&
                          cmd <= NumberOf(unit.at(axis + "_max_deg"));
      EXPECT_TRUE(inside || planted.spec.nuisances.wrapped_units > 0);
      const auto* last = before[row.at("unit_id")];
      const bool homed = row.count("rehomed") != 0 && row.at("rehomed") == "1";
      if (last != nullptr && !homed && planted.spec.nuisances.wrapped_units == 0) {
        ASSERT_EQ(row.at(axis + "_from_deg"), last->at(axis + "_cmd_deg"));
      }
    }
    before[row.at("unit_id")] = &row;
  }
  for (const std::string& column : planted.spec.dropped)
    EXPECT_EQ(std::count(moves.names.begin(), moves.names.end(), column), 0) << column;
  // The files must not name anything that was planted.
  for (const std::string& cause : planted.spec.causes)
    EXPECT_EQ((text.moves + text.units).find(cause), std::string::npos) << cause;
  if (!planted.spec.dirty && planted.spec.design.design != "survey") {
    EXPECT_EQ(missing, 0u);
  }
}

TEST(HiddenSuite, FilesAreCampaigns) {
  const std::uint64_t seed = TestSeed(9);
  FOCALFLEET_TRACE_SEED(seed);
  for (std::uint64_t i = 0; i < 20; ++i) {
    Spec spec = SpecAt(seed, i);
    spec.design.units = std::min<std::size_t>(spec.design.units, 24);
    spec.design.moves = std::min<std::size_t>(spec.design.moves, 90);
    SCOPED_TRACE("campaign " + std::to_string(i));
    CheckFiles(Plant(spec));
  }
}

TEST(HiddenKey, TellsTheTruthAboutACampaign) {
  Wishes wishes;
  wishes.cause = "backlash";
  wishes.lambda = 2000;
  wishes.design = "diagnostic";
  wishes.purity = "clean";
  wishes.units = 12;
  wishes.moves = 150;
  const Planted planted = Plant(SpecAt(10, 0, wishes));
  const Key key = MakeKey(planted);
  const auto json = nlohmann::json::parse(key.json);
  EXPECT_EQ(json["kind"], "single");
  ASSERT_EQ(json["effects"].size(), 1u);
  const auto& effect = json["effects"][0];
  EXPECT_EQ(effect["cause"], "backlash");
  EXPECT_NEAR(effect["lambda_per_freedom"].get<double>() / 2000, 1, 0.05);
  // The oracle's residual is the noise: two coordinates of the camera and one of each axis. The
  // latter acts through arms that reach farther for theta.
  const double floor_um = json["oracle"]["rms_after_um"];
  EXPECT_GT(floor_um, planted.spec.centroid_um * std::sqrt(2.0));
  EXPECT_LT(floor_um, 1.1 * std::hypot(planted.spec.centroid_um * std::sqrt(2.0),
                                       planted.spec.actuation_um * std::sqrt(1 + 4.0)));
  EXPECT_GT(json["oracle"]["rms_before_um"].get<double>(), floor_um);
  // contribution.csv holds the effect's square sum.
  const Table rows = Parse(key.contribution_csv);
  double squares = 0;
  for (const auto& row : rows.rows)
    squares += std::pow(NumberOf(row.at("dx_um")), 2) + std::pow(NumberOf(row.at("dy_um")), 2);
  EXPECT_NEAR(std::sqrt(squares / static_cast<double>(rows.rows.size())),
              effect["rms_um"].get<double>(), 0.01 * effect["rms_um"].get<double>());
}

TEST(HiddenKey, WhatAStuckUnitHasIsNotVisible) {
  Wishes wishes;
  wishes.cause = "backlash";
  wishes.lambda = 2000;
  wishes.units = 12;
  wishes.moves = 120;
  Spec spec = SpecAt(10, 0, wishes);
  const auto lambda_of = [&](int stuck_units) {
    spec.nuisances.stuck_units = stuck_units;
    const auto json = nlohmann::json::parse(MakeKey(Plant(spec)).json);
    return json["effects"][0]["lambda"].get<double>();
  };
  EXPECT_GT(lambda_of(0), 1000);
  EXPECT_LT(lambda_of(2), lambda_of(0));
  EXPECT_EQ(lambda_of(500), 0);  // all of them
}

TEST(HiddenKey, MissingColumnsAreReported) {
  Wishes wishes;
  wishes.cause = "gravity_sag";
  wishes.units = 8;
  wishes.moves = 120;
  Spec spec = SpecAt(11, 0, wishes);
  spec.dropped = {"elevation_deg"};
  const auto json = nlohmann::json::parse(MakeKey(Plant(spec)).json);
  EXPECT_EQ(json["effects"][0]["missing_columns"], nlohmann::json({"elevation_deg"}));
}

TEST(HiddenSuite, WishesThatNameNothingAreRefused) {
  for (const Wishes& wishes : {Wishes{.cause = "gremlins"}, Wishes{.kind = "double"},
                               Wishes{.design = "random"}, Wishes{.purity = "muddy"}})
    EXPECT_FALSE(DrawSpec(1, 0, wishes).has_value());
}

}  // namespace
}  // namespace focalfleet::hidden
