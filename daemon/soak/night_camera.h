// The camera of a simulated night: the daemon's camera worker, polled on virtual time, and behind
// it a fibre-view camera over the simulated plate with the faults that cameras have.
#pragma once

#include <deque>
#include <functional>
#include <memory>
#include <optional>

#include "daemon/camera/camera_work.h"
#include "daemon/loop/job_queue.h"
#include "daemon/soak/fault_sites.h"
#include "daemon/soak/plant.h"
#include "protocol/base/rng.h"

namespace focalfleet::soak {

class NightCamera final : public JobQueue<CameraWork, ExposureDone> {
 public:
  struct Options {
    const Plant* plant = nullptr;
    Rng* rng = nullptr;
    std::function<bool(FaultSite)> happens;
    std::function<void(const std::string&)> log;
  };
  explicit NightCamera(const Options& options);

  bool Submit(CameraWork* work) override;
  std::optional<ExposureDone> Take() override;
  /// The instant at which Take has something to do.
  [[nodiscard]] HostInstant due() const;

 private:
  class Port;
  CameraWorker worker_;
  std::deque<CameraWork> jobs_;
  bool begun_ = false;
  HostInstant look_at_{0};
};

}  // namespace focalfleet::soak
