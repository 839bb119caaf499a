#include "daemon/camera/camera_dds.h"

#include <dds/dds.h>

#include <algorithm>
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
    FOCALFLEET_TRY_ASSIGN(impl->participant_, Participant::Join(dds));
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

  /// The next exposure that `arrived` does not know yet.
  Result<std::optional<Exposure>> Take(Arrivals* arrived) {
    for (;;) {
      void* samples[1] = {nullptr};  // null asks Cyclone for a loan
      dds_sample_info_t info;
      const dds_return_t count = dds_take(reader_, samples, &info, 1, 1);
      if (count < 0) return DdsFailure("take an exposure", count);
      if (count == 0) return std::optional<Exposure>();
      const bool is_new = info.valid_data && arrived->Add(info.source_timestamp);
      auto exposure =
          is_new ? FromSample(*static_cast<const focalfleet_Exposure*>(samples[0]), sensor_)
                       .map([](Exposure&& good) { return std::optional(std::move(good)); })
                 : Result<std::optional<Exposure>>(std::nullopt);
      const dds_return_t returned = dds_return_loan(reader_, samples, count);
      if (returned < 0) return DdsFailure("return a loan", returned);
      if (is_new) return exposure;
    }
  }

  /// A camera reads the requests and writes exposures.
  [[nodiscard]] bool has_camera() const {
    dds_publication_matched_status_t asked{};
    dds_subscription_matched_status_t answering{};
    return dds_get_publication_matched_status(writer_, &asked) == DDS_RETCODE_OK &&
           dds_get_subscription_matched_status(reader_, &answering) == DDS_RETCODE_OK &&
           asked.current_count > 0 && answering.current_count > 0;
  }

 private:
  SensorLimits sensor_;
  Participant participant_;
  Handle writer_ = 0;
  Handle reader_ = 0;
};

bool CameraDds::Arrivals::Add(std::int64_t sent_ns) {
  if (std::ranges::find(sent_ns_, sent_ns) != sent_ns_.end()) return false;
  sent_ns_[next_++ % sent_ns_.size()] = sent_ns;
  return true;
}

int CameraDds::Member::rank() const {
  const Impl* const impl = joined->get();
  return impl == nullptr ? 0 : impl->has_camera() ? 2 : 1;
}

CameraDds::CameraDds(Options options) : options_(std::move(options)) { members_.push_back(Join()); }
CameraDds::~CameraDds() = default;

CameraDds::Member CameraDds::Join() const {
  return {.joined = std::make_unique<LateJoin<Impl>>(LateJoin<Impl>::Options{
              .join = [dds = options_.dds,
                       sensor = options_.sensor] { return Impl::Create(dds, sensor); },
              .tell = options_.tell,
              .period = options_.rejoin_period})};
}

void CameraDds::Renew(WallTime end) {
  Member newest = Join();
  const std::lock_guard lock(mutex_);
  // A member that nothing was asked of has no answer to wait for.
  if (members_.size() > 1 && members_.back().joined.get() != asked_) members_.pop_back();
  members_.back().end = std::min(members_.back().end, end);
  members_.push_back(std::move(newest));
}

Status CameraDds::Request(std::uint64_t id, WallTime since) {
  const std::lock_guard lock(mutex_);
  const WallTime now = options_.now();
  std::erase_if(members_, [&](const Member& member) { return member.end <= now; });
  // The newest of those with the highest rank.
  const auto asked =
      std::ranges::max_element(members_.rbegin(), members_.rend(), {}, &Member::rank).base() - 1;
  const bool again = std::exchange(asked_, asked->joined.get()) == asked->joined.get();
  if (again) members_.erase(members_.begin(), asked);
  if (Impl* impl = asked_->get()) return impl->Request(id, since);
  return Fail(ErrorCode::kUnavailable,
              "the camera cannot be asked: the DDS domain is not joined yet (see the log)");
}

Result<std::optional<Exposure>> CameraDds::Take() {
  const std::lock_guard lock(mutex_);
  for (const Member& member : members_) {
    Impl* const impl = member.joined->get();
    if (impl == nullptr) continue;
    auto taken = impl->Take(&arrived_);
    if (!taken || *taken) return taken;
  }
  return std::optional<Exposure>();
}

}  // namespace focalfleet
