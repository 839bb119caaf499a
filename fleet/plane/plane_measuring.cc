#include "fleet/plane/plane_measuring.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <utility>

#include "fleet/coordinate/configuration_measurement.h"
#include "fleet/kinematics.h"

namespace focalfleet {
namespace {

/// Puts a list of a sector into one of the plane.
template <class Value>
void Spread(const std::vector<Value>& list, std::span<const PositionerIndex> own,
            std::vector<Value>* whole) {
  for (std::size_t n = 0; n < own.size(); ++n) (*whole)[own[n].value] = list[n];
}

}  // namespace

bool Looks(const SectorBook& sectors, std::uint32_t sector, const PlaneConfigurationId& id) {
  if (!sectors.IsUsable(sector)) return false;
  const SectorBook::Entry& entry = sectors[sector];
  if (entry.report->configuration != id || entry.report->stage != SectorStage::kLooking ||
      entry.exposure == nullptr)
    return false;
  const PlaneOrder& order = entry.order;
  return order.kind != OrderKind::kFindings || order.configuration != id ||
         order.incarnation != entry.report->incarnation || order.job != entry.exposure->id;
}

std::shared_ptr<const SectorJob> StandingJob(const SectorBook& sectors, std::uint32_t sector,
                                             const PlaneConfigurationId& id) {
  if (!sectors.IsUsable(sector)) return nullptr;
  const SectorBook::Entry& entry = sectors[sector];
  const SectorReport& report = *entry.report;
  auto job = std::make_shared<SectorJob>();
  if (Looks(sectors, sector, id)) {
    job->start = entry.exposure->expected;
    job->drives = entry.exposure->drives;
  } else if (report.configuration.number == 0 && report.last_over == id &&
             report.stage == SectorStage::kIdle && entry.places != nullptr &&
             report.places_now != 0 && report.places_now == entry.places_digest) {
    job->start = entry.places->places;
    job->drives = entry.places->drives;
  } else {
    return nullptr;
  }
  job->targets.resize(entry.units);
  job->frozen.assign(entry.units, 1);
  job->offsets.resize(entry.units);
  return job;
}

PlaneExposure MakeExposure(std::uint64_t number, HostInstant now, const PlaneLayout& plane,
                           const SectorBook& sectors, const PlaneConfigurationId& id) {
  const std::size_t units = plane.layout().size();
  PlaneExposure exposure{.job = {.id = number,
                                 .since = now,
                                 .expected = std::vector<UnitKnowledge>(units),
                                 .before = std::vector<std::optional<Pose>>(units),
                                 .reported = std::vector<std::optional<Pose>>(units),
                                 .seen = std::vector<std::uint8_t>(units),
                                 .wanted = std::vector<std::uint8_t>(units)},
                         .drives = std::vector<UnitDrive>(units)};
  ExposureJob& job = exposure.job;
  for (std::uint32_t sector = 0; sector < sectors.size(); ++sector) {
    const auto own = plane.own(sector);
    if (Looks(sectors, sector, id)) {
      const SectorExposure& asked = *sectors[sector].exposure;
      Spread(asked.expected, own, &job.expected);
      Spread(asked.before, own, &job.before);
      Spread(asked.reported, own, &job.reported);
      Spread(asked.seen, own, &job.seen);
      Spread(asked.wanted, own, &job.wanted);
      Spread(asked.drives, own, &exposure.drives);
      job.tolerance_um = std::max(job.tolerance_um, asked.tolerance_um);
    } else if (const auto standing = StandingJob(sectors, sector, id)) {
      Spread(standing->start, own, &job.expected);
      Spread(standing->drives, own, &exposure.drives);
    }
  }
  return exposure;
}

ExposureFindings PartOf(const ExposureFindings& findings, const PlaneLayout& plane,
                        std::uint32_t sector, std::uint64_t exposure) {
  ExposureFindings part{.id = exposure,
                        .measurements = {},
                        .after_request_s = findings.after_request_s,
                        .camera = findings.camera,
                        .camera_trouble = findings.camera_trouble};
  for (const Measurement& measurement : findings.measurements) {
    if (plane.SectorOf(measurement.unit) != sector) continue;
    Measurement own = measurement;
    own.unit = plane.Local(measurement.unit);
    // A unit of another sector has no position here.
    own.other.reset();
    if (measurement.other && plane.SectorOf(*measurement.other) == sector)
      own.other = plane.Local(*measurement.other);
    part.measurements.push_back(std::move(own));
  }
  return part;
}

MeasuredRound SummaryOf(const ExposureFindings& findings, const PlaneConfiguration& configuration,
                        const PlaneLayout& plane, const SectorBook& sectors,
                        const PlaneConfigurationId& id) {
  MeasuredRound round{.exposure = findings.id, .camera = findings.camera};
  const double tolerance_um = configuration.measure.value_or(ApplyCommand::Measure{}).tolerance_um;
  std::vector<double> errors_um;
  for (const Measurement& measurement : findings.measurements) {
    const std::uint32_t sector = plane.SectorOf(measurement.unit);
    const std::optional<Pose>& target = configuration.targets[measurement.unit.value];
    if (!target || !Looks(sectors, sector, id) || sectors[sector].exposure->first) continue;
    if (!IsPut(measurement.status) || !measurement.place) {
      ++round.unknown;
      continue;
    }
    const UnitDrive& drive = sectors[sector].exposure->drives[plane.Local(measurement.unit).value];
    const PointFp wanted = FibreAt(plane.layout().unit(measurement.unit), drive, *target);
    ++round.measured;
    errors_um.push_back(1e3 *
                        std::hypot(measurement.x_mm - wanted.x_mm, measurement.y_mm - wanted.y_mm));
    if (errors_um.back() <= tolerance_um) ++round.within_tolerance;
  }
  Summarise(std::move(errors_um), &round);
  return round;
}

}  // namespace focalfleet
