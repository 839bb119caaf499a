#include "daemon/camera/camera_work.h"

#include <thread>
#include <utility>

#include "fleet/files/bad_rows.h"

namespace focalfleet {
namespace {

constexpr std::size_t kSeenMax = 1000;  // exposures; a night has a few hundred

}  // namespace

ExposureDone CameraWorker::Do(const CameraWork& work, const std::atomic<bool>& ending) {
  const std::uint64_t id = work.job.id;
  // All units are at rest by now, so each exposure from here on shows them at rest.
  const WallTime since = options_.now();
  if (const Status asked = port_->Request(id, since); !asked)
    return {id, tl::unexpected(asked.error())};
  Error trouble{ErrorCode::kUnavailable, "nothing came from the camera within " +
                                             std::to_string(options_.patience.count()) + " ms"};
  const auto give_up = std::chrono::steady_clock::now() + options_.patience;
  while (!ending) {
    options_.alive();
    auto taken = port_->Take();
    if (taken && *taken) {
      auto findings = Judge(work, **taken, since);
      if (findings) return {id, std::move(findings)};
      trouble = findings.error();
      options_.log("exposure " + (*taken)->id + " is not used: " + trouble.text);
      if (std::chrono::steady_clock::now() >= give_up) return {id, tl::unexpected(trouble)};
      continue;
    }
    if (!taken) {
      trouble = {taken.error().code, FirstRow(taken.error().text)};
      options_.log("not an exposure: " + trouble.text);
    }
    if (std::chrono::steady_clock::now() >= give_up) return {id, tl::unexpected(trouble)};
    std::this_thread::sleep_for(options_.pause);
  }
  return {id, Fail(ErrorCode::kUnavailable, "the daemon ends")};
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
