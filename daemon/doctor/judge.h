// The rooms of the checks: each function judges facts of one subject. All are pure. Where a fact is
// missing because the configuration cannot be read, a subject has no checks.
#pragma once

#include <vector>

#include "daemon/doctor/check.h"
#include "daemon/doctor/facts.h"

namespace focalfleet::doctor {

using Checks = std::vector<Check>;

/// Whether the daemon answers, its version, its open alarms, units and buses in trouble.
void JudgeDaemon(const Facts& facts, Checks* checks);
/// The configuration and the fleet's files.
void JudgeConfig(const Facts& facts, Checks* checks);
/// AF_CAN, and each interface of bus.interfaces.
void JudgeBuses(const Facts& facts, Checks* checks);
/// Rights on folders and devices, free space.
void JudgeFiles(const Facts& facts, Checks* checks);
void JudgeStore(const Facts& facts, Checks* checks);
/// Participants, interfaces and buffers of DDS.
void JudgeDds(const Facts& facts, Checks* checks);
/// Clock and kernel limits.
void JudgeHost(const Facts& facts, Checks* checks);

}  // namespace focalfleet::doctor
