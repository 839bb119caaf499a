// The exposures of a plane's camera: the beliefs of all sectors go to the camera's thread as one
// job, and each sector that asks gets the findings about its units.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "fleet/coordinate/configuration_view.h"
#include "fleet/coordinate/effects.h"
#include "fleet/measurement.h"
#include "fleet/plane/plane_layout.h"
#include "fleet/plane/plane_messages.h"
#include "fleet/plane/plane_tasks.h"
#include "fleet/plane/sector_book.h"

namespace focalfleet {

/// Lists of the job and `drives` are by the plane's positions.
struct PlaneExposure {
  ExposureJob job;
  std::vector<UnitDrive> drives;
};

/// The sector asks for an exposure of this configuration, and does not have its findings yet.
bool Looks(const SectorBook& sectors, std::uint32_t sector, const PlaneConfigurationId& id);

/// The part in a plan of a sector whose units stand where they are: it has ended the configuration,
/// or waits for an exposure. Null: that is not sure.
std::shared_ptr<const SectorJob> StandingJob(const SectorBook& sectors, std::uint32_t sector,
                                             const PlaneConfigurationId& id);

/// The job for all sectors that ask. Nothing is believed of sectors whose units are not known to
/// stand: these units are seen anywhere.
PlaneExposure MakeExposure(std::uint64_t number, HostInstant now, const PlaneLayout& plane,
                           const SectorBook& sectors, const PlaneConfigurationId& id);

/// The findings about one sector, by its positions, under its own number `exposure`.
ExposureFindings PartOf(const ExposureFindings& findings, const PlaneLayout& plane,
                        std::uint32_t sector, std::uint64_t exposure);

/// How far the units of sectors that ask are from their targets. An exposure before any motion says
/// nothing: `measured` and `unknown` are 0 then. Pre: the findings are not handed out yet.
MeasuredRound SummaryOf(const ExposureFindings& findings, const PlaneConfiguration& configuration,
                        const PlaneLayout& plane, const SectorBook& sectors,
                        const PlaneConfigurationId& id);

}  // namespace focalfleet
