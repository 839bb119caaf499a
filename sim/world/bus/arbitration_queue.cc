#include "sim/world/bus/arbitration_queue.h"

namespace focalfleet::sim {

std::optional<QueuedFrame> ArbitrationQueue::Take(HostInstant now, std::uint32_t passed_over) {
  while (!later_.empty() && later_.top().ready <= now) {
    ready_.push(later_.top());
    later_.pop();
  }
  if (ready_.empty()) return std::nullopt;
  std::vector<QueuedFrame> kept;
  std::optional<QueuedFrame> best;
  while (!best && !ready_.empty()) {
    if (ready_.top().node() == passed_over) {
      kept.push_back(ready_.top());
    } else {
      best = ready_.top();
    }
    ready_.pop();
  }
  for (const QueuedFrame& entry : kept) ready_.push(entry);
  return best;
}

}  // namespace focalfleet::sim
