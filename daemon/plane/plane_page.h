// The operators' page of a plane: the plate with the units of all sectors, as they publish them,
// and facts of the plane as a whole. A sector that is silent has no places on the plate: its units
// are drawn as not heard. Previews of the coordinator can be played.
//
// Takes come from two threads, the reader of status and the core.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "daemon/dds/status_reader.h"
#include "daemon/page/kept_plans.h"
#include "daemon/page/night_curves.h"
#include "daemon/page/page_routes.h"
#include "daemon/page/plate_feed.h"
#include "daemon/plane/plane_requests.h"
#include "fleet/plan/plan.h"

namespace focalfleet {

class PlanePage {
 public:
  /// `plane` outlives the page.
  PlanePage(const PlaneLayout* plane, std::size_t viewers_max);

  /// Takes what sectors have published.
  void Take(const StatusUpdate& update);
  /// The plane as it is published once a second. Pre: `plane` has a table.
  void Take(const PlaneInstant& plane, const FleetStatusValue& fleet,
            const ConfigurationProgressValue& configuration);
  void NoteAlarm() { feed_.NoteAlarm(); }
  /// The plan of a preview, for the whole plane. Any thread may call.
  void KeepPreview(const PlanJob& job, const Plan& plan, std::span<const UnitDrive> drives);

  /// All parts outlive the routes that show them.
  [[nodiscard]] PageParts parts();

 private:
  const PlaneLayout& plane_;
  std::vector<std::uint32_t> sector_of_;  // Shape: (units)
  std::vector<std::uint8_t> silent_;      // Shape: (sectors)
  NightCurves night_;
  KeptPlans plans_;
  PlateFeed feed_;
  std::uint64_t configuration_ = 0;  // of `makespan_s_`
  double makespan_s_ = 0;
};

}  // namespace focalfleet
