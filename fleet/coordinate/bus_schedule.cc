#include "fleet/coordinate/bus_schedule.h"

#include <algorithm>

#include "protocol/base/limits.h"

namespace focalfleet {

void BusSchedule::Queue::PushBack(const Entry& entry) {
  // Room at the front is used where that moves no more entries than have left since.
  if (entries_.size() == entries_.capacity() && front_ > 0 && front_ >= size()) {
    entries_.erase(entries_.begin(), entries_.begin() + static_cast<std::ptrdiff_t>(front_));
    front_ = 0;
  }
  entries_.push_back(entry);
}

void BusSchedule::Queue::PopFront() {
  if (++front_ < entries_.size()) return;
  entries_.clear();
  front_ = 0;
}

std::size_t BusSchedule::Queue::Drop(NodeId node) {
  const auto kept = std::remove_if(
      entries_.begin() + static_cast<std::ptrdiff_t>(front_), entries_.end(),
      [&](const Entry& entry) { return (entry.frame.id >> 11 & 255) == node.value; });
  const auto dropped = static_cast<std::size_t>(entries_.end() - kept);
  entries_.erase(kept, entries_.end());
  return dropped;
}

bool BusSchedule::Enqueue(const Entry& entry) {
  if (waiting_ == limits::kFramesPerBusQueued) return false;
  queue_[entry.frame.id >> 26].PushBack(entry);
  ++waiting_;
  return true;
}

void BusSchedule::Release(HostInstant now, DurationNs horizon, BusId bus,
                          std::vector<OutFrame>* frames, std::vector<PositionerIndex>* asked) {
  busy_until_ = std::max(busy_until_, now);
  if (now < held_until_) return;
  for (auto& queue : queue_) {
    while (!queue.empty() && busy_until_ < now + horizon) {
      const OnWire next = Next(queue);
      std::uint32_t bits = next.bits;
      for (std::size_t i = 0; i < next.frames; ++i) {
        const Entry& entry = queue[0];
        frames->push_back({bus, entry.frame});
        if (entry.asks) asked->push_back(*entry.asks);
        bits += entry.reply_bits;
        queue.PopFront();
      }
      busy_until_ = busy_until_ + BitTime(bits, rates_.nominal_bps);
      waiting_ -= next.frames;
    }
  }
}

OnWire BusSchedule::Next(const Queue& queue) const {
  std::array<CanFrame, kGroupEntriesMax> front;
  const std::size_t count = rates_.data_bps == 0 ? 1 : std::min(queue.size(), front.size());
  for (std::size_t i = 0; i < count; ++i) front[i] = queue[i].frame;
  return NextOnWire({front.data(), count}, rates_);
}

void BusSchedule::Charge(HostInstant now, std::uint32_t bits) {
  busy_until_ = std::max(busy_until_, now) + BitTime(bits, rates_.nominal_bps);
}

HostInstant BusSchedule::ReadyAt(DurationNs horizon) const {
  if (waiting_ == 0) return kNever;
  // Half a horizon is refilled at a time: frequent enough to keep the bus busy, rare enough to
  // batch.
  return std::max(busy_until_ - DurationNs{horizon.ns / 2}, held_until_);
}

std::size_t BusSchedule::Drop(NodeId node) {
  std::size_t dropped = 0;
  for (Queue& queue : queue_) dropped += queue.Drop(node);
  waiting_ -= dropped;
  return dropped;
}

}  // namespace focalfleet
