// PlanPage shows a plan. The page has the focal plane with every arm, played in time, the power of
// each rail, and the pairs of units that come nearest to each other. The page is one file of HTML
// like Page, but with a script. The script fetches nothing (the page's policy forbids it), so the
// page works from a disk, an archive or a mail.
//
// The motion on the page is the rows of plan.csv, to the bit: angles linear in time within a row.
// The powers are those of the rows too, so the curves equal Estimate's. Sizes in base64: a row is
// 24 bytes, a unit about 60. 5000 units with 4 rows each make a page of 1.0 MB.
//
// The script and its style sheet lie in plan_page/ and are built in. The script leaves a handle for
// tests and for consoles: `planPage`.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "fleet/drive.h"
#include "fleet/drive_power.h"
#include "fleet/layout.h"
#include "fleet/plan/plan.h"

namespace focalfleet::report {

struct RailLimit {
  RailId rail;
  double limit_W = 0;
};

/// Lifetime: PlanPage reads everything before it returns.
struct PlanScene {
  std::string title;  // any text
  const Layout* layout = nullptr;
  std::span<const UnitDrive> drives;             // Shape: (n)
  std::span<const std::optional<Pose>> start;    // Shape: (n); empty: its pose is not known
  std::span<const std::optional<Pose>> targets;  // Shape: (n); empty: no target
  const Plan* plan = nullptr;
  MotorModel motor;
  std::vector<RailLimit> rail_limits;  // drawn as lines
};

/// At most this many of Plan::tightest are shown, those with the least clearance.
inline constexpr std::size_t kTightPairsShownMax = 20;

/// The whole document. The same scene gives the same bytes. Pre: the shapes fit.
std::string PlanPage(const PlanScene& scene);

}  // namespace focalfleet::report
