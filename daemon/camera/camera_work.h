// What the camera's thread does for one ExposureJob: ask, wait for an exposure that may answer,
// look who is who. An exposure that may not (too early, doubled, another field, no exposure at all)
// is said to the log and waited past; when the time is up, the last reason is the answer.
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "daemon/camera/camera_port.h"
#include "fleet/camera/findings.h"
#include "fleet/coordinator.h"

namespace focalfleet {

struct CameraWork {
  ExposureJob job;
  std::vector<UnitDrive> drives;
};

class CameraWorker {
 public:
  struct Options {
    const Layout* layout = nullptr;
    CameraSite site;
    std::chrono::milliseconds patience{30'000};  // real time, from the request
    std::chrono::milliseconds pause{20};         // between two looks
    double speed = 1;                            // of the host's clock, to real time
    std::function<WallTime()> now = &WallTime::Now;
    std::function<void(const std::string&)> log = [](const std::string&) {};
  };
  CameraWorker(std::unique_ptr<CameraPort> port, Options options)
      : port_(std::move(port)), options_(std::move(options)) {}

  /// Errors of the answer: kRefused: what came was not believed; kUnavailable: nothing came, or
  /// `ending`.
  ExposureDone Do(const CameraWork& work, const std::atomic<bool>& ending);

 private:
  Result<ExposureFindings> Judge(const CameraWork& work, const Exposure& exposure, WallTime since);

  std::unique_ptr<CameraPort> port_;
  Options options_;
  std::vector<SeenExposure> seen_;
};

}  // namespace focalfleet
