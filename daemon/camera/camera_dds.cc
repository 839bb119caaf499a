#include "daemon/camera/camera_dds.h"

#include <dds/dds.h>

#include <utility>

#include "daemon/dds/cyclone.h"
#include "fleet/files/spots_file.h"
#include "focalfleet.h"  // generated from focalfleet.idl
#include "protocol/base/limits.h"

namespace focalfleet {

using namespace dds_internal;

namespace {

// A camera that sends more samples between two calls of Take loses the oldest ones. The loss does
// no harm: only the newest may answer the request.
constexpr std::int32_t kDepth = 8;

Result<Exposure> FromSample(const focalfleet_Exposure& sample, const SensorLimits& sensor) {
  Exposure exposure{.id = sample.exposure_id, .taken_unix_ns = sample.taken_ns, .spots = {}};
  if (const Status good = CheckExposureId(exposure.id); !good)
    return Fail(ErrorCode::kInvalid,
                std::string(kExposureTopic) + ": exposure_id " + good.error().text);
  exposure.spots.reserve(sample.spots._length);
  for (std::uint32_t k = 0; k < sample.spots._length; ++k) {
    const focalfleet_Spot& spot = sample.spots._buffer[k];
    exposure.spots.push_back({spot.spot_id, spot.x_px, spot.y_px, spot.flux, spot.fwhm_px});
  }
  if (const Status good = CheckSpots(exposure, sensor); !good)
    return Fail(good.error().code, std::string(kExposureTopic) + ": exposure " + exposure.id +
                                       ": " + good.error().text);
  return exposure;
}

}  // namespace

class CameraDds::Impl {
 public:
  static Result<std::unique_ptr<Impl>> Create(const DdsOptions& dds, SensorLimits sensor) {
    auto impl = std::make_unique<Impl>();
    impl->sensor_ = sensor;
    FOCALFLEET_TRY_ASSIGN(impl->domain_, Domain::Acquire(dds.domain, dds.config_xml));
    FOCALFLEET_TRY_ASSIGN(impl->participant_, MakeParticipant(dds.domain, dds.security));
    FOCALFLEET_TRY_ASSIGN(
        const Handle request,
        MakeTopic(impl->participant_, focalfleet_ExposureRequest_desc, kExposureRequestTopic));
    FOCALFLEET_TRY_ASSIGN(impl->writer_, MakeWriter(impl->participant_, request));
    FOCALFLEET_TRY_ASSIGN(const Handle exposure,
                          MakeTopic(impl->participant_, focalfleet_Exposure_desc, kExposureTopic));
    FOCALFLEET_TRY_ASSIGN(impl->reader_, MakeListener(impl->participant_, exposure, kDepth));
    return impl;
  }

  Status Request(std::uint64_t id, WallTime since) {
    const focalfleet_ExposureRequest sample{.since_ns = since.ns, .exposure = id};
    const dds_return_t code = dds_write(writer_, &sample);
    if (code < 0) return DdsFailure("ask for an exposure", code);
    dds_write_flush(writer_);  // needed because the process batches what all writers write
    return {};
  }

  Result<std::optional<Exposure>> Take() {
    void* samples[1] = {nullptr};  // null asks Cyclone for a loan
    dds_sample_info_t info;
    const dds_return_t count = dds_take(reader_, samples, &info, 1, 1);
    if (count < 0) return DdsFailure("take an exposure", count);
    if (count == 0) return std::optional<Exposure>();
    auto exposure = info.valid_data
                        ? FromSample(*static_cast<const focalfleet_Exposure*>(samples[0]), sensor_)
                              .map([](Exposure&& good) { return std::optional(std::move(good)); })
                        : Result<std::optional<Exposure>>(std::nullopt);
    const dds_return_t returned = dds_return_loan(reader_, samples, count);
    if (returned < 0) return DdsFailure("return a loan", returned);
    return exposure;
  }

 private:
  SensorLimits sensor_;
  Domain domain_;  // outlives the participant
  Entity participant_;
  Handle writer_ = 0;
  Handle reader_ = 0;
};

CameraDds::CameraDds(Options options)
    : joined_({.join = [dds = std::move(options.dds),
                        sensor = options.sensor] { return Impl::Create(dds, sensor); },
               .tell = std::move(options.tell),
               .period = options.rejoin_period}) {}
CameraDds::~CameraDds() = default;

Status CameraDds::Request(std::uint64_t id, WallTime since) {
  if (Impl* impl = joined_.get()) return impl->Request(id, since);
  return Fail(ErrorCode::kUnavailable,
              "the camera cannot be asked: the DDS domain is not joined yet (see the log)");
}

Result<std::optional<Exposure>> CameraDds::Take() {
  if (Impl* impl = joined_.get()) return impl->Take();
  return std::optional<Exposure>();
}

}  // namespace focalfleet
