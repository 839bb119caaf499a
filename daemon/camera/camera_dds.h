// A camera behind two DDS topics (daemon/dds/focalfleet.idl): we ask by
// focalfleet/exposure_request, it answers by focalfleet/exposure. What was sent before the daemon
// listened never comes. Samples are held to what files are held to (CheckSpots); Cyclone has
// refused those that are no Exposure at all, without a word. Until the domain can be joined, no
// exposure is taken, and the answer says why.
#pragma once

#include <chrono>
#include <functional>
#include <string>

#include "daemon/camera/camera_port.h"
#include "daemon/dds/late_join.h"
#include "daemon/dds/status_publisher.h"

namespace focalfleet {

class CameraDds : public CameraPort {
 public:
  struct Options {
    DdsOptions dds;
    SensorLimits sensor;
    std::function<void(const std::string& trouble)> tell = [](const std::string&) {};  // LateJoin's
    std::chrono::milliseconds rejoin_period{5000};
  };
  explicit CameraDds(Options options);
  ~CameraDds() override;

  Status Request(std::uint64_t id, WallTime since) override;
  Result<std::optional<Exposure>> Take() override;

 private:
  class Impl;
  LateJoin<Impl> joined_;
};

}  // namespace focalfleet
