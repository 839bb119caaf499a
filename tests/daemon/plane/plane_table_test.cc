#include "daemon/plane/plane_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <regex>
#include <set>
#include <string>

#include "daemon/plane/plane_alarms.h"
#include "daemon/plane/plane_commands.h"
#include "daemon/plane/plane_metrics.h"
#include "daemon/plane/plane_refusal.h"
#include "fleet/hex_layout.h"
#include "fleet/kinematics.h"

namespace focalfleet {
namespace {

using std::chrono::milliseconds;
using ::testing::HasSubstr;

PlaneLayout TwoSectors() {
  auto layout = Layout::Create(MakeHexLayout({.count = 20, .units_per_bus = 10}), {});
  return std::move(*PlaneLayout::Create(std::move(*layout), {{{0}}, {{1}}}));
}

/// A coordinator, the table, and what two sectors of ten units each say.
class Bench {
 public:
  void Say(std::uint32_t sector) {
    StatusUpdate update;
    update.fleets.push_back({.units = 10, .sector = sector});
    for (const PositionerIndex i : plane_.own(sector)) {
      UnitStatusValue unit{.unit = plane_.layout().unit(i).id};
      unit.phase = UnitPhase::kReady;
      unit.witness = {Witness::kReported, Witness::kMeasured};
      unit.low_deg = unit.high_deg = {1, 2};
      unit.x_fp_mm = 3;
      update.units.push_back(unit);
    }
    table_.Absorb(update, now_);
  }
  void Pass(milliseconds time) { now_ += time; }
  /// A report of the sector, with the place where its daemon takes requests.
  void Report(std::uint32_t sector, const std::string& door) {
    SectorReport report{.sector = sector, .incarnation = 1, .number = 1, .door = door};
    PlaneEffects out;
    coordinator_.Step({.now = HostInstant{1}, .reports = {&report, 1}}, &out);
  }
  /// Both sectors follow the coordinator; sector 0 alone has said where its units stand.
  void Join() {
    SectorReport reports[2];
    for (std::uint32_t n = 0; n < 2; ++n)
      reports[n] = {.sector = n,
                    .incarnation = 1,
                    .layout = DigestOf(*plane_.layout().Part(plane_.own(n))),
                    .unordered = Seconds(100)};
    auto places = std::make_shared<SectorPlaces>();
    places->places.assign(10, Exactly(Witness::kReported, {100, 100}));
    places->drives.resize(10);
    reports[0].places = places;
    std::uint64_t kept = 0;
    for (int n = 1; n <= 30; ++n) {
      const HostInstant now{Milliseconds(100 * n).ns};
      for (SectorReport& report : reports) {
        ++report.number;
        report.echo = SectorReport::Echo{now, now, now};
      }
      PlaneEffects out;
      coordinator_.Step({.now = now, .reports = reports, .kept = kept}, &out);
      if (out.record) kept = out.record_number;
      for (const PlaneOrder& order : out.orders) reports[order.sector].accepted = order.epoch;
    }
    ASSERT_TRUE(coordinator_.sectors().IsUsable(0) && coordinator_.sectors().IsUsable(1));
  }
  /// The preview of one target for a unit of the sector.
  [[nodiscard]] Result<PlanePreview> Preview(std::uint32_t sector) {
    const Unit& unit = plane_.layout().unit(plane_.own(sector)[0]);
    const PointFp aim = FibreAt(unit, AxisAngles{20, 150});
    const std::string row = std::to_string(unit.id.value) + "," + std::to_string(aim.x_mm) + "," +
                            std::to_string(aim.y_mm) + "\n";
    return PlanePreviewOf(instant(), {{"targets_csv", "unit_id,x_mm,y_mm\n" + row}});
  }
  [[nodiscard]] Json State() const {
    return Json::parse(table_.StateText(coordinator_.sectors(), now_));
  }
  [[nodiscard]] PlaneInstant instant() {
    return {.plane = &plane_,
            .coordinator = &coordinator_,
            .now = HostInstant{1},
            .at = {},
            .link = {},
            .alarms = &alarms_,
            .table = &table_,
            .steady = now_};
  }
  [[nodiscard]] PlaneTable::Counts Count() const { return table_.Count(now_); }
  [[nodiscard]] std::uint32_t UnitOf(std::uint32_t sector) const {
    return plane_.layout().unit(plane_.own(sector)[0]).id.value;
  }

