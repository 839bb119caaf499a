// The part of a daemon that owns one sector of a plane, as the configuration has it.
#pragma once

#include <memory>

#include "daemon/loop/event_signal.h"
#include "daemon/plane/sector_seat.h"
#include "daemon/process/config.h"
#include "daemon/status/dds_troubles.h"
#include "fleet/layout.h"
#include "fleet/plane/sector_book.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// Waiting times of a plane whose fleet lives faster than the clock on the wall: messages take as
/// long as ever, in real time.
PlaneTimes PlaneTimesAt(double speed);
SectorAgentConfig AgentTimesAt(double speed);

/// Null: the daemon is no sector. `troubles` and `wake` outlive the seat. Errors: those of
/// SectorSeat::Create.
Result<std::unique_ptr<SectorSeat>> OpenSector(const DaemonConfig& config, const Layout& layout,
                                               DdsTroubles* troubles, const EventSignal* wake);

}  // namespace focalfleet
