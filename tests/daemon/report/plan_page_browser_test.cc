// The page in a real browser, operated by plan_page_probe.js. The page's drawing, playing and
// reports are compared with the plan, the kinematics and the powers of the program. The test is
// skipped where there is no Chromium.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "fleet/estimate.h"
#include "fleet/files/plan_file.h"
#include "fleet/kinematics.h"
#include "tests/daemon/report/plan_page_scene.h"
#include "tests/support/process.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet::report {
namespace {

using focalfleet::test::ScratchFolder;
using test::MakeSceneData;
using test::SceneData;
using ::testing::HasSubstr;
using Json = nlohmann::json;

constexpr int kNoSuchProgram = 127;

std::string Slurp(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

void Insert(const std::string& text, const std::string& before, std::string* html) {
  const std::size_t at = html->rfind(before);
  ASSERT_NE(at, std::string::npos) << before;
  html->insert(at, text);
}

// The times run from the very border of a row to the end. They avoid the tight pairs, whose labels
// may hide an arm.
std::vector<double> Times(const Plan& plan) {
  const UnitPlan& move = plan.moves.front();
  const double row_begins_s = move.path[0].segments()[0].start_ticks / 1e4;
  return {0, row_begins_s, 0.123, 1.7, 3.25, 8.5, 13.0101, plan.makespan_s};
}

struct Visit {
  int exit = -1;
  std::string seen;  // JSON; empty where the probe did not get to its end
  std::string log;
};

// The browser's time is virtual and passes as fast as its timers allow. A browser that dumps its
// document draws no frames of its own, so a timer takes their place.
constexpr const char* kPreparation = R"(<script>
const probeErrors = [];
addEventListener("error", (event) => probeErrors.push(event.message));
requestAnimationFrame = (draw) => setTimeout(() => draw(performance.now()), 16);
</script>
)";

// The sandbox is off: it needs privileges that a container or root lacks, and the page is the
// project's own.
Visit VisitPage(const SceneData& data) {
  std::string html = PlanPage(data.scene());
  Insert(kPreparation, "<title>", &html);
  Insert("<script>const probeTimes = " + Json(Times(data.plan)).dump() + ";\n" +
             Slurp(PLAN_PAGE_PROBE) + "</script>\n",
         "</body>", &html);
  const ScratchFolder scratch;
  std::ofstream(scratch / "plan.html", std::ios::binary) << html;
  focalfleet::test::Process browser(
      {"/usr/bin/timeout", "100", "chromium", "--headless", "--no-sandbox", "--disable-gpu",
       "--window-size=1280,900", "--user-data-dir=" + (scratch / "profile"),
       "--virtual-time-budget=60000", "--dump-dom", "file://" + (scratch / "plan.html")},
      scratch / "log");
  Visit visit;
  visit.exit = browser.Wait();
  visit.log = Slurp(scratch / "log");
  const std::string begin = "<pre id=\"probe\">";
  const std::size_t at = visit.log.rfind(begin);
  if (at == std::string::npos) return visit;
  const std::size_t from = at + begin.size();
  visit.seen = visit.log.substr(from, visit.log.find("</pre>", from) - from);
  return visit;
}

class PlanPageInABrowser : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    data_ = new SceneData(MakeSceneData());
    visit_ = new Visit(VisitPage(*data_));
    seen_ = new Json(Json::parse(visit_->seen, nullptr, false));
  }
  static void TearDownTestSuite() {
    delete data_;
    delete visit_;
    delete seen_;
  }
  void SetUp() override {
    if (visit_->exit == kNoSuchProgram) GTEST_SKIP() << "no chromium";
    ASSERT_EQ(visit_->exit, 0) << visit_->log;
    ASSERT_TRUE(seen_->is_object()) << visit_->log;
    ASSERT_EQ(seen_->at("errors"), Json::array());
    ASSERT_TRUE(seen_->contains("fetched")) << "did not get to its end";
  }

  static const SceneData& data() { return *data_; }
  static const Json& seen() { return *seen_; }
  static const Unit& unit(std::uint32_t i) { return data_->fleet.layout.unit({i}); }

  static SceneData* data_;
  static Visit* visit_;
  static Json* seen_;
};
SceneData* PlanPageInABrowser::data_ = nullptr;
Visit* PlanPageInABrowser::visit_ = nullptr;
Json* PlanPageInABrowser::seen_ = nullptr;

