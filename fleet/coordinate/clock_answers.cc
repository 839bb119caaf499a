#include "fleet/coordinate/clock_answers.h"

#include <cmath>
#include <string>
#include <utility>

#include "fleet/plan/planner.h"

namespace focalfleet {
namespace {

std::string InPercent(double share) {
  const auto hundredths = std::llround(std::abs(share) * 1e4);
  return (share < 0 ? "-" : "") + std::to_string(hundredths / 100) + "." +
         std::to_string(hundredths % 100 / 10) + std::to_string(hundredths % 10) + " %";
}

void ReportClock(const Coordination& fleet, PositionerIndex i, const ClockReply& reply) {
  UnitRecord& record = fleet.units[i];
  const ClockMap::Rate rate = record.clock.rate();
  record.view.clock = {.readings = static_cast<std::uint32_t>(record.clock.readings()),
                       .rate_error = rate.error,
                       .rate_bound = rate.bound,
                       .bound_s = record.clock.TimeOf(reply.ticks).bound().seconds()};
  const double allowed = PlanOptions{}.clock_error;
  if (!rate.IsBeyond(allowed) || std::exchange(record.clock_reported, true)) return;
  fleet.ledger.alarms().Raise(
      AlarmName::kUnitClockOff, i, {},
      fleet.units.NameOf(i) + "'s clock is off by " + InPercent(rate.least) + " to " +
          InPercent(rate.most) + ", more than the " + InPercent(allowed) +
          " that plans allow for (" + std::to_string(record.clock.readings()) + " readings)");
}

}  // namespace

void OnClock(const Coordination& fleet, PositionerIndex i, const ClockReply& reply,
             HostInstant at) {
  UnitRecord& record = fleet.units[i];
  const bool taken = record.clock.Observe({reply.ticks, record.request.answered_asked, at});
  if (taken) ReportClock(fleet, i, reply);
  if (record.view.phase == UnitPhase::kIdentifying) {
    ++record.reading.step;
  } else if (taken && std::exchange(record.motion.wants_start, false) && reply.began_ticks != 0) {
    record.motion.began = record.clock.TimeOf(reply.began_ticks);
    fleet.units.Report(i, UnitEventKind::kStartReported);
  }
}

}  // namespace focalfleet
