// What scenarios do and look at again and again.
#pragma once

#include <cstdint>
#include <string>

#include "tests/scenario/in_process_fleet.h"

namespace focalfleet::test {

/// 37 units, which make a hexagon with four units a side. The rest is as by default.
InProcessFleet::Options Small(std::uint64_t seed);

/// Until somebody moves, and then a little longer: in the middle of the motion.
void RunIntoMotion(InProcessFleet* fleet, DurationNs further);

/// The first unit that moves at `now` and for some time to come.
PositionerIndex SomebodyMoving(InProcessFleet* fleet);

bool HasAlarm(const InProcessFleet& fleet, const std::string& part);

/// A line for each unit that has not arrived: how it stands, and why.
std::string Unserved(InProcessFleet& fleet);

/// All but so many have arrived, the store knows the truth, and no intent is open.
void ExpectOthersArrive(InProcessFleet* fleet, std::uint32_t others_than);

}  // namespace focalfleet::test
