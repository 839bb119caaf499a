// These functions read a controller's error frames: the controller's state, and the faults on the
// bus. A SocketCAN error frame is no frame of the bus. Its identifier has one bit for each class of
// error, and its bytes hold the details (linux/can/error.h).
#pragma once

#include <linux/can.h>

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "protocol/link/frame_port.h"

namespace focalfleet {

/// The classes of errors that a CAN_RAW socket must deliver.
can_err_mask_t ErrorsOfInterest();

/// The controller's state by an error frame; empty where the frame does not give one.
std::optional<LinkState> LinkStateOf(const can_frame& error);

/// True where the controller's error count calls for attention, though the controller still works
/// normally.
bool IsWarning(const can_frame& error);

/// Counts and names the errors since the bus last worked well.
class ErrorTally {
 public:
  void Note(const can_frame& error, std::uint64_t times = 1);
  void Clear() { counts_.fill(0); }
  /// Text such as "no acknowledgement, bit error": the most frequent first, at most three. Empty:
  /// none was seen.
  [[nodiscard]] std::string Causes() const;

 private:
  enum Kind : std::uint8_t { kAcknowledgement, kBit, kStuff, kForm, kCrc, kOverrun, kOther };
  static constexpr std::size_t kKinds = 7;
  std::array<std::uint64_t, kKinds> counts_{};
};

}  // namespace focalfleet
