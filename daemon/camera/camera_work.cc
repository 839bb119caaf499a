#include "daemon/camera/camera_work.h"

#include <thread>
#include <utility>

#include "fleet/files/bad_rows.h"

namespace focalfleet {
namespace {

constexpr std::size_t kSeenMax = 1000;  // exposures; a night has a few hundred

}  // namespace

ExposureDone CameraWorker::Do(const CameraWork& work, const std::atomic<bool>& ending) {
  const auto now = []() -> std::chrono::nanoseconds {
    return std::chrono::steady_clock::now().time_since_epoch();
  };
  auto done = Begin(work, now());
  while (!done && !ending) {
    options_.alive();
    done = Look(work, now());
    if (!done) std::this_thread::sleep_for(options_.pause);
  }
  if (done) return std::move(*done);
  return {work.job.id, Fail(ErrorCode::kUnavailable, "the daemon ends")};
}

std::optional<ExposureDone> CameraWorker::Begin(const CameraWork& work,
                                                std::chrono::nanoseconds now) {
  // All units are at rest by now, so each exposure from here on shows them at rest.
  since_ = options_.now();
  give_up_ = now + options_.patience;
  trouble_ = {ErrorCode::kUnavailable, "nothing came from the camera within " +
                                           std::to_string(options_.patience.count()) + " ms"};
  const Status asked = port_->Request(work.job.id, since_);
  if (asked) return std::nullopt;
  return ExposureDone{work.job.id, tl::unexpected(asked.error())};
}

std::optional<ExposureDone> CameraWorker::Look(const CameraWork& work,
                                               std::chrono::nanoseconds now) {
  // A camera that sends without an end must not keep the caller from looking at the clock.
  constexpr int kExposuresAtOnce = 16;
  for (int n = 0; n < kExposuresAtOnce; ++n) {
    auto taken = port_->Take();
    const bool came = taken && *taken;
    if (came) {
      auto findings = Judge(work, **taken, since_);
      if (findings) return ExposureDone{work.job.id, std::move(findings)};
      trouble_ = findings.error();
      options_.log("exposure " + (*taken)->id + " is not used: " + trouble_.text);
    }
    if (!taken) {
      trouble_ = {taken.error().code, FirstRow(taken.error().text)};
      options_.log("not an exposure: " + trouble_.text);
    }
    if (now >= give_up_) return ExposureDone{work.job.id, tl::unexpected(trouble_)};
    if (!came) return std::nullopt;
  }
  return std::nullopt;
}

Result<ExposureFindings> CameraWorker::Judge(const CameraWork& work, const Exposure& exposure,
                                             WallTime since) {
  FOCALFLEET_TRY(CheckSpots(exposure, options_.site.sensor));
  const auto refusal =
      Admit(exposure, {.motion_end_unix_ns = since.ns, .now_unix_ns = options_.now().ns}, seen_);
  seen_.push_back({exposure.id, ContentOf(exposure)});
  if (seen_.size() > kSeenMax) seen_.erase(seen_.begin());
  if (refusal)
    return Fail(ErrorCode::kRefused, std::string(Name(refusal->reason)) + ": " + refusal->text);
  auto findings = FindUnits(work.job.id, *options_.layout,
                            {.now = work.job.expected,
                             .before = work.job.before,
                             .seen = work.job.seen,
                             .reported = work.job.reported,
                             .drives = work.drives},
                            options_.site, exposure);
  if (findings)
    findings->after_request_s =
        1e-9 * static_cast<double>(exposure.taken_unix_ns - since.ns) * options_.speed;
  return findings;
}

}  // namespace focalfleet
