// watch runs as a process against a publisher in this one. The output is what DDS keeps for late
// joiners.
#include <gmock/gmock.h>

#include "daemon/control/messages.h"
#include "daemon/dds/status_publisher.h"
#include "tests/daemon/cli/program.h"
#include "tests/daemon/dds/own_domain.h"

namespace focalfleet {
namespace {

using test::Focalfleet;
using test::OwnDomain;
using ::testing::HasSubstr;
using ::testing::Not;

UnitStatusValue UnitAt(std::uint32_t id, UnitPhase phase) {
  UnitStatusValue unit;
  unit.unit = UnitId{id};
  unit.bus = BusId{0};
  unit.node = NodeId{static_cast<std::uint8_t>(id)};
  unit.at = WallTime::Now();
  unit.phase = phase;
  unit.witness = {Witness::kReported, Witness::kReported};
  unit.low_deg = {1.5, 170};
  unit.high_deg = {1.5, 170};
  return unit;
}

void PublishFleet(StatusPublisher* publisher) {
  FleetStatusValue fleet;
  fleet.at = fleet.started = WallTime::Now();
  fleet.version = "9.8.7";
  fleet.units = 2;
  fleet.enabled = 2;
  fleet.units_by_phase[static_cast<std::size_t>(UnitPhase::kReady)] = 1;
  fleet.units_by_phase[static_cast<std::size_t>(UnitPhase::kSilent)] = 1;
  const std::vector<UnitStatusValue> units{UnitAt(1, UnitPhase::kReady),
                                           UnitAt(2, UnitPhase::kSilent)};
  BusStatusValue bus;
  bus.view.link = LinkState::kPassive;
  bus.at = fleet.at;
  ConfigurationProgressValue configuration;
  configuration.at = fleet.at;
  configuration.view.id = 7;
  configuration.view.source = "night.csv";
  configuration.view.state = ConfigurationState::kMoving;
  configuration.view.counts.targeted = 2;
  configuration.view.counts.arrived = 1;
  AlarmValue alarm;
  alarm.at = fleet.at;
  alarm.row.id = 5;
  alarm.row.unit = UnitId{2};
  alarm.row.text = "unit 2 is silent";
  ASSERT_EQ(publisher->Publish(units), 2u);
  ASSERT_EQ(publisher->Publish(std::span<const BusStatusValue>(&bus, 1)), 1u);
  ASSERT_TRUE(publisher->Publish(configuration));
  ASSERT_TRUE(publisher->Publish(alarm));
  ASSERT_TRUE(publisher->Publish(fleet));
  publisher->Flush();
}

TEST(Watch, OnceShowsTheWholeFleetToOneWhoJoinsLate) {
  const auto publisher = StatusPublisher::Create({.domain = OwnDomain(), .config_xml = ""});
  ASSERT_TRUE(publisher) << publisher.error().text;
  PublishFleet(publisher->get());
  const std::string domain = std::to_string(OwnDomain());

  const auto json = Focalfleet({"watch", "--once", "--json", "--domain", domain, "--wait", "20"});
  ASSERT_EQ(json.exit, 0) << json.err;
  const Json reported = Json::parse(json.out, nullptr, false);
  ASSERT_TRUE(reported.is_object()) << json.out;
  EXPECT_EQ(reported["fleet"]["version"], "9.8.7");
  EXPECT_EQ(reported["fleet"]["phases"], (Json{{"ready", 1}, {"silent", 1}}));
  ASSERT_EQ(reported["units"].size(), 2u);
  EXPECT_EQ(reported["units"][1]["unit_id"], 2);
  EXPECT_EQ(reported["units"][1]["phase"], "silent");
  EXPECT_EQ(reported["units"][0]["theta_low_deg"], 1.5);
  EXPECT_TRUE(reported["units"][0]["x_mm"].is_null());

  const auto text = Focalfleet({"watch", "--once", "--domain", domain, "--wait", "20"});
  EXPECT_EQ(text.exit, 0) << text.err;
  EXPECT_THAT(text.out, HasSubstr("focalfleetd 9.8.7"));
  EXPECT_THAT(text.out, HasSubstr("2, 2 enabled: 1 ready, 1 silent"));
}

TEST(Watch, NothingThatIsPublishedMovesTheCursor) {
  const auto publisher = StatusPublisher::Create({.domain = OwnDomain(), .config_xml = ""});
  ASSERT_TRUE(publisher) << publisher.error().text;
  PublishFleet(publisher->get());
  const std::string evil = "x\n\x1b[2Jforged";
  FleetStatusValue fleet;
  fleet.version = evil;
  ConfigurationProgressValue configuration;
  configuration.view.source = evil;
  AlarmValue alarm;
  alarm.row.id = 6;
  alarm.row.text = evil;
  ASSERT_TRUE((*publisher)->Publish(configuration));
  ASSERT_TRUE((*publisher)->Publish(alarm));
  ASSERT_TRUE((*publisher)->Publish(fleet));
  (*publisher)->Flush();
  const auto text =
      Focalfleet({"watch", "--once", "--domain", std::to_string(OwnDomain()), "--wait", "20"});
  EXPECT_EQ(text.exit, 0) << text.err;
  EXPECT_THAT(text.out, Not(HasSubstr("\x1b")));
  EXPECT_THAT(text.out, Not(HasSubstr("\nforged")));
  EXPECT_THAT(text.out, HasSubstr("focalfleetd x\\n\\x1b[2Jforged"));
}

TEST(Watch, TellsThatNobodyPublishes) {
  const auto result = Focalfleet(
      {"watch", "--once", "--json", "--domain", std::to_string(OwnDomain()), "--wait", "0.2"});
  EXPECT_EQ(result.exit, 4);
  EXPECT_THAT(result.err, HasSubstr("no daemon publishes on DDS domain"));
  EXPECT_EQ(Json::parse(result.out, nullptr, false)["exit"], 4);
}

}  // namespace
}  // namespace focalfleet
