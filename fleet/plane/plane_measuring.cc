// The exposures of a plane's camera: what all sectors believe goes to the camera's thread as one
// job, and each sector that asks is told what was found of its units.
#include <algorithm>
#include <cmath>
#include <utility>

#include "fleet/kinematics.h"
#include "fleet/plane/plane_coordinator.h"

namespace focalfleet {
namespace {

/// Puts what a sector believes into the plane's job. `list` is of the sector, `whole` of the plane.
template <class Value>
void Spread(const std::vector<Value>& list, std::span<const PositionerIndex> own,
            std::vector<Value>* whole) {
  for (std::size_t n = 0; n < own.size(); ++n) (*whole)[own[n].value] = list[n];
}

/// The findings about one sector, by its positions.
ExposureFindings PartOf(const ExposureFindings& findings, const PlaneLayout& plane,
                        std::uint32_t sector, std::uint64_t id) {
  ExposureFindings part{.id = id,
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

}  // namespace

/// The sector asks for an exposure, and has not been told of it.
bool PlaneCoordinator::Looks(std::uint32_t sector) const {
  const SectorBook::Entry& entry = sectors_[sector];
  if (entry.report->configuration != Id() || entry.report->stage != SectorStage::kLooking ||
      entry.exposure == nullptr)
    return false;
  const PlaneOrder& order = entry.order;
  return order.kind != OrderKind::kFindings || order.configuration != Id() ||
         order.incarnation != entry.report->incarnation || order.job != entry.exposure->id;
}

void PlaneCoordinator::Look() {
  const std::size_t units = plane_.layout().size();
  PlaneExposure exposure{.job = {.id = ++exposure_,
                                 .since = now_,
                                 .expected = std::vector<UnitKnowledge>(units),
                                 .before = std::vector<std::optional<Pose>>(units),
                                 .reported = std::vector<std::optional<Pose>>(units),
                                 .seen = std::vector<std::uint8_t>(units),
                                 .wanted = std::vector<std::uint8_t>(units)},
                         .drives = std::vector<UnitDrive>(units)};
  ExposureJob& job = exposure.job;
  for (std::uint32_t sector = 0; sector < sectors_.size(); ++sector) {
    parts_[sector] = {};
    const SectorBook::Entry& entry = sectors_[sector];
    const auto own = plane_.own(sector);
    if (sectors_.IsUsable(sector) && Looks(sector)) {
      const SectorExposure& asked = *entry.exposure;
      parts_[sector] = {entry.report->incarnation, asked.id};
      Spread(asked.expected, own, &job.expected);
      Spread(asked.before, own, &job.before);
      Spread(asked.reported, own, &job.reported);
      Spread(asked.seen, own, &job.seen);
      Spread(asked.wanted, own, &job.wanted);
      Spread(asked.drives, own, &exposure.drives);
      job.tolerance_um = std::max(job.tolerance_um, asked.tolerance_um);
    } else if (const auto standing = StandingJob(sector)) {
      Spread(standing->start, own, &job.expected);
      Spread(standing->drives, own, &exposure.drives);
    }  // of all others nothing is known, and they are seen anywhere
  }
  view_.state = ConfigurationState::kMoving;
  view_.waiting_for = "the camera";
  out_->exposure = std::move(exposure);
  Enter(PlanePhase::kMeasuring);
}

void PlaneCoordinator::TakeExposure(const ExposureDone& done) {
  if (view_.phase != PlanePhase::kMeasuring || done.id != exposure_) return;
  view_.waiting_for.clear();
  tries_ = 0;
  view_.not_measured = done.exposure ? std::string() : done.exposure.error().text;
  for (std::uint32_t sector = 0; sector < sectors_.size(); ++sector) {
    const std::uint64_t asked = parts_[sector].job;
    const SectorBook::Entry& entry = sectors_[sector];
    if (asked == 0 || !sectors_.IsUsable(sector) || !Looks(sector) ||
        entry.report->incarnation != parts_[sector].incarnation || entry.exposure->id != asked)
      continue;
    auto findings = std::make_shared<Result<ExposureFindings>>();
    if (done.exposure)
      *findings = PartOf(*done.exposure, plane_, sector, asked);
    else
      *findings = tl::unexpected(done.exposure.error());
    sectors_.Order(sector, {.kind = OrderKind::kFindings,
                            .configuration = Id(),
                            .job = asked,
                            .findings = std::move(findings)});
  }
  if (done.exposure) Summarise(*done.exposure);
  Enter(PlanePhase::kGathering);
}

/// Notes how far the units are from their targets. An exposure before any motion says nothing.
void PlaneCoordinator::Summarise(const ExposureFindings& findings) {
  MeasuredRound round{.exposure = findings.id, .camera = findings.camera};
  const double tolerance_um =
      record_.under_way->measure ? record_.under_way->measure->tolerance_um : 10;
  std::vector<double> errors_um;
  for (const Measurement& measurement : findings.measurements) {
    const std::uint32_t sector = plane_.SectorOf(measurement.unit);
    const auto& asked = sectors_[sector].exposure;
    const std::optional<Pose>& target = record_.under_way->targets[measurement.unit.value];
    if (parts_[sector].job == 0 || asked == nullptr || asked->first || !target) continue;
    if (!IsCertain(measurement.status) || !measurement.place) {
      ++round.unknown;
      continue;
    }
    const PointFp wanted = FibreAt(plane_.layout().unit(measurement.unit),
                                   asked->drives[plane_.Local(measurement.unit).value], *target);
    ++round.measured;
    errors_um.push_back(1e3 *
                        std::hypot(measurement.x_mm - wanted.x_mm, measurement.y_mm - wanted.y_mm));
    if (errors_um.back() <= tolerance_um) ++round.within_tolerance;
  }
  if (round.measured + round.unknown == 0) return;
  if (!errors_um.empty()) {
    double sum = 0;
    for (const double um : errors_um) sum += um * um;
    std::ranges::sort(errors_um);
    round.rms_um = std::sqrt(sum / static_cast<double>(errors_um.size()));
    round.median_um = errors_um[errors_um.size() / 2];
    round.worst_um = errors_um.back();
  }
  view_.measured.push_back(round);
}

}  // namespace focalfleet
