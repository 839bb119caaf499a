// These functions are steps and checks that many scenarios share.
#pragma once

#include <cstdint>
#include <string>

#include "tests/scenario/in_process_fleet.h"

namespace focalfleet::test {

/// Runs until a unit moves and then for `further`: into the middle of the motion.
void RunIntoMotion(InProcessFleet* fleet, DurationNs further);

/// The first unit that moves now and for some time to come.
PositionerIndex SomebodyMoving(InProcessFleet* fleet);

bool HasAlarm(const InProcessFleet& fleet, const std::string& part);

/// A line for each unit that has not arrived, with its state and reason.
std::string Unserved(InProcessFleet& fleet);

/// Expects that all units but `others_than` have arrived, that the store is true, and that no
/// intent is open.
void ExpectOthersArrive(InProcessFleet* fleet, std::uint32_t others_than);

}  // namespace focalfleet::test
