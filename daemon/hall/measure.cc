#include "daemon/hall/measure.h"

#include <algorithm>
#include <map>
#include <utility>

namespace focalfleet {
namespace {

using ByUnit = std::map<std::uint32_t, Measurement>;

bool CameraIsNeeded(const ExposureJob& job, const ByUnit& own) {
  for (std::uint32_t n = 0; n < job.wanted.size(); ++n) {
    const auto found = own.find(n);
    if (job.wanted[n] != 0 && (found == own.end() || !IsCertain(found->second.status))) return true;
  }
  return job.wanted.empty() || own.empty();
}

Measurement Better(Measurement seen, Measurement own) {
  seen.carrier = own.carrier;
  if (!IsCertain(own.status)) return seen;
  const bool sharper = SigmaUm(own.covariance) < SigmaUm(seen.covariance);
  return !IsCertain(seen.status) || sharper ? std::move(own) : std::move(seen);
}

}  // namespace

ExposureDone MeasureUnits(const CameraWork& work, FibreCarrierWorker* carriers,
                          CameraWorker* camera, const std::atomic<bool>& ending) {
  ByUnit own;
  if (carriers != nullptr)
    for (Measurement& measurement : carriers->Measure(work.job, work.drives))
      own.emplace(measurement.unit.value, std::move(measurement));
  ExposureFindings findings{.id = work.job.id, .measurements = {}, .camera = false};
  if (camera != nullptr && CameraIsNeeded(work.job, own)) {
    ExposureDone seen = camera->Do(work, ending);
    if (!seen.exposure && own.empty()) return seen;
    if (seen.exposure) {
      findings = std::move(*seen.exposure);
      for (Measurement& measurement : findings.measurements)
        if (auto found = own.extract(measurement.unit.value))
          measurement = Better(std::move(measurement), std::move(found.mapped()));
    } else {
      findings.camera_trouble = seen.exposure.error().text;
    }
  }
  for (auto& [unit, measurement] : own) findings.measurements.push_back(std::move(measurement));
  std::ranges::sort(findings.measurements, {}, [](const Measurement& s) { return s.unit; });
  return {work.job.id, std::move(findings)};
}

}  // namespace focalfleet
