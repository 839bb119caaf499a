// These functions are steps and checks that many scenarios share.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tests/scenario/in_process_fleet.h"

namespace focalfleet::test {

/// 37 units, which make a hexagon with four units a side. The rest is as by default.
InProcessFleet::Options Small(std::uint64_t seed);

/// Runs until a unit moves and then for `further`: into the middle of the motion.
void RunIntoMotion(InProcessFleet* fleet, DurationNs further);

/// The first unit that moves now and for some time to come.
PositionerIndex SomebodyMoving(InProcessFleet* fleet);

/// Sends a stop of all on every bus from another program, as `stop --direct` does.
void StopDirectly(InProcessFleet* fleet);

/// The true places of all units, as the nearest vectors. Shape: (n).
std::vector<Pose> TruePoses(InProcessFleet& fleet);

/// Fails the running test where a unit's true angle is not within what the store holds.
void ExpectStoreTellsTheTruth(InProcessFleet& fleet, const std::string& when);

std::uint32_t CountOutcome(InProcessFleet& fleet, TargetOutcome outcome);

bool HasAlarm(const InProcessFleet& fleet, const std::string& part);

/// A line for each unit that has not arrived, with its state and reason.
std::string Unserved(InProcessFleet& fleet);

/// Expects that all units but `others_than` have arrived, that the store is true, and that no
/// intent is open.
void ExpectOthersArrive(InProcessFleet* fleet, std::uint32_t others_than);

}  // namespace focalfleet::test