// Returns the angle by plan.csv as in docs/files.md: linear within a row, constant otherwise.
double AngleAt(const std::vector<PlanRow>& rows, UnitId unit, Axis axis, double start_deg,
               double t_s) {
  double at_deg = start_deg;
  for (const PlanRow& row : rows) {
    if (row.unit != unit || row.axis != axis || t_s < row.t0_s) continue;
    const double share = std::min(1.0, (t_s - row.t0_s) / (row.t1_s - row.t0_s));
    at_deg = row.from_deg + share * (row.to_deg - row.from_deg);
  }
  return at_deg;
}

TEST_F(PlanPageInABrowser, FetchesNothing) { EXPECT_EQ(seen()["fetched"], 0); }

TEST_F(PlanPageInABrowser, DrawsEveryUnit) {
  EXPECT_EQ(seen()["units"], SceneData::kUnits);
  for (const Json& moment : seen()["moments"]) {
    EXPECT_EQ(moment["drawn"], SceneData::kUnits);
    EXPECT_EQ(moment["unpainted"], Json({SceneData::kUnknown.value})) << moment["t_s"];
  }
}

TEST_F(PlanPageInABrowser, PutsTheArmsWhereTheKinematicsPutThem) {
  const auto rows = RowsOf(data().plan, data().fleet.layout, data().fleet.drives, MotorModel{});
  for (const Json& moment : seen()["moments"]) {
    const double t_s = moment["t_s"];
    for (std::uint32_t i = 0; i < SceneData::kUnits; ++i) {
      if (!data().start[i]) {
        EXPECT_TRUE(moment["fibre_x"][i].is_null());
        continue;
      }
      const AxisAngles start = AnglesOf(unit(i), data().fleet.drives[i], *data().start[i]);
      const SegmentFp arm =
          ArmAt(unit(i), {AngleAt(rows, unit(i).id, Axis::kTheta, start.theta_deg, t_s),
                          AngleAt(rows, unit(i).id, Axis::kPhi, start.phi_deg, t_s)});
      SCOPED_TRACE("unit index " + std::to_string(i) + " at " + std::to_string(t_s) + " s");
      EXPECT_NEAR(moment["elbow_x"][i].get<double>(), arm.a.x_mm, 1e-6);
      EXPECT_NEAR(moment["elbow_y"][i].get<double>(), arm.a.y_mm, 1e-6);
      EXPECT_NEAR(moment["fibre_x"][i].get<double>(), arm.b.x_mm, 1e-6);
      EXPECT_NEAR(moment["fibre_y"][i].get<double>(), arm.b.y_mm, 1e-6);
    }
  }
}

TEST_F(PlanPageInABrowser, TellsWhoMoves) {
  const auto rows = RowsOf(data().plan, data().fleet.layout, data().fleet.drives, MotorModel{});
  for (const Json& moment : seen()["moments"]) {
    int moving = 0;
    for (std::uint32_t i = 0; i < SceneData::kUnits; ++i) {
      const double t_s = moment["t_s"];
      const bool moves = std::any_of(rows.begin(), rows.end(), [&](const PlanRow& row) {
        return row.unit == unit(i).id && row.t0_s <= t_s && t_s < row.t1_s;
      });
      EXPECT_EQ(moment["state"][i] == 0, moves);
      moving += moves ? 1 : 0;
    }
    EXPECT_EQ(moment["told"], std::to_string(moving) + " moving");
  }
}

double PowerAt(const std::vector<PowerStep>& steps, double t_s) {
  double power_W = 0;
  for (const PowerStep& step : steps) {
    if (step.t_s <= t_s) power_W = step.power_W;
  }
  return power_W;
}

TEST_F(PlanPageInABrowser, ShowsThePowersOfTheEstimate) {
  const PlanEstimate estimate =
      Estimate(data().plan, data().fleet.layout, data().fleet.drives, MotorModel{});
  ASSERT_EQ(estimate.rails.size(), 2u);
  for (const Json& moment : seen()["moments"]) {
    const double t_s = moment["t_s"];
    EXPECT_NEAR(moment["total_W"].get<double>(), PowerAt(estimate.total, t_s), 1e-9);
    for (std::size_t k = 0; k < 2; ++k) {
      EXPECT_NEAR(moment["rails_W"][k].get<double>(), PowerAt(estimate.rails[k].steps, t_s), 1e-9);
    }
  }
  EXPECT_GT(seen()["moments"][3]["total_W"], 1);
  EXPECT_NEAR(seen()["makespan_s"].get<double>(), estimate.makespan_s, 1e-9);
}

