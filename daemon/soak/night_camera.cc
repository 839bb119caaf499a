#include "daemon/soak/night_camera.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "daemon/soak/virtual_time.h"
#include "sim/world/camera/camera.h"

namespace focalfleet::soak {
namespace {

using enum FaultSite;

constexpr DurationNs kCameraLookEvery = Milliseconds(20);
constexpr DurationNs kExposure = Milliseconds(500);
constexpr std::int64_t kOldNs = 90'000'000'000;

CameraSite SiteOf(const Plant& plant) {
  const sim::CameraTraits traits;
  CameraSite site{.model = {.pixels_per_mm = traits.optics.pixels_per_mm,
                            .centre_x_px = traits.optics.centre_px.real(),
                            .centre_y_px = traits.optics.centre_px.imag()},
                  .sensor = {traits.sensor_px.real(), traits.sensor_px.imag()},
                  .fiducials = {plant.fiducials().begin(), plant.fiducials().end()},
                  .options = {}};
  double radius_mm = 0;
  for (const Fiducial& fiducial : site.fiducials)
    radius_mm = std::max(radius_mm, std::hypot(fiducial.at_fp.x_mm, fiducial.at_fp.y_mm));
  site.model.radius_mm = radius_mm;
  return site;
}

std::chrono::nanoseconds Now() { return std::chrono::nanoseconds(ReadVirtualNs()); }

}  // namespace

class NightCamera::Port final : public CameraPort {
 public:
  explicit Port(const Options& options) : options_(options) {}

  Status Request(std::uint64_t, WallTime) override {
    due_ = HostInstant{ReadVirtualNs()} + kExposure;
    return {};
  }
  Result<std::optional<Exposure>> Take() override {
    if (ReadVirtualNs() < due_.ns) return std::optional<Exposure>();
    due_ = kNever;
    return Expose();
  }

 private:
  std::optional<Exposure> Expose() {
    if (options_.happens(kCameraDead)) return std::nullopt;
    if (before_ && options_.happens(kCameraDoubled)) return before_;
    const bool late = options_.happens(kCameraLate), turned = options_.happens(kCameraTurned);
    std::vector<sim::LightSource> lights = sim::FibresOf(options_.plant->world());
    if (options_.happens(kCameraOtherField))
      for (sim::LightSource& fibre : lights) fibre.place_mm = -fibre.place_mm + 3.0;
    for (const Fiducial& fiducial : options_.plant->fiducials())
      lights.push_back({.kind = sim::LightKind::kFiducial,
                        .id = fiducial.id,
                        .place_mm = {fiducial.at_fp.x_mm, fiducial.at_fp.y_mm}});
    const sim::CameraTraits traits;
    const sim::Image image = sim::TakeImage(lights, traits, options_.rng);
    const std::int64_t taken_ns = ReadVirtualWall().ns - (late ? kOldNs : 0);
    Exposure exposure{.id = "exposure-" + std::to_string(ReadVirtualNs()),
                      .taken_unix_ns = taken_ns,
                      .spots = {}};
    for (const sim::ImageSpot& spot : image.spots) {
      const std::complex<double> at{spot.x_px, spot.y_px};
      const std::complex<double> seen = turned ? traits.sensor_px - 1.0 - at : at;
      exposure.spots.push_back({static_cast<std::uint32_t>(exposure.spots.size() + 1), seen.real(),
                                seen.imag(), spot.flux, spot.fwhm_px});
    }
    before_ = exposure;
    return exposure;
  }

  Options options_;
  HostInstant due_ = kNever;
  std::optional<Exposure> before_;
};

NightCamera::NightCamera(const Options& options)
    : worker_(std::make_unique<Port>(options),
              CameraWorker::Options{.layout = &options.plant->layout(),
                                    .site = SiteOf(*options.plant),
                                    .patience = std::chrono::milliseconds(5000),
                                    .now = &ReadVirtualWall,
                                    .log = options.log}) {}

bool NightCamera::Submit(CameraWork* work) {
  constexpr std::size_t kJobs = 8;
  if (jobs_.size() >= kJobs) return false;
  jobs_.push_back(std::move(*work));
  if (jobs_.size() == 1) look_at_ = HostInstant{ReadVirtualNs()};
  return true;
}

HostInstant NightCamera::due() const { return jobs_.empty() ? kNever : look_at_; }

std::optional<ExposureDone> NightCamera::Take() {
  if (due().ns > ReadVirtualNs()) return std::nullopt;
  look_at_ = HostInstant{ReadVirtualNs()} + kCameraLookEvery;
  auto done = begun_ ? worker_.Look(jobs_.front(), Now()) : worker_.Begin(jobs_.front(), Now());
  begun_ = !done;
  if (done) jobs_.pop_front();
  return done;
}

}  // namespace focalfleet::soak
