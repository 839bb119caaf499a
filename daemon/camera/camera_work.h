// CameraWork does what the camera's thread owes to one ExposureJob. The thread asks for an
// exposure, waits for one that may answer, and assigns its spots to units.
//
// An exposure that may not answer is too early, doubled, of another field, or no exposure at all.
// Each is written to the log, and the wait goes on. When the time is up, the last reason is the
// answer.
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <optional>
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
    double speed = 1;                            // of the host's clock, relative to real time
    std::function<WallTime()> now = &WallTime::Now;
    std::function<void(const std::string&)> log = [](const std::string&) {};
    std::function<void()> alive = [] {};  // called with each look
  };
  CameraWorker(std::unique_ptr<CameraPort> port, Options options)
      : port_(std::move(port)), options_(std::move(options)) {}

  /// The answer to one job: Begin, and Look after each pause.
  /// Errors in the answer: kRefused: an exposure came and was not believed; kUnavailable: nothing
  /// came, or `ending` is set.
  ExposureDone Do(const CameraWork& work, const std::atomic<bool>& ending);

  /// The exposure is asked for; an answer: it cannot be. `now` is read from a clock that never
  /// steps.
  std::optional<ExposureDone> Begin(const CameraWork& work, std::chrono::nanoseconds now);
  /// Judges what has arrived. None: the wait goes on. Pre: Begin gave no answer, nor did an earlier
  /// Look; `work` is the same.
  std::optional<ExposureDone> Look(const CameraWork& work, std::chrono::nanoseconds now);

 private:
  Result<ExposureFindings> Judge(const CameraWork& work, const Exposure& exposure, WallTime since);

  std::unique_ptr<CameraPort> port_;
  Options options_;
  std::vector<SeenExposure> seen_;
  // Begin of the job under way.
  WallTime since_;
  std::chrono::nanoseconds give_up_{0};
  Error trouble_;
};

}  // namespace focalfleet
