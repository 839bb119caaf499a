#include "daemon/report/plan_page.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/report/embedded.h"
#include "fleet/files/plan_file.h"
#include "fleet/kinematics.h"
#include "protocol/base/rng.h"
#include "tests/daemon/report/markup.h"
#include "tests/daemon/report/plan_page_scene.h"
#include "tests/daemon/report/unpack.h"

namespace focalfleet::report {
namespace {

using test::MakeSceneData;
using test::ReadMarkup;
using test::SceneData;
using test::Select;
using test::Unpack;
using ::testing::HasSubstr;
using ::testing::Not;
using Json = nlohmann::json;

const SceneData& Data() {
  static const SceneData data = MakeSceneData();
  return data;
}

const std::string& Html() {
  static const std::string html = PlanPage(Data().scene());
  return html;
}

// Returns the text between the end of `begin` and `end`; both must occur once.
std::string Between(const std::string& text, const std::string& begin, const std::string& end) {
  const std::size_t at = text.find(begin);
  EXPECT_NE(at, std::string::npos) << begin;
  EXPECT_EQ(text.find(begin, at + 1), std::string::npos) << begin << " twice";
  const std::size_t from = at + begin.size();
  return text.substr(from, text.find(end, from) - from);
}

Json DataOf(const std::string& html) {
  return Json::parse(Between(html, R"(<script type="application/json" id="plan">)", "</script>"));
}

std::vector<double> UnitColumn(const Json& data, const char* name) {
  return Unpack(data["units"][name], data["units_count"].get<std::size_t>());
}
std::vector<double> RowColumn(const Json& data, const char* name) {
  return Unpack(data["rows"][name], data["rows_count"].get<std::size_t>());
}

TEST(PlanPage, IsWellFormedAroundItsScript) {
  std::string html = Html();
  const std::string script = Between(html, "<script>\n", "</script>\n</body>");
  EXPECT_THAT(script, HasSubstr("new PlanPage"));
  EXPECT_THAT(script, Not(HasSubstr("</")));
  EXPECT_THAT(script, Not(HasSubstr("<!--")));
  html.erase(html.find(script), script.size());
  const auto elements = ReadMarkup(html);
  ASSERT_TRUE(elements.has_value());
  EXPECT_EQ(Select(*elements, "title").at(0).text, "Plan: <61> & more");
  EXPECT_EQ(Select(*elements, "h1").at(0).text, "Plan: <61> & more");
  EXPECT_EQ(Select(*elements, "canvas").size(), 2u);
}

TEST(PlanPage, NeedsNothingElseAndForbidsIt) {
  for (const char* foreign : {"<link", "<img", "@import", "url(", "http:", "https:", "fetch(",
                              "XMLHttpRequest", "src=", "eval("}) {
    EXPECT_THAT(Html(), Not(HasSubstr(foreign)));
  }
  EXPECT_THAT(Html(), HasSubstr("default-src 'none'"));
}

TEST(PlanPage, IsTheSameForTheSameScene) { EXPECT_EQ(PlanPage(Data().scene()), Html()); }

TEST(PlanPage, CarriesTheRowsOfThePlanToTheBit) {
  const Json data = DataOf(Html());
  const auto rows =
      RowsOf(Data().plan, Data().fleet.layout, Data().fleet.drives, Data().scene().motor);
  ASSERT_EQ(data["rows_count"], rows.size());
  ASSERT_GT(rows.size(), 100u);
  const auto t0 = RowColumn(data, "t0_s");
  const auto t1 = RowColumn(data, "t1_s");
  const auto to = RowColumn(data, "to_deg");
  const auto power = RowColumn(data, "power_W");
  for (std::size_t k = 0; k < rows.size(); ++k) {
    EXPECT_EQ(t0[k], rows[k].t0_s);
    EXPECT_EQ(t1[k], rows[k].t1_s);
    EXPECT_EQ(to[k], rows[k].to_deg);
    EXPECT_EQ(power[k], rows[k].power_W);
  }
}

// The page takes the start of a row from the row before, or from where the axis stood.
TEST(PlanPage, TellsWhichRowsAreWhose) {
  const Json data = DataOf(Html());
  const auto rows =
      RowsOf(Data().plan, Data().fleet.layout, Data().fleet.drives, Data().scene().motor);
  const std::vector<std::vector<double>> counts = {UnitColumn(data, "theta_rows"),
                                                   UnitColumn(data, "phi_rows")};
  const std::vector<std::vector<double>> starts = {UnitColumn(data, "start_theta_deg"),
                                                   UnitColumn(data, "start_phi_deg")};
  std::size_t k = 0;
  for (std::uint32_t i = 0; i < SceneData::kUnits; ++i) {
    for (const Axis axis : kAxes) {
      double at_deg = starts[Index(axis)][i];
      for (int n = 0; n < counts[Index(axis)][i]; ++n, ++k) {
        ASSERT_LT(k, rows.size());
        EXPECT_EQ(rows[k].unit, Data().fleet.layout.unit({i}).id);
        EXPECT_EQ(rows[k].axis, axis);
        EXPECT_EQ(rows[k].from_deg, at_deg);
        at_deg = rows[k].to_deg;
      }
    }
  }
  EXPECT_EQ(k, rows.size());
}

TEST(PlanPage, CarriesTheUnits) {
  const Json data = DataOf(Html());
  ASSERT_EQ(data["units_count"], SceneData::kUnits);
  for (std::uint32_t i = 0; i < SceneData::kUnits; ++i) {
    const Unit& unit = Data().fleet.layout.unit({i});
    EXPECT_EQ(UnitColumn(data, "id")[i], unit.id.value);
    EXPECT_EQ(UnitColumn(data, "base_x_mm")[i], unit.base_fp.x_mm);
    EXPECT_EQ(UnitColumn(data, "base_y_mm")[i], unit.base_fp.y_mm);
    EXPECT_EQ(UnitColumn(data, "half_width_mm")[i], unit.arm_half_width_mm);
    EXPECT_EQ(UnitColumn(data, "rail")[i], unit.rail.value);
    EXPECT_EQ(UnitColumn(data, "bus")[i], unit.bus.value);
    EXPECT_EQ(UnitColumn(data, "node")[i], unit.node.value);
    EXPECT_EQ(UnitColumn(data, "enabled")[i], i == SceneData::kDisabled.value ? 0 : 1);
    const auto& target = Data().fleet.targets[i];
    const double x = UnitColumn(data, "target_x_mm")[i];
    EXPECT_EQ(std::isnan(x), !target.has_value());
    if (target) {
      EXPECT_EQ(x, FibreAt(unit, Data().fleet.drives[i], *target).x_mm);
    }
  }
  EXPECT_TRUE(std::isnan(UnitColumn(data, "start_phi_deg")[SceneData::kUnknown.value]));
}

TEST(PlanPage, NamesWhoIsNotServedAndWhoIsInTheWay) {
  const Json data = DataOf(Html());
  for (std::uint32_t i = 0; i < SceneData::kUnits; ++i) {
    const bool unserved = i == SceneData::kUnserved.value;
    EXPECT_EQ(UnitColumn(data, "unserved")[i],
              unserved ? 1 + static_cast<int>(UnservedWhy::kBlocked) : 0);
    EXPECT_EQ(UnitColumn(data, "by")[i], unserved ? 1 + SceneData::kInTheWay.value : 0);
  }
}

// The script's texts are indexed by the reason's number, from 1; the first text is that of a served
// unit.
TEST(PlanPage, HasATextForEveryReason) {
  const std::size_t begin = kPlanPageScript.find("const kUnservedWhy = [");
  ASSERT_NE(begin, std::string_view::npos);
  const std::string_view texts =
      kPlanPageScript.substr(begin, kPlanPageScript.find("];", begin) - begin);
  constexpr auto kLast = static_cast<std::ptrdiff_t>(UnservedWhy::kTargetCollides);
  EXPECT_EQ(std::count(texts.begin(), texts.end(), '"'), 2 * (1 + 1 + kLast));
}

TEST(PlanPage, CarriesObstaclesAndLimits) {
  const Json data = DataOf(Html());
  EXPECT_EQ(data["obstacles"],
            Json::parse(R"([{"id":7,"x_mm":12.8,"y_mm":7.39,"radius_mm":0.5}])"));
  EXPECT_EQ(data["rail_limits"],
            Json::parse(R"([{"rail":0,"limit_W":6.5},{"rail":1,"limit_W":3.0}])"));
}

TEST(PlanPage, ShowsTheTightestPairsFirstAndNotTooMany) {
  SceneData data = Data();
  data.plan.tightest.clear();
  for (std::uint32_t k = 0; k < 30; ++k) {
    data.plan.tightest.push_back({{k}, {k + 1}, 0.001 * ((k * 7) % 30), 0.5});
  }
  const Json pairs = DataOf(PlanPage(data.scene()))["pairs"];
  ASSERT_EQ(pairs.size(), kTightPairsShownMax);
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    EXPECT_EQ(pairs[k]["clearance_mm"], 0.001 * static_cast<double>(k));
    EXPECT_EQ(pairs[k]["b"], pairs[k]["a"].get<int>() + 1);
  }
}

TEST(PlanPage, OfFiveThousandUnitsWithFourRowsEachStaysBelowTwoMegabytes) {
  focalfleet::test::PlanningFleet fleet = focalfleet::test::HexFleet(5000);
  Rng rng = Rng::Stream(1, "rows");
  const auto draw = [&](std::uint32_t below) {
    return static_cast<std::int32_t>(rng.Bits() % below);
  };
  Plan plan;
  std::vector<std::optional<Pose>> start;
  for (std::uint32_t i = 0; i < 5000; ++i) {
    start.emplace_back(Pose{draw(40'000), draw(40'000)});
    UnitPlan move{.unit = {i}, .from = *start.back(), .to = *start.back()};
    for (AxisPath& path : move.path) {
      path.Append({static_cast<std::uint32_t>(draw(100'000)), 1 + draw(8000), 108});
      path.Append({static_cast<std::uint32_t>(200'000 + draw(100'000)), -1 - draw(8000), 108});
    }
    plan.moves.push_back(move);
    fleet.targets[i] = Pose{draw(40'000), draw(40'000)};
  }
  const std::string html = PlanPage({.layout = &fleet.layout,
                                     .drives = fleet.drives,
                                     .start = start,
                                     .targets = fleet.targets,
                                     .plan = &plan});
  RecordProperty("bytes", static_cast<int>(html.size()));
  EXPECT_EQ(DataOf(html)["rows_count"], 20'000);
  EXPECT_LT(html.size(), 2'000'000u);
}

TEST(PlanPageDeathTest, RefusesASceneWhoseShapesDoNotFit) {
  PlanScene scene = Data().scene();
  scene.targets = scene.targets.subspan(1);
  EXPECT_DEATH(PlanPage(scene), "check failed");
}

}  // namespace
}  // namespace focalfleet::report
