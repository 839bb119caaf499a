#include "sim/world/bus/arbitration_queue.h"

namespace focalfleet::sim {

std::optional<QueuedFrame> ArbitrationQueue::Take(HostInstant now, std::uint32_t passed_over) {
  while (!later_.empty() && later_.top().ready <= now) {
    ready_.push(later_.top());
    later_.pop();
  }
  if (ready_.empty()) return std::nullopt;
  if (ready_.top().node() == passed_over) return ready_.TakeBestBut(passed_over);
  std::optional<QueuedFrame> best = ready_.top();
  ready_.pop();
  return best;
}

}  // namespace focalfleet::sim