TEST_F(PlanPageInABrowser, PlaysAndPauses) {
  const Json& play = seen()["play"];
  const auto times = play["times"].get<std::vector<double>>();
  EXPECT_TRUE(std::is_sorted(times.begin(), times.end()));
  EXPECT_GT(times.back(), times.front() + 0.1);
  EXPECT_EQ(play["label"], "Pause");
  EXPECT_EQ(play["paused"], play["later"]);
  EXPECT_THAT(play["shown"].get<std::string>(), HasSubstr(" of "));
}

TEST_F(PlanPageInABrowser, ObeysKeys) {
  const Json& keys = seen()["keys"];
  EXPECT_NEAR(keys["right"].get<double>(), 5.1, 1e-9);
  EXPECT_NEAR(keys["left"].get<double>(), 4.1, 1e-9);
  EXPECT_EQ(keys["end"], seen()["makespan_s"]);
  EXPECT_EQ(keys["home"], 0);
}

TEST_F(PlanPageInABrowser, TellsOfTheUnitThatIsClicked) {
  const Json& clicked = seen()["clicked"];
  EXPECT_EQ(clicked["unit"], std::to_string(unit(20).id.value));
  EXPECT_EQ(clicked["rail"], std::to_string(unit(20).rail.value));
  for (const char* fact : {"state", "theta", "phi", "fibre", "target", "moves", "power"}) {
    EXPECT_TRUE(clicked.contains(fact)) << clicked;
  }
  EXPECT_THAT(seen()["unserved"]["state"].get<std::string>(),
              HasSubstr("unit " + std::to_string(unit(SceneData::kInTheWay.value).id.value) +
                        " is in the way"));
}

TEST_F(PlanPageInABrowser, ZoomsTowardsThePointerAndPans) {
  const Json& view = seen()["view"];
  EXPECT_GT(view["zoomed"]["scale"], 1.5 * view["before"]["scale"].get<double>());
  for (const char* step : {"zoomed", "dragged"}) {
    EXPECT_NEAR(view[step]["x"].get<double>(), view["before"]["x"].get<double>(), 1e-6) << step;
    EXPECT_NEAR(view[step]["y"].get<double>(), view["before"]["y"].get<double>(), 1e-6) << step;
  }
  EXPECT_LT(view["drawn"], SceneData::kUnits) << "only what is in the view";
  EXPECT_GT(view["drawn"], 0);
}

TEST_F(PlanPageInABrowser, JumpsToATightPair) {
  const Json& pair = seen()["pair"];
  EXPECT_EQ(pair["t_s"], 4.25);
  EXPECT_THAT(pair["text"].get<std::string>(), HasSubstr("+1.2"));
  EXPECT_EQ(pair["pressed"], "true");
  EXPECT_EQ(pair["marked"], 1);
  EXPECT_GT(pair["zoomed"], 2);
  EXPECT_NEAR(pair["off_x"].get<double>(), 0, 1e-6);
  EXPECT_NEAR(pair["off_y"].get<double>(), 0, 1e-6);
}

TEST_F(PlanPageInABrowser, TakesTheTimeFromAClickOnTheCurves) {
  EXPECT_NEAR(seen()["curves_t_s"].get<double>(), 7.5, 0.05);
}

TEST_F(PlanPageInABrowser, FindsAUnitByItsId) {
  EXPECT_EQ(seen()["found"], Json::parse(R"(["","no unit 4711"])"));
  EXPECT_EQ(seen()["selected"], data().fleet.layout.Find(UnitId{17})->value);
}

TEST_F(PlanPageInABrowser, NamesInTheLegendWhatThereIs) {
  for (const char* text : {"target not served", "disabled", "place not known",
                           "in the way of another", "fixed obstacles", "tightest pairs"}) {
    EXPECT_THAT(seen()["legend"].get<std::string>(), HasSubstr(text));
  }
}

}  // namespace
}  // namespace focalfleet::report
