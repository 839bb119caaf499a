// targets.csv: a fibre configuration as an astronomer writes it. Each row names a unit and either a
// place (x_mm, y_mm) or two angles (theta_deg, phi_deg); priority and target_id are carried along.
// A file may have the columns of both kinds; a row gives one of them.
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "fleet/layout.h"
#include "fleet/targets.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// The rows of the file. Errors: kInvalid with file:line: a column missing, a value missing or not
/// a number, a row with half a place or with a place and angles, a unit named twice, no rows.
Result<Targets> ReadTargets(std::string_view text, std::string file);

/// A table with the columns that the rows need. The text reads back equal, but for the lines.
std::string WriteTargets(const Targets& targets);

/// A row of angles for each unit that has a pose. The angles are exactly the whole vectors, so that
/// the pose itself is requested and not only the fibre's place.
Targets TargetsOf(const Layout& layout, std::span<const UnitDrive> drives,
                  std::span<const std::optional<Pose>> poses);

}  // namespace focalfleet
