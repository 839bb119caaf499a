// The way of an exposure from spots to findings. First each unit of the fleet is expected
// somewhere, then spots are assigned (identify.h), then its axes stand at certain vectors by that.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "fleet/camera/identify.h"
#include "fleet/knowledge.h"
#include "fleet/measurement.h"

namespace focalfleet {

/// The plate and its camera.
struct CameraSite {
  CameraModel model;
  SensorLimits sensor;
  std::vector<Fiducial> fiducials;
  IdentifyOptions options;
};

/// The beliefs at the time when the exposure was requested. Shapes: (n), as the layout.
struct Believed {
  std::span<const UnitKnowledge> now;
  std::span<const std::optional<Pose>> before;  // before its last move; empty: not known
  std::span<const std::uint8_t> seen;           // non-zero: a camera has measured its place before
  std::span<const std::optional<Pose>> reported;  // reports of units of unknown place; or empty
  std::span<const UnitDrive> drives;
};

/// The place where each unit is looked for. A unit of unknown place is looked for where it reports,
/// and anywhere in its interval or, without one, in its patrol area.
std::vector<UnitExpectation> Expect(const Layout& layout, const Believed& believed);

/// The pose, in vectors, of a unit of unknown place that is seen at `seen_fp`. Empty: its arms do
/// not reach there, or more than one whole turn or elbow side is possible and neither its interval
/// nor its own report decides, or four standard deviations of the spot may move the elbow by more
/// than `clearance_mm`, as where the arm is folded or stretched.
std::optional<Pose> PoseOfLost(const Unit& unit, const UnitDrive& drive, PointFp seen_fp,
                               const UnitExpectation& expectation, double sigma_mm,
                               double clearance_mm);

/// The pose of a unit of known place that is seen. Where the fibre is so near its base that four
/// standard deviations of the spot turn the elbow by more than the clearance, the angles stay as
/// they are believed within a unit's usual errors. With a wider belief an error of 5 um at 0.14 mm
/// from the base turns the elbow by 2 degrees. Elsewhere the pose is the one that puts the fibre on
/// the spot, also where arms of other lengths than the table's do that. Empty: as PlaceSeen.
struct KnownSeen {
  double sigma_mm = 0;
  double clearance_mm = 0;
  bool was_seen = false;  // a camera has measured the unit before
};
std::optional<Pose> PoseOfKnown(const Unit& unit, const UnitDrive& drive, PointFp seen_fp,
                                const Pose& believed, const KnownSeen& with);

/// The measurements, one for each unit of the layout. A place is given where the status is certain
/// and the arms reach it. A unit of unknown place gets one where a single pose is possible there
/// (PoseOfLost). Cost: as Identify. Errors: kRefused: the exposure as a whole is not used; the
/// reason's name and its numbers.
Result<ExposureFindings> FindUnits(std::uint64_t id, const Layout& layout, const Believed& believed,
                                   const CameraSite& site, const Exposure& exposure);

}  // namespace focalfleet
