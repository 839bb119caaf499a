// TransmitWindow counts the host's frames below the socket: in the interface's queue, in the
// controller, on the wire. A stop can overtake nothing there, so frames wait above, where it can.
// At most three are below, and the third place is reserved for a stop. At most two frames are
// therefore ahead of a stop: the one on the wire and one more, 2 x 160 bits. Where bus.can_fd is
// on, they are 2 groups of staging frames, each counted as one frame, of up to 393 us.
//
// Two frames keep a bus busy. The first is on the wire (131 us and more at 1 Mbit/s for 8 bytes).
// The host has this time to learn that the one before has left and to hand down the next.
//
// Three sources are combined; the most pessimistic one holds:
//   confirmations  a driver that echoes gives each frame back when it has left (IFF_ECHO)
//   memory         what the kernel still charges to the socket; blind past a queue that disowns
//   bit clock      a frame cannot have left before its bits have; where a controller does not echo
//
// A virtual interface without a queue passes a frame on while it takes it. The window hands ever
// more frames at once to an interface that was never seen to hold any, until it holds one. The
// class is pure: time, bits and charges are arguments.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>

#include "protocol/base/instants.h"
#include "protocol/wire/can_frame.h"
#include "protocol/wire/stage_group.h"

namespace focalfleet {

class TransmitWindow {
 public:
  static constexpr std::size_t kAll = 3;
  static constexpr std::size_t kOrdinary = 2;
  static constexpr std::size_t kUnheldMax = 64;  // at once, where nothing is ever held

  struct Options {
    bool confirms = false;                // the driver echoes: confirmations arrive
    std::uint32_t bit_rate_bps = 0;       // 0: the time of frames is not known
    std::uint32_t data_bit_rate_bps = 0;  // of the inner part of groups
  };
  TransmitWindow() = default;
  explicit TransmitWindow(const Options& options) : options_(options) {}

  /// True where bits take their time, or confirmations may be lost: `now` matters, and is
  /// monotonic.
  [[nodiscard]] bool needs_time() const { return options_.confirms || options_.bit_rate_bps > 0; }
  /// The number of frames that may be handed down now; `urgent` (a stop) may take the last place.
  [[nodiscard]] std::size_t Room(bool urgent, HostInstant now) const;
  /// The instant at which the bit clock makes room for an ordinary frame; kNever where another
  /// event reports room.
  [[nodiscard]] HostInstant RoomAt() const;

  void Sent(const CanFrame& frame, HostInstant now);
  void Sent(const FdFrame& group, HostInstant now);
  /// This many of the host's frames have come back.
  void Confirmed(std::size_t frames);
  /// Another node's frame ended at `at`; the host's waiting frames were delayed by its duration.
  void Heard(const CanFrame& frame, HostInstant at);
  /// The kernel charges this to the socket now. Units: bytes.
  void Charged(std::size_t bytes);
  /// None of the host's frames is below any more (the link came up anew), or no event will ever
  /// report them.
  void Clear();

  [[nodiscard]] const Options& options() const { return options_; }
  [[nodiscard]] std::size_t unconfirmed() const { return unconfirmed_; }

 private:
  template <class Frame>
  void Count(const Frame& frame, HostInstant now);
  [[nodiscard]] std::size_t ByMemory() const;
  [[nodiscard]] std::size_t ByBitClock(HostInstant now) const;

  Options options_;
  std::size_t unconfirmed_ = 0;
  std::size_t charged_bytes_ = 0;
  std::size_t frame_bytes_ = 0;      // charge of one frame; 0: not seen yet
  bool held_ = false;                // the kernel was seen to hold frames
  std::size_t at_once_ = kOrdinary;  // number that was seen not to be held
  std::size_t sent_when_empty_ = 0;  // frames handed down since the kernel held none
  std::deque<HostInstant> ends_;     // by the bit clock, of the last kAll frames
};

}  // namespace focalfleet
