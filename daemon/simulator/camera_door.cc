#include "daemon/simulator/camera_door.h"

#include <filesystem>
#include <nlohmann/json.hpp>
#include <utility>

#include "daemon/clock/wall_time.h"
#include "daemon/files/text_file.h"
#include "daemon/tables/read_table.h"
#include "fleet/camera/spots.h"
#include "fleet/files/fiducials_file.h"
#include "fleet/files/spots_file.h"

namespace focalfleet::simulator {
namespace {

constexpr DurationNs kLookPeriod = Milliseconds(20);
constexpr std::int64_t kLateNs = 90'000'000'000;

/// The number of the request; empty where no readable request exists.
std::optional<std::uint64_t> Asked(const std::string& path) {
  if (!std::filesystem::exists(path)) return std::nullopt;
  const auto text = ReadTextFile(path);
  if (!text) return std::nullopt;
  const auto request = nlohmann::json::parse(*text, nullptr, false);
  if (!request.is_object() || !request.contains("exposure") ||
      !request["exposure"].is_number_unsigned())
    return std::nullopt;
  return request["exposure"].get<std::uint64_t>();
}

}  // namespace

Result<CameraDoor> CameraDoor::Open(const Options& options) {
  CameraDoor door(options);
  FOCALFLEET_TRY_ASSIGN(const std::string text,
                        ReadTableAsText(options.fiducials_path, "fiducial_id"));
  FOCALFLEET_TRY_ASSIGN(const auto fiducials, ReadFiducials(text, options.fiducials_path));
  for (const Fiducial& fiducial : fiducials)
    door.fiducials_.push_back({.kind = sim::LightKind::kFiducial,
                               .id = fiducial.id,
                               .place_mm = {fiducial.at_fp.x_mm, fiducial.at_fp.y_mm}});
  std::error_code failed;
  std::filesystem::create_directories(options.directory, failed);
  if (failed)
    return focalfleet::Fail(ErrorCode::kUnavailable,
                            "camera folder " + options.directory + ": " + failed.message());
  // A request to an earlier simulation does not apply to this one.
  door.answered_ = Asked(options.directory + "/request.json").value_or(0);
  return door;
}

void CameraDoor::Fail(CameraFault fault, std::uint32_t exposures) {
  fault_ = fault;
  faulty_left_ = exposures;
}

Status CameraDoor::Serve(HostInstant now, const sim::World& world) {
  if (now < wake_at_) return {};
  wake_at_ = now + kLookPeriod;
  const auto asked = Asked(options_.directory + "/request.json");
  if (!asked || *asked == answered_) return {};
  answered_ = *asked;
  return Answer(world);
}

Status CameraDoor::Answer(const sim::World& world) {
  const CameraFault fault = faulty_left_ > 0 ? fault_ : CameraFault::kNone;
  if (faulty_left_ > 0) --faulty_left_;
  if (fault == CameraFault::kDead) return {};
  const std::string name = "exposure-" + std::to_string(++taken_);
  const std::string path = options_.directory + "/" + name + ".csv";
  if (fault == CameraFault::kDoubled && !before_.empty()) return WriteFileAtomically(path, before_);
  std::vector<sim::LightSource> sources = sim::FibresOf(world);
  if (fault == CameraFault::kOtherField)
    for (sim::LightSource& fibre : sources) fibre.place_mm = -fibre.place_mm + 3.0;
  sources.insert(sources.end(), fiducials_.begin(), fiducials_.end());
  const sim::Image image = sim::TakeImage(sources, options_.traits, &rng_);
  const std::int64_t taken_ns = WallTime::Now().ns - (fault == CameraFault::kLate ? kLateNs : 0);
  Exposure exposure{
      .id = name + "-" + std::to_string(taken_ns), .taken_unix_ns = taken_ns, .spots = {}};
  for (const sim::ImageSpot& spot : image.spots) {
    const bool turned = fault == CameraFault::kTurned;
    const std::complex<double> at{spot.x_px, spot.y_px};
    const std::complex<double> seen = turned ? options_.traits.sensor_px - 1.0 - at : at;
    exposure.spots.push_back({static_cast<std::uint32_t>(exposure.spots.size() + 1), seen.real(),
                              seen.imag(), spot.flux, spot.fwhm_px});
  }
  before_ = WriteSpots(exposure);
  return WriteFileAtomically(path, before_);
}

}  // namespace focalfleet::simulator
