#include "daemon/report/plan_picture.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <string>
#include <vector>

#include "fleet/files/plan_file.h"
#include "fleet/geometry/arm.h"
#include "tests/daemon/report/markup.h"
#include "tests/daemon/report/plan_page_scene.h"

namespace focalfleet::report {
namespace {

using test::MakeSceneData;
using test::MarkupElement;
using test::ReadMarkup;
using test::SceneData;
using test::Select;

constexpr double kSpeed = 4;

const SceneData& Data() {
  static const SceneData data = MakeSceneData();
  return data;
}

std::vector<MarkupElement> Drawn() {
  const auto elements = ReadMarkup(PlanPicture(Data().scene(), kSpeed));
  EXPECT_TRUE(elements.has_value());
  return elements.value_or(std::vector<MarkupElement>{});
}

std::vector<double> NumbersOf(const std::string& text) {
  std::vector<double> numbers;
  const char* at = text.c_str();
  while (*at != '\0') {
    char* end = nullptr;
    numbers.push_back(std::strtod(at, &end));
    at = *end == ';' ? end + 1 : end;
  }
  return numbers;
}

// The angle that a viewer shows at a share of the animation: linear between its key times.
double AngleAt(const MarkupElement& turn, double share) {
  const auto times = NumbersOf(turn.attributes.at("keyTimes"));
  const auto values = NumbersOf(turn.attributes.at("values"));
  for (std::size_t k = 1; k < times.size(); ++k)
    if (share <= times[k])
      return values[k - 1] + (values[k] - values[k - 1]) * (share - times[k - 1]) /
                                 std::max(times[k] - times[k - 1], 1e-12);
  return values.back();
}

TEST(PlanPicture, IsWellFormedAndNeedsNothingElse) {
  const std::string svg = PlanPicture(Data().scene(), kSpeed);
  for (const char* foreign : {"<script", "href", "url(", "<image", "foreignObject", "https:"})
    EXPECT_EQ(svg.find(foreign), std::string::npos) << foreign;
  const auto elements = Drawn();
  EXPECT_EQ(Select(elements, "title").at(0).text, "Plan: <61> & more");
  EXPECT_EQ(Select(elements, "circle", "o").size(), 1u);
  EXPECT_EQ(Select(elements, "circle", "f").size(), SceneData::kUnits - 1)
      << "one place is unknown";
  EXPECT_EQ(svg, PlanPicture(Data().scene(), kSpeed));
  EXPECT_LT(svg.size(), 1000u * SceneData::kUnits);
}

TEST(PlanPicture, TurnsEveryAxisAsThePlanDoes) {
  const PlanScene scene = Data().scene();
  const auto rows = RowsOf(*scene.plan, *scene.layout, scene.drives, scene.motor);
  double last_s = 0;
  for (const PlanRow& row : rows) last_s = std::max(last_s, row.t1_s);
  const auto turns = Select(Drawn(), "animateTransform");
  std::size_t axes = 0;
  for (std::size_t r = 0; r < rows.size(); ++r) {
    const bool first =
        r == 0 || rows[r].unit != rows[r - 1].unit || rows[r].axis != rows[r - 1].axis;
    axes += first ? 1u : 0u;
    ASSERT_LE(axes, turns.size());
    const MarkupElement& turn = turns[axes - 1];
    const double lasts_s = std::stod(turn.attributes.at("dur"));
    const double stands_s = (lasts_s - last_s / kSpeed) / 2;
    ASSERT_GT(stands_s, 0.5);
    const PositionerIndex i = *scene.layout->Find(rows[r].unit);
    const double zero_deg = scene.layout->unit(i).axis[Index(rows[r].axis)].zero_deg;
    for (const double part : {0.0, 0.5, 1.0}) {
      const double t_s = rows[r].t0_s + part * (rows[r].t1_s - rows[r].t0_s);
      const double angle_deg = rows[r].from_deg + part * (rows[r].to_deg - rows[r].from_deg);
      // Key times have 4 digits; the fastest axis turns 30 degrees a second.
      EXPECT_NEAR(AngleAt(turn, (stands_s + t_s / kSpeed) / lasts_s), angle_deg + zero_deg,
                  30 * kSpeed * 1e-4 * lasts_s + 0.01)
          << "unit " << rows[r].unit.value << " at " << t_s << " s";
    }
  }
  EXPECT_EQ(axes, turns.size());
}

TEST(PlanPicture, KeyTimesAscendFromZeroToOne) {
  for (const MarkupElement& turn : Select(Drawn(), "animateTransform")) {
    const auto times = NumbersOf(turn.attributes.at("keyTimes"));
    EXPECT_EQ(times.size(), NumbersOf(turn.attributes.at("values")).size());
    EXPECT_EQ(times.front(), 0);
    EXPECT_EQ(times.back(), 1);
    EXPECT_TRUE(std::is_sorted(times.begin(), times.end()));
  }
}

}  // namespace
}  // namespace focalfleet::report
