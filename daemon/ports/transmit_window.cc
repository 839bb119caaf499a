#include "daemon/ports/transmit_window.h"

#include <algorithm>

#include "protocol/wire/frame_bits.h"

namespace focalfleet {
namespace {

DurationNs TimeOf(const CanFrame& frame, const TransmitWindow::Options& options) {
  return BitTime(FrameBits(frame), options.bit_rate_bps);
}
DurationNs TimeOf(const FdFrame& group, const TransmitWindow::Options& options) {
  return BitTime(FrameBits(group), {options.bit_rate_bps, options.data_bit_rate_bps});
}

}  // namespace

std::size_t TransmitWindow::ByMemory() const {
  if (charged_bytes_ == 0) return 0;
  // The kernel decides how much one frame is charged. Until a frame went down alone, any charge may
  // stand for all frames sent since the charge was 0.
  if (frame_bytes_ == 0) return std::min(kAll, sent_when_empty_);
  return (charged_bytes_ + frame_bytes_ - 1) / frame_bytes_;
}

std::size_t TransmitWindow::ByBitClock(HostInstant now) const {
  return static_cast<std::size_t>(
      std::ranges::count_if(ends_, [now](HostInstant end) { return end > now; }));
}

std::size_t TransmitWindow::Room(bool urgent, HostInstant now) const {
  if (!held_ && !needs_time()) return at_once_;
  const std::size_t below = std::max({unconfirmed_, ByMemory(), ByBitClock(now)});
  // A single frame shows what one is charged. A bit clock suffices without that figure.
  const bool to_learn = held_ && frame_bytes_ == 0 && !urgent && options_.bit_rate_bps == 0;
  const std::size_t allowed = urgent ? kAll : to_learn ? 1 : kOrdinary;
  return allowed > below ? allowed - below : 0;
}

HostInstant TransmitWindow::RoomAt() const {
  return ends_.size() < kOrdinary ? kNever : ends_[ends_.size() - kOrdinary];
}

template <class Frame>
void TransmitWindow::Count(const Frame& frame, HostInstant now) {
  if (options_.confirms) ++unconfirmed_;
  ++sent_when_empty_;
  if (options_.bit_rate_bps == 0) return;
  const HostInstant idle = ends_.empty() ? now : std::max(now, ends_.back());
  ends_.push_back(idle + TimeOf(frame, options_));
  if (ends_.size() > kAll) ends_.pop_front();
}

void TransmitWindow::Sent(const CanFrame& frame, HostInstant now) { Count(frame, now); }
void TransmitWindow::Sent(const FdFrame& group, HostInstant now) { Count(group, now); }

void TransmitWindow::Confirmed(std::size_t frames) {
  unconfirmed_ -= std::min(unconfirmed_, frames);
}

void TransmitWindow::Heard(const CanFrame& frame, HostInstant at) {
  if (options_.bit_rate_bps == 0) return;
  const DurationNs took = TimeOf(frame, options_);
  for (HostInstant& end : ends_)
    if (end > at - took) end = end + took;
}

void TransmitWindow::Charged(std::size_t bytes) {
  if (bytes > 0 && charged_bytes_ == 0 && sent_when_empty_ == 1) frame_bytes_ = bytes;
  charged_bytes_ = bytes;
  held_ = held_ || bytes > 0;
  if (bytes > 0) return;
  if (sent_when_empty_ >= at_once_) at_once_ = std::min(2 * at_once_, kUnheldMax);
  sent_when_empty_ = 0;
}

void TransmitWindow::Clear() {
  unconfirmed_ = 0;
  charged_bytes_ = 0;
  sent_when_empty_ = 0;
  ends_.clear();
}

}  // namespace focalfleet
