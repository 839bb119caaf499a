#include "tests/scenario/steps.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace focalfleet::test {

InProcessFleet::Options Small(std::uint64_t seed) { return {.count = 37, .seed = seed}; }

void RunIntoMotion(InProcessFleet* fleet, DurationNs further) {
  ASSERT_TRUE(fleet->RunUntil(
      [&] { return fleet->coordinator().configuration().state == ConfigurationState::kMoving; },
      Seconds(60)));
  fleet->Run(further);
}

PositionerIndex SomebodyMoving(InProcessFleet* fleet) {
  for (std::uint32_t n = 0; n < fleet->layout().size(); ++n)
    if (fleet->world().Truth(n).state == UnitState::kMoving) return {n};
  ADD_FAILURE() << "nobody moves";
  return {0};
}

bool HasAlarm(const InProcessFleet& fleet, const std::string& part) {
  const auto& alarms = fleet.store().alarms;
  return std::any_of(alarms.begin(), alarms.end(), [&](const AlarmRow& alarm) {
    return alarm.text.find(part) != std::string::npos;
  });
}

std::string Unserved(InProcessFleet& fleet) {
  std::string text;
  for (std::uint32_t n = 0; n < fleet.layout().size(); ++n) {
    const UnitView& view = fleet.coordinator().unit({n});
    if (view.outcome != TargetOutcome::kArrived)
      text += "unit " + std::to_string(fleet.id(n).value) + " " + Name(view.phase) + ", " +
              Name(view.knowledge[0].witness) + ": " + Name(view.outcome) + " " +
              view.outcome_reason + "\n";
  }
  return text;
}

void ExpectOthersArrive(InProcessFleet* fleet, std::uint32_t others_than) {
  fleet->Run(Milliseconds(100));  // the last batch becomes durable
  EXPECT_GE(fleet->CountOutcome(TargetOutcome::kArrived), fleet->layout().size() - others_than)
      << Unserved(*fleet);
  fleet->ExpectStoreTellsTheTruth("at the end");
  EXPECT_TRUE(fleet->store().fleet.open_intents.empty());
}

}  // namespace focalfleet::test
