// CameraPort is the source of spot lists. The daemon asks for an exposure and takes each list that
// arrives; fleet/camera decides which of them is used. Nothing that comes through this port is
// trusted.
#pragma once

#include <cstdint>
#include <optional>

#include "daemon/clock/wall_time.h"
#include "fleet/camera/spots.h"

namespace focalfleet {

class CameraPort {
 public:
  CameraPort() = default;
  CameraPort(const CameraPort&) = delete;
  CameraPort& operator=(const CameraPort&) = delete;
  virtual ~CameraPort() = default;

  /// Asks for an exposure that begins no earlier than `since`. Errors: kUnavailable.
  virtual Status Request(std::uint64_t id, WallTime since) = 0;
  /// The next exposure that has arrived; empty where none has. Never waits.
  /// Errors: kInvalid: the data received is no exposure; kUnavailable: nothing can arrive at all.
  /// The next call may succeed.
  virtual Result<std::optional<Exposure>> Take() = 0;
  /// New credentials have replaced those in use, which end at `end`. A port without credentials
  /// ignores the call. Any thread may call.
  virtual void Renew(WallTime /*end*/) {}
};

}  // namespace focalfleet
