#include "fleet/coordinate/ledger.h"

#include <gtest/gtest.h>

#include <map>
#include <string>
#include <utility>
#include <variant>
#include <vector>

namespace focalfleet {
namespace {

Layout OneUnit(std::uint8_t sensors = 0) {
  Unit unit;
  unit.id = UnitId{1};
  unit.axis = {AxisGeometry{7.4, 0, 890, -190, 190}, AxisGeometry{7.4, 0, 890, 0, 190}};
  unit.bus = BusId{0};
  unit.node = NodeId{1};
  unit.sensors = sensors;
  if (sensors > 0) unit.carrier_mm = 100;
  return Layout::Create({unit}, {}).value();
}

/// A store in which these conditions last.
StoredFleet Lasting(const std::vector<OpenAlarmRow>& alarms) {
  StoredFleet stored;
  for (OpenAlarmRow row : alarms) {
    row.id = stored.next_alarm++;
    stored.open_alarms.push_back(row);
  }
  return stored;
}

OpenAlarmRow Open(AlarmName name, std::optional<UnitId> unit = {}, std::optional<BusId> bus = {}) {
  return {.name = name, .unit = unit, .bus = bus};
}

/// The conditions that end in the step at `now`, by their names, with the reasons.
std::multimap<std::string, std::string> EndedAt(HostInstant now, Ledger* ledger, StepState* step) {
  Effects effects;
  *step = {.now = now, .out = &effects};
  ledger->BeginStep(0, false);
  std::multimap<std::string, std::string> ended;
  for (const Row& row : effects.rows)
    if (const auto* end = std::get_if<AlarmEndRow>(&row))
      ended.emplace(Name(end->name), end->reason);
  return ended;
}

using Ended = std::multimap<std::string, std::string>;

TEST(Ledger, ConditionsOfWhatLeftTheConfigurationEndAtTheStart) {
  const Layout layout = OneUnit();
  const CoordinatorConfig config;
  StepState step;
  Ledger ledger(
      layout, config,
      Lasting({Open(AlarmName::kUnitSilent, UnitId{9}), Open(AlarmName::kUnitFault, UnitId{1}),
               Open(AlarmName::kBusDown, {}, BusId{4}), Open(AlarmName::kCameraLate),
               Open(AlarmName::kExposureRefused), Open(AlarmName::kCameraFailed),
               Open(AlarmName::kSensorsSilent, UnitId{1})}),
      step);
  EXPECT_EQ(EndedAt(HostInstant{0}, &ledger, &step),
            (Ended{{"UnitSilent", "unit 9 left the layout"},
                   {"BusDown", "bus 4 left the layout"},
                   {"CameraLate", "the camera left the configuration"},
                   {"ExposureRefused", "the camera left the configuration"},
                   {"CameraFailed", "the camera left the configuration"},
                   {"SensorsSilent", "the sensors of unit 1 left the configuration"}}));
  EXPECT_TRUE(ledger.alarms().Lasts(AlarmName::kUnitFault, {0})) << "the unit is still there";
  EXPECT_TRUE(EndedAt(HostInstant{1}, &ledger, &step).empty()) << "each once";
}

TEST(Ledger, ConditionsOfWhatIsThereLast) {
  const Layout layout = OneUnit(4);
  const CoordinatorConfig config{.reads_sensors = true, .has_camera = true};
  StepState step;
  Ledger ledger(
      layout, config,
      Lasting({Open(AlarmName::kUnitSilent, UnitId{1}), Open(AlarmName::kBusDown, {}, BusId{0}),
               Open(AlarmName::kCameraLate), Open(AlarmName::kSensorsSilent, UnitId{1})}),
      step);
  EXPECT_TRUE(EndedAt(HostInstant{0}, &ledger, &step).empty());
}

TEST(Ledger, ConditionsOfTheHostThatAreNotFoundAgainEndAfterTheTimeOfTheConfiguration) {
  const Layout layout = OneUnit();
  const CoordinatorConfig config{.confirm_within = Seconds(200)};
  StepState step;
  Ledger ledger(layout, config,
                Lasting({Open(AlarmName::kBusDown, {}, BusId{0}), Open(AlarmName::kDdsMissing)}),
                step);
  EXPECT_TRUE(EndedAt(HostInstant{0}, &ledger, &step).empty());
  EXPECT_TRUE(EndedAt(HostInstant{Seconds(199).ns}, &ledger, &step).empty());
  EXPECT_EQ(EndedAt(HostInstant{Seconds(200).ns}, &ledger, &step),
            (Ended{{"BusDown", ""}, {"DdsMissing", ""}}));
}

// A unit's own memory of a restart is needed until the store has the end of its move.
TEST(Ledger, AMoveHasItsEndOnceThatIsCommitted) {
  const Layout layout = OneUnit();
  const CoordinatorConfig config;
  StepState step;
  StoredFleet stored;
  const SerialNumber serial{7};
  stored.open_intents.push_back({.serial = serial, .unit = UnitId{1}, .move = MoveId{3}});
  Ledger ledger(layout, config, stored, step);
  Effects effects;
  step = {.now = HostInstant{0}, .out = &effects};
  ledger.BeginStep(0, false);
  EXPECT_TRUE(ledger.HasEnd(SerialNumber{8})) << "it never had a move";
  EXPECT_FALSE(ledger.HasEnd(serial));
  EXPECT_EQ(ledger.BatchOfEnd(serial), Ledger::kOpen);
  ledger.EndIntent(serial, IntentEnd::kInterrupted);
  const std::uint64_t batch = ledger.batch_now();
  ledger.CloseBatch();
  EXPECT_FALSE(ledger.HasEnd(serial)) << "known and not stored";
  EXPECT_EQ(ledger.BatchOfEnd(serial), batch);
  ledger.BeginStep(batch - 1, true);
  EXPECT_FALSE(ledger.HasEnd(serial));
  ledger.BeginStep(batch, false);
  EXPECT_TRUE(ledger.HasEnd(serial));
}

}  // namespace
}  // namespace focalfleet
