// What a controller's error frames say: in which state it is, and what went wrong on the bus. A
// SocketCAN error frame is no frame of the bus; its identifier has one bit a class, its bytes the
// particulars (linux/can/error.h).
#pragma once

#include <linux/can.h>

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "protocol/link/frame_port.h"

namespace focalfleet {

/// What a CAN_RAW socket is to be told of.
can_err_mask_t ErrorsOfInterest();

/// What an error frame says of the controller's state; none where it says nothing of it.
std::optional<LinkState> LinkStateOf(const can_frame& error);

/// The controller counts so many errors that somebody should look, and still works as ever.
bool IsWarning(const can_frame& error);

/// Counts what went wrong since the bus was last well, and names it.
class ErrorTally {
 public:
  void Note(const can_frame& error, std::uint64_t times = 1);
  void Clear() { counts_.fill(0); }
  /// "no acknowledgement, bit error": the most frequent first, at most three; empty: none was seen.
  [[nodiscard]] std::string Causes() const;

 private:
  enum Kind : std::uint8_t { kAcknowledgement, kBit, kStuff, kForm, kCrc, kOverrun, kOther };
  static constexpr std::size_t kKinds = 7;
  std::array<std::uint64_t, kKinds> counts_{};
};

}  // namespace focalfleet
