#include "daemon/hall/measure.h"

#include <algorithm>
#include <map>
#include <utility>

namespace focalfleet {
namespace {

using ByUnit = std::map<std::uint32_t, Sighting>;

bool CameraIsNeeded(const ExposureJob& job, const ByUnit& own) {
  for (std::uint32_t n = 0; n < job.wanted.size(); ++n) {
    const auto found = own.find(n);
    if (job.wanted[n] != 0 && (found == own.end() || !IsCertain(found->second.status))) return true;
  }
  return job.wanted.empty() || own.empty();
}

Sighting Better(Sighting seen, Sighting own) {
  seen.spine = own.spine;
  if (!IsCertain(own.status)) return seen;
  const bool sharper = SigmaUm(own.covariance) < SigmaUm(seen.covariance);
  return !IsCertain(seen.status) || sharper ? std::move(own) : std::move(seen);
}

}  // namespace

ExposureDone MeasureUnits(const CameraWork& work, SpineWorker* spines, CameraWorker* camera,
                          const std::atomic<bool>& ending) {
  ByUnit own;
  if (spines != nullptr)
    for (Sighting& sighting : spines->Measure(work.job, work.drives))
      own.emplace(sighting.unit.value, std::move(sighting));
  ExposureFindings findings{.id = work.job.id, .sightings = {}, .camera = false};
  if (camera != nullptr && CameraIsNeeded(work.job, own)) {
    ExposureDone seen = camera->Do(work, ending);
    if (!seen.exposure && own.empty()) return seen;
    if (seen.exposure) {
      findings = std::move(*seen.exposure);
      for (Sighting& sighting : findings.sightings)
        if (auto found = own.extract(sighting.unit.value))
          sighting = Better(std::move(sighting), std::move(found.mapped()));
    } else {
      findings.camera_trouble = seen.exposure.error().text;
    }
  }
  for (auto& [unit, sighting] : own) findings.sightings.push_back(std::move(sighting));
  std::ranges::sort(findings.sightings, {}, [](const Sighting& s) { return s.unit; });
  return {work.job.id, std::move(findings)};
}

}  // namespace focalfleet
