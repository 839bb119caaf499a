#include "tests/scenario/steps.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "protocol/wire/codec.h"

namespace focalfleet::test {

namespace {

// At rest the rotor lags the field by the angle whose sine is load over stall torque, 15 degrees of
// 360 at 1.8 V. The lag is 4 of 96 vectors. The remaining 2 are for rounding and for the motor's
// own spread. The interval, not this margin, contains the effect of a cut motion. No run of these
// scenarios exceeds 5.
constexpr double kLagVectorsMax = 6;

}  // namespace

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

std::uint32_t CountOutcome(InProcessFleet& fleet, TargetOutcome outcome) {
  std::uint32_t count = 0;
  for (std::uint32_t n = 0; n < fleet.layout().size(); ++n)
    if (fleet.coordinator().unit({n}).outcome == outcome) ++count;
  return count;
}

std::vector<Pose> TruePoses(InProcessFleet& fleet) {
  std::vector<Pose> poses;
  for (std::size_t n = 0; n < fleet.layout().size(); ++n) {
    const sim::UnitTruth truth = fleet.world().Truth(n);
    poses.push_back({static_cast<std::int32_t>(std::lround(truth.vectors[0])),
                     static_cast<std::int32_t>(std::lround(truth.vectors[1]))});
  }
  return poses;
}

void ExpectStoreTellsTheTruth(InProcessFleet& fleet, const std::string& when) {
  for (std::size_t n = 0; n < fleet.layout().size(); ++n) {
    const UnitView& view = fleet.coordinator().unit({static_cast<std::uint32_t>(n)});
    const VectorRow* row = fleet.store().Vector(view.serial);
    const sim::UnitTruth truth = fleet.world().Truth(n);
    EXPECT_EQ(truth.begun_twice, 0u) << when << ": unit " << truth.id.value;
    ASSERT_NE(row, nullptr) << when << ": unit " << truth.id.value;
    for (const Axis axis : kAxes) {
      const AxisKnowledge& known = row->knowledge[Index(axis)];
      if (known.witness == Witness::kUnknown) continue;
      EXPECT_GE(truth.vectors[Index(axis)], known.low - kLagVectorsMax)
          << when << ": unit " << truth.id.value << " " << Name(axis) << " " << Name(known.witness);
      EXPECT_LE(truth.vectors[Index(axis)], known.high + kLagVectorsMax)
          << when << ": unit " << truth.id.value << " " << Name(axis) << " " << Name(known.witness);
    }
  }
}

void StopDirectly(InProcessFleet* fleet) {
  constexpr std::uint8_t kOtherHostsSequence = 255;
  for (const BusId bus : fleet->layout().buses())
    fleet->world().Inject(bus, Encode(HostMessage(Stop{}), {kBroadcastNode, kOtherHostsSequence}),
                          fleet->now(), 1);
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
  EXPECT_GE(CountOutcome(*fleet, TargetOutcome::kArrived), fleet->layout().size() - others_than)
      << Unserved(*fleet);
  ExpectStoreTellsTheTruth(*fleet, "at the end");
  EXPECT_TRUE(fleet->store().fleet.open_intents.empty());
}

}  // namespace focalfleet::test