 private:
  PlaneLayout plane_ = TwoSectors();
  PlaneCoordinator coordinator_{&plane_, {}, 7, {}};
  PlaneAlarms alarms_;
  PlaneTable table_{&plane_};
  SteadyTime now_{std::chrono::hours(1)};
};

TEST(PlaneTable, HasTheUnitsOfAllSectorsWithTheirAge) {
  Bench bench;
  bench.Say(0);
  bench.Pass(milliseconds(1500));
  bench.Say(1);
  const Json state = bench.State();
  ASSERT_EQ(state["rows"].size(), 20u);
  std::set<std::uint64_t> units;
  for (const Json& row : state["rows"]) {
    units.insert(row["unit_id"].get<std::uint64_t>());
    EXPECT_EQ(row["phase"], "ready");
    EXPECT_EQ(row["theta_low_deg"], 1.0);
    EXPECT_EQ(row["silent"], false);
    EXPECT_EQ(row["age_s"], row["sector"] == 0 ? 1.5 : 0.0);
  }
  EXPECT_EQ(units.size(), 20u);
  EXPECT_EQ(bench.Count().by_phase[static_cast<std::size_t>(UnitPhase::kReady)], 20u);
}

// Whatever a silent sector said last, its units may have moved since.
TEST(PlaneTable, ShowsNoPlaceOfAUnitWhoseSectorIsSilent) {
  Bench bench;
  bench.Say(0);
  bench.Say(1);
  bench.Pass(milliseconds(3100));
  bench.Say(1);
  const Json state = bench.State();
  for (const Json& row : state["rows"]) {
    if (row["sector"] == 1) continue;
    EXPECT_EQ(row["silent"], true);
    EXPECT_EQ(row["phase"], "silent");
    EXPECT_EQ(row["theta_witness"], "unknown");
    EXPECT_TRUE(row["x_mm"].is_null());
    EXPECT_TRUE(row["theta_low_deg"].is_null());
    EXPECT_EQ(row["age_s"], 3.1);
  }
  EXPECT_EQ(state["sectors"][0]["silent"], true);
  EXPECT_EQ(state["sectors"][1]["silent"], false);
  const PlaneTable::Counts counts = bench.Count();
  EXPECT_EQ(counts.silent_sectors, 1u);
  EXPECT_EQ(counts.by_phase[static_cast<std::size_t>(UnitPhase::kSilent)], 10u);
  EXPECT_EQ(counts.by_witness[static_cast<std::size_t>(Witness::kUnknown)], 10u);
  EXPECT_EQ(counts.enabled, 10u);
}

TEST(PlaneTable, KnowsNothingOfASectorThatWasNeverHeard) {
  Bench bench;
  bench.Say(1);
  const Json state = bench.State();
  EXPECT_TRUE(state["sectors"][0]["age_s"].is_null());
  EXPECT_EQ(state["sectors"][0]["silent"], true);
}

TEST(PlaneMetrics, AreThoseOfTheManualAndFollowTheTable) {
  Bench bench;
  bench.Say(0);
  std::string page = PlaneMetricsText(bench.instant(), {});
  EXPECT_THAT(page, HasSubstr("focalfleet_plane_units{state=\"ready\"} 10\n"));
  EXPECT_THAT(page, HasSubstr("focalfleet_plane_units{state=\"silent\"} 10\n"));
  EXPECT_THAT(page, HasSubstr("focalfleet_plane_sector_silent{sector=\"1\"} 1\n"));
  std::ifstream file(FOCALFLEET_SOURCE_DIR "/docs/metrics.md");
  const std::string manual{std::istreambuf_iterator<char>(file), {}};
  const std::string families = page;
  const std::regex type("# TYPE (focalfleet_plane\\w+) (\\w+)\n");
  std::size_t count = 0;
  for (std::sregex_iterator at(families.begin(), families.end(), type), end; at != end; ++at) {
    ++count;
    EXPECT_THAT(manual, HasSubstr("| `" + (*at)[1].str() + "` | ")) << (*at)[2].str();
  }
  EXPECT_GT(count, 15u);
}

// A sector that is busy, or has just been heard, has published its units and has given no places.
TEST(PlanePreview, TakesUnitsWithoutAPlaceForObstacles) {
  Bench bench;
  bench.Join();
  bench.Say(0);
  bench.Say(1);
  const auto made = bench.Preview(0);
  ASSERT_TRUE(made.has_value()) << made.error().text;
  EXPECT_EQ(made->preview.targeted, 1u);
  EXPECT_EQ(made->preview.refused.size(), 0u);
  const auto frozen = std::ranges::count(made->preview.job.frozen, 1);
  EXPECT_EQ(frozen, 10);
  const auto unknown = bench.Preview(1);
  ASSERT_FALSE(unknown.has_value());
  EXPECT_THAT(unknown.error().text, HasSubstr("is of sector 1, which has not said"));
}

TEST(PlaneRefusal, NamesTheDaemonThatHasTheUnit) {
  Bench bench;
  bench.Report(0, "crate0:/run/ff/zero.sock");
  bench.Report(1, "crate1:/run/ff/one.sock");
  const Error unit =
      RefusalOf(bench.instant(), {.verb = "unit", .args = {{"unit_id", bench.UnitOf(1)}}});
  EXPECT_EQ(unit.code, ErrorCode::kRefused);
  EXPECT_THAT(unit.text, HasSubstr("sector 1 (crate1:/run/ff/one.sock)"));
  EXPECT_THAT(unit.text, ::testing::Not(HasSubstr("sector 0")));
  const Error home = RefusalOf(bench.instant(), {.verb = "home", .args = Json::object()});
  EXPECT_THAT(home.text, HasSubstr("sector 0 (crate0:/run/ff/zero.sock), sector 1 (crate1"));
  const Error both =
      RefusalOf(bench.instant(),
                {.verb = "enable", .args = {{"unit_ids", {bench.UnitOf(0), bench.UnitOf(1)}}}});
  EXPECT_THAT(both.text, HasSubstr("zero.sock), sector 1"));
  EXPECT_EQ(RefusalOf(bench.instant(), {.verb = "unit", .args = {{"unit_id", 4711}}}).code,
            ErrorCode::kInvalid);
}

TEST(PlaneAlarms, AreOpenUntilTheirConditionEnds) {
  PlaneAlarms alarms;
  const ShellNote raised{AlarmName::kSectorClockLoose, "sector 1 has a clock ..."};
  const auto values = alarms.Take({&raised, 1}, {.ns = 5});
  ASSERT_EQ(values.size(), 1u);
  EXPECT_EQ(values[0].row.severity, Severity::kError);
  auto open = alarms.Answer({.verb = "alarms", .args = Json::object()}, "me", {.ns = 6});
  ASSERT_TRUE(open) << open.error().text;
  ASSERT_EQ((*open)["alarms"].size(), 1u);
  EXPECT_EQ((*open)["alarms"][0]["name"], "SectorClockLoose");
  EXPECT_EQ(alarms.CountsJson({.ns = 6})["worst"], "error");
  const auto acknowledged = alarms.Answer(
      {.verb = "alarms_ack", .args = {{"names", {"SectorClockLoose"}}}}, "me", {.ns = 7});
  ASSERT_TRUE(acknowledged) << acknowledged.error().text;
  EXPECT_EQ(alarms.Count({.ns = 8}).open, 0u);
  const ShellNote ended{AlarmName::kSectorClocksGood, "good", AlarmName::kSectorClockLoose};
  static_cast<void>(alarms.Take({&ended, 1}, {.ns = 9}));
  static_cast<void>(alarms.Take({&raised, 1}, {.ns = 10}));
  EXPECT_EQ(alarms.Count({.ns = 11}).open, 1u);
  EXPECT_FALSE(alarms.Answer({.verb = "alarms", .args = {{"all", true}}}, "me", {.ns = 12}));
}

}  // namespace
}  // namespace focalfleet
