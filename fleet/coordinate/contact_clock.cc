// Contact, what a unit says of its clock.

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "fleet/coordinate/contact.h"

namespace focalfleet {
namespace {

std::string InPercent(double share) {
  const auto hundredths = std::llround(std::abs(share) * 1e4);
  return (share < 0 ? "-" : "") + std::to_string(hundredths / 100) + "." +
         std::to_string(hundredths % 100 / 10) + std::to_string(hundredths % 10) + " %";
}

}  // namespace

void Contact::OnClock(PositionerIndex i, const ClockReply& reply, HostInstant at) {
  UnitRecord& record = core_.unit(i);
  // Its request ended in between. By how much later and sooner the bits of both would tell, but
  // virtual interfaces take no time.
  const HostInstant earliest = std::min(record.answered_asked, at);
  record.clock.Observe({reply.ticks, earliest, at});
  const ClockMap::Rate rate = record.clock.rate();
  record.view.clock = {.readings = static_cast<std::uint32_t>(record.clock.readings()),
                       .rate_error = rate.error,
                       .rate_bound = rate.bound,
                       .bound_s = record.clock.TimeOf(reply.ticks).bound.seconds()};
  const double off = std::abs(rate.error) - rate.bound;
  if (off > PlanOptions{}.clock_error && !record.clock_told)
    core_.Raise(Severity::kError, i, {},
                core_.NameOf(i) + "'s clock is off by " + InPercent(rate.error) + " (+- " +
                    InPercent(rate.bound) + "), more than the " +
                    InPercent(PlanOptions{}.clock_error) + " that plans allow for");
  if (off > PlanOptions{}.clock_error) record.clock_told = true;  // once; anew when it is read anew
  if (record.view.phase == UnitPhase::kIdentifying) {
    ++record.reading.step;
  } else if (std::exchange(record.wants_start, false) && reply.began_ticks != 0) {
    record.began = record.clock.TimeOf(reply.began_ticks);
    core_.Tell(i, UnitEventKind::kStartTold);
  }
}

}  // namespace focalfleet
