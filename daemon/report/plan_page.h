// A plan to look at: the focal plane with every arm, played in time; what the rails draw; the pairs
// that come nearest to each other. One file of HTML like Page, but with a script: it fetches
// nothing (its policy forbids it) and runs from a disk, an archive or a mail.
//
// What moves on the page are the rows of plan.csv, to the bit: angles linear in time within a row.
// Powers are those of the rows, too, so the curves are Estimate's. Sizes: a row is 24 bytes, a unit
// about 60, in base64; 5000 units with 4 rows each make a page of 1.0 MB.
//
// The script and its style sheet lie in plan_page/ and are built in. It leaves a handle for tests
// and for consoles: `planPage`.
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

/// Lifetime: everything is read by PlanPage alone.
struct PlanScene {
  std::string title;  // any text
  const Layout* layout = nullptr;
  std::span<const UnitDrive> drives;             // Shape: (n)
  std::span<const std::optional<Pose>> start;    // Shape: (n); none: nobody knows where it stands
  std::span<const std::optional<Pose>> targets;  // Shape: (n); none: no target names it
  const Plan* plan = nullptr;
  MotorModel motor;
  std::vector<RailLimit> rail_limits;  // drawn as lines
};

/// At most so many of Plan::tightest are shown, those with the least clearance.
inline constexpr std::size_t kTightPairsShownMax = 20;

/// The whole document. The same scene gives the same bytes. Pre: the shapes fit.
std::string PlanPage(const PlanScene& scene);

}  // namespace focalfleet::report
