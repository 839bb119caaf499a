// The routes of the operators' page. The page's own files are for everybody, because they show
// nothing of the fleet. Layout, stream and curves take the right to ask for the status, motions of
// plans that of history, motion and power of a preview that to make one. None of them asks the
// core. Everything else that the page does goes through the verbs of /api (http/api_routes.h).
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "daemon/http/router.h"
#include "daemon/page/diagnosis_job.h"
#include "daemon/page/kept_plans.h"
#include "daemon/page/night_curves.h"
#include "daemon/page/plate_feed.h"
#include "fleet/layout.h"

namespace focalfleet {

/// The parts that the page shows. All outlive the router.
struct PageParts {
  const Layout* layout = nullptr;
  std::span<const std::uint32_t> sectors = {};  // of each unit of a plane; empty: a daemon's own
  PlateFeed* feed = nullptr;
  const KeptPlans* plans = nullptr;
  const NightCurves* night = nullptr;
  DiagnosisJob* diagnosis = nullptr;  // null: nothing is diagnosed here
  std::string store;                  // its file
};

void AddPageRoutes(const PageParts& parts, HttpRouter* router);

}  // namespace focalfleet
