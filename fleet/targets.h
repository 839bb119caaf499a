// From the requests of an astronomer to the poses of two axes. A target is a point of the focal
// plane or two angles. A point has up to two solutions (elbow left or right), and theta any whole
// turn in its range. The solution nearest to where the unit stands is taken. Random configurations
// for load tests are drawn here, too.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "fleet/knowledge.h"
#include "fleet/layout.h"
#include "protocol/base/result.h"
#include "protocol/base/rng.h"

namespace focalfleet {

struct TargetAngles {
  double theta_deg = 0;  // a direction: any whole turn in range serves
  double phi_deg = 0;
};

struct TargetRow {
  UnitId unit;
  std::variant<PointFp, TargetAngles> place;
  double priority = 0;
  std::string target_id;  // carried through to every report
  int line = 0;           // in the file it came from
};

struct Targets {
  std::string source;  // file name for messages
  std::vector<TargetRow> rows;
  std::vector<std::string> ignored_columns = {};  // unknown; a misspelt one would be among them
};

/// The pose for each unit, empty where no target names it. Shape: (n). Disabled units' targets are
/// resolved too; the planner skips them by name. Errors: kInvalid naming file, line and reason:
/// unknown unit, named twice, out of patrol, out of range, two targets of enabled units that
/// collide.
Result<std::vector<std::optional<Pose>>> ResolveTargets(const Targets& targets,
                                                        const Layout& layout,
                                                        std::span<const UnitDrive> drives,
                                                        std::span<const UnitKnowledge> now);

/// A random configuration in which all pairs (and obstacles) are clear. Enabled units are uniform
/// over their patrol area; disabled units are random with the arm folded back to phi + phi_zero >=
/// 120 degrees. Where `standing` is given, units that it fixes keep that pose and the others are
/// drawn around them. Errors: kRefused where some unit finds no clear place.
Result<std::vector<Pose>> DrawConfiguration(const Layout& layout, std::span<const UnitDrive> drives,
                                            std::span<const std::optional<Pose>> standing, Rng rng);

/// The configuration with every unit folded back: theta in the middle of its range, phi as near to
/// 180 degrees as it gets. Disabled units are as DrawConfiguration draws them.
std::vector<Pose> FoldedConfiguration(const Layout& layout, std::span<const UnitDrive> drives);

}  // namespace focalfleet
