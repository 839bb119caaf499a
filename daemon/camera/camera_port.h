// Where spots come from. The daemon asks for an exposure and takes whatever spot lists come; what
// it may use of them it decides itself (fleet/camera). Nothing that comes through here is trusted.
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
  /// The next exposure that has come; nothing: none. Never waits. Errors: what came is no exposure
  /// (kInvalid), or nothing can come at all (kUnavailable); the next may be good.
  virtual Result<std::optional<Exposure>> Take() = 0;
};

}  // namespace focalfleet
