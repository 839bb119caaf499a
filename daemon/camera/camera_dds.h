// CameraDds reaches a camera through two DDS topics (daemon/dds/focalfleet.idl). The daemon asks on
// focalfleet/exposure_request; the camera answers on focalfleet/exposure.
//
// Samples sent before the daemon listened are never received. Samples are checked by the rules for
// files (CheckSpots). Cyclone has already dropped, without a message, samples that are no Exposure
// at all. Until the domain can be joined no exposure is taken, and the answer gives the reason.
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
    std::function<void(const std::string& trouble)> tell = [](const std::string&) {};  // as
                                                                                       // LateJoin's
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
