#include "sim/world/bus/error_rules.h"

namespace focalfleet::sim {

// A node without errors costs nothing: counters are only updated while one of them is not zero.
void CountWell(std::uint32_t sender, HostInstant now, BusNodes* nodes) {
  if (nodes->clean()) return;
  for (std::uint32_t node = 0; node < nodes->size(); ++node) {
    if (!(*nodes)[node].hears() || (*nodes)[node].errors.clean()) continue;
    nodes->Count(node, now, [&](ErrorCounters* errors) {
      node == sender ? errors->Transmitted() : errors->Received();
    });
  }
}

std::vector<std::uint32_t> CountError(const FrameOnWire& frame, HostInstant now, BusNodes* nodes) {
  const std::uint32_t sender = frame.entry.node();
  const FrameCourse& course = frame.course;
  std::vector<std::uint32_t> off;
  const auto count = [&](std::uint32_t node, const auto& change) {
    if (nodes->Count(node, now, change)) off.push_back(node);
  };
  for (std::uint32_t node = 0; node < nodes->size(); ++node) {
    if (!(*nodes)[node].hears()) continue;
    if (node == sender && !course.lost_arbitration) {
      const bool passive = (*nodes)[node].state() == Confinement::kPassive;
      if (frame.abandoned || course.excused || (course.unanswered && passive)) continue;
      count(node, [](ErrorCounters* errors) { errors->TransmitError(); });
    } else if (node == frame.refusing) {
      // The flag of this node begins one bit before the others' flags and ends one bit before them.
      count(node, [](ErrorCounters* errors) {
        errors->ReceiveError();
        errors->DominantBehindFlag();
      });
    } else if (!course.accepted) {
      count(node, [](ErrorCounters* errors) { errors->ReceiveError(); });
    }
  }
  return off;
}

StuckCount CountStuck(const StuckWire& stuck, BusNodes* nodes) {
  StuckCount counted;
  for (std::uint32_t node = 0; node < nodes->size(); ++node) {
    if (!(*nodes)[node].hears()) continue;
    const bool sends = node == stuck.sender;
    const bool went_off = nodes->Count(node, stuck.step_at, [&](ErrorCounters* errors) {
      if (!sends) {
        stuck.steps == 0 ? errors->ReceiveError() : errors->DominantBehindFlag();
      } else if (stuck.steps != 1) {
        errors->TransmitError();
      }
    });
    if (went_off) counted.off.push_back(node);
    if (sends || (*nodes)[node].state() == Confinement::kActive) counted.last = false;
  }
  return counted;
}

}  // namespace focalfleet::sim
