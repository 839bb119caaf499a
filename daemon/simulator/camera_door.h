// CameraDoor is the simulated fibre-view camera. The camera answers in the folder where the daemon
// asks (daemon/camera/camera_folder.h), with a picture of the world at that time. Faults can be set
// in the kinds that a camera has.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "protocol/base/instants.h"
#include "protocol/base/result.h"
#include "protocol/base/rng.h"
#include "sim/world/camera/camera.h"

namespace focalfleet::simulator {

enum class CameraFault : std::uint8_t {
  kNone,
  kDead,        // no exposure arrives
  kLate,        // the exposure shows the plate as it was a minute and a half ago
  kDoubled,     // the previous exposure arrives once more
  kTurned,      // the picture is turned by half a turn
  kOtherField,  // the picture is of fibres elsewhere
};
inline constexpr const char* kCameraFaultNames[] = {"none",    "dead",   "late",
                                                    "doubled", "turned", "other_field"};

class CameraDoor {
 public:
  struct Options {
    std::string directory;
    std::string fiducials_path;
    std::uint64_t seed = 1;
    sim::CameraTraits traits;
  };
  /// The camera on its folder.
  /// Errors: kUnavailable, kInvalid: the folder or the fiducials.
  static Result<CameraDoor> Open(const Options& options);

  /// Looks for a request, and answers it. Errors: the answer cannot be written.
  Status Serve(HostInstant now, const sim::World& world);
  [[nodiscard]] HostInstant wake_at() const { return wake_at_; }
  void Fail(CameraFault fault, std::uint32_t exposures);

 private:
  explicit CameraDoor(Options options) : options_(std::move(options)), rng_(options_.seed) {}
  Status Answer(const sim::World& world);

  Options options_;
  Rng rng_;
  std::vector<sim::LightSource> fiducials_;
  std::uint64_t answered_ = 0;  // number of the last request
  std::uint64_t taken_ = 0;
  HostInstant wake_at_{0};
  CameraFault fault_ = CameraFault::kNone;
  std::uint32_t faulty_left_ = 0;
  std::string before_;  // the last answer
};

}  // namespace focalfleet::simulator
