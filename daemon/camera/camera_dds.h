// A camera behind two DDS topics (daemon/dds/focalfleet.idl): we ask by
// focalfleet/exposure_request, it answers by focalfleet/exposure. What was sent before the daemon
// listened never comes. Samples are held to what files are held to (CheckSpots); Cyclone has
// refused those that are no Exposure at all, without a word.
#pragma once

#include <memory>

#include "daemon/camera/camera_port.h"
#include "daemon/dds/status_publisher.h"

namespace focalfleet {

class CameraDds : public CameraPort {
 public:
  /// Errors: kUnavailable.
  static Result<std::unique_ptr<CameraDds>> Open(const DdsOptions& dds, SensorLimits sensor);
  ~CameraDds() override;

  Status Request(std::uint64_t id, WallTime since) override;
  Result<std::optional<Exposure>> Take() override;

 private:
  class Impl;
  explicit CameraDds(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace focalfleet
