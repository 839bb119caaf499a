// One exposure from spots to findings: where each unit of the fleet was expected, who is who
// (identify.h), and at which vectors its axes stand by that.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "fleet/camera/identify.h"
#include "fleet/knowledge.h"
#include "fleet/measurement.h"

namespace focalfleet {

/// What the camera looks at, and with which camera.
struct CameraSite {
  CameraModel model;
  SensorLimits sensor;
  std::vector<Fiducial> fiducials;
  IdentifyOptions options;
};

/// What was believed when the exposure was asked for. Shapes: (n), as the layout.
struct Believed {
  std::span<const UnitKnowledge> now;
  std::span<const std::optional<Pose>> before;    // before its last move; none: not known
  std::span<const std::uint8_t> seen;             // non-zero: a camera has put it somewhere before
  std::span<const std::optional<Pose>> reported;  // what units of unknown place say; or empty
  std::span<const UnitDrive> drives;
};

/// Where each unit is looked for. A unit of unknown place is looked for where it says, and anywhere
/// in its interval or, without one, in its patrol area.
std::vector<UnitExpectation> Expect(const Layout& layout, const Believed& believed);

/// Where a unit of unknown place that is seen at `seen_fp` stands, in vectors. None: more than one
/// whole turn or elbow side is possible, neither its interval nor its own word decides, or its arms
/// do not reach there.
std::optional<Pose> PoseOfLost(const Unit& unit, const UnitDrive& drive, PointFp seen_fp,
                               const UnitExpectation& expectation, double sigma_mm);

/// One measurement a unit of the layout. A place is given where the status is certain and the arms
/// reach it; of a unit of unknown place, where one pose alone is possible there (PoseOfLost). Cost:
/// as Identify. Errors: kRefused: the exposure as a whole is not believed; the reason's name and
/// its numbers.
Result<ExposureFindings> FindUnits(std::uint64_t id, const Layout& layout, const Believed& believed,
                                   const CameraSite& site, const Exposure& exposure);

}  // namespace focalfleet
