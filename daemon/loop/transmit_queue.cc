#include "daemon/loop/transmit_queue.h"

#include <algorithm>
#include <variant>

#include "protocol/wire/codec.h"

namespace focalfleet {
namespace {

constexpr std::size_t kBatch = 64;
constexpr int kPriorityShift = 26;

bool IsStop(const CanFrame& frame) { return frame.id >> kPriorityShift == 0; }
bool IsStart(const CanFrame& frame) {
  return frame.id >> kPriorityShift == InfoOf(Function::kStart).priority;
}

/// Takes `waited` off a start signal's delay. False: its instant has passed.
bool ShiftStart(CanFrame* frame, DurationNs waited) {
  auto decoded = DecodeHost(*frame);
  if (!decoded) return true;
  auto* start = std::get_if<Start>(&decoded->message);
  if (start == nullptr) return true;
  // Rounding costs up to half a tick, which is less than the rest of the way to the wire.
  const auto ticks = (waited.ns + kTick.ns / 2) / kTick.ns;
  if (ticks <= 0) return true;
  if (ticks >= std::int64_t{start->delay_ticks}) return false;
  start->delay_ticks -= static_cast<std::uint32_t>(ticks);
  *frame = Encode(HostMessage(*start), decoded->address);
  return true;
}

}  // namespace

bool TransmitQueue::Put(const CanFrame& frame, HostInstant decided_at) {
  auto& queue = IsStop(frame) ? stops_ : others_;
  if (queue.size() >= capacity_) {
    ++counters_.refused;
    return false;
  }
  queue.push_back({frame, decided_at});
  starts_ += IsStart(frame) ? 1u : 0u;
  return true;
}

void TransmitQueue::Flush(FramePort* port, HostInstant now) {
  while (!stops_.empty())
    if (!FlushOne(&stops_, port, now)) return;
  while (!others_.empty())
    if (!FlushOne(&others_, port, now)) return;
}

/// Offers a batch of the queue. False: the port is full.
bool TransmitQueue::FlushOne(std::deque<Waiting>* queue, FramePort* port, HostInstant now) {
  batch_.clear();
  const std::size_t count = std::min(kBatch, queue->size());
  for (std::size_t i = 0; i < count; ++i) {
    CanFrame frame = (*queue)[i].frame;
    if (IsStart(frame) && !ShiftStart(&frame, now - (*queue)[i].decided_at)) {
      // A late start at the front is discarded; else the frames before it go first.
      if (i > 0) break;
      ++counters_.late_starts;
      --starts_;
      queue->pop_front();
      return true;
    }
    batch_.push_back(frame);
  }
  const std::size_t taken = port->Send(batch_);
  starts_ -= static_cast<std::size_t>(
      std::count_if(batch_.begin(), batch_.begin() + static_cast<std::ptrdiff_t>(taken), IsStart));
  queue->erase(queue->begin(), queue->begin() + static_cast<std::ptrdiff_t>(taken));
  return taken == batch_.size();
}

void TransmitQueue::Clear() {
  counters_.stale += size();
  stops_.clear();
  others_.clear();
  starts_ = 0;
}

}  // namespace focalfleet
