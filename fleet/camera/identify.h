// From the spots of one exposure to where each unit's fibre is, or why nothing can be said of it.
//
//   camera's model -> fiducials found (fiducials.h) -> map to the plate, air included (plate_map.h)
//   -> claims of units on spots, each with its odds (expectation.h) -> swapped pairs (swaps.h)
//   -> who has which spot, exactly counted (assignment.h) -> those that strayed -> what blends
//
// A spot is named only where that is nearly certain; otherwise the unit says why not. Three things
// cannot be seen at all: theta's whole turn and the elbow's side (ReadPose says what remains open);
// two swapped units whose commands put the fibre at the same place; a dark unit whose place another
// light takes by chance: with the default odds one in some 20,000 exposures of 5000 units that have
// 1 % dark fibres and 25 spots of dust.
//
// Cost: 5000 units, 120 fiducials: about 25 ms.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <tl/expected.hpp>
#include <vector>

#include "fleet/camera/assignment.h"
#include "fleet/camera/camera_model.h"
#include "fleet/camera/expectation.h"
#include "fleet/camera/fiducials.h"
#include "fleet/camera/plate_map.h"
#include "fleet/camera/spots.h"
#include "fleet/measurement.h"

namespace focalfleet {

inline constexpr PositionerIndex kNoUnit{UINT32_MAX};

struct UnitMeasurement {
  MeasurementStatus status = MeasurementStatus::kMissing;
  std::uint32_t spot = kNoSpot;  // row of the exposure; kNoSpot: ambiguous or missing
  PointFp at_fp;                 // meaningless without a spot
  CovarianceFp covariance;       // centroid, map and air; of a blend also what it may be off
  std::array<bool, kAxisCount> stayed{};  // did not move: these axes
  /// Swapped, or suspected: whose command it carried out. Ambiguous: a rival, where there is one.
  PositionerIndex other = kNoUnit;
  /// False: its spot, for more than one reason: start and end of its move are near each other, or
  /// one axis may have stayed, or slipped. The place is good, the status is kMeasured.
  bool motion_is_known = true;
  double doubt = 0;  // probability that the spot is not its, by the odds in the options
};

struct IdentifyOptions {
  CameraBounds bounds;
  PlateMapOptions map;  // its radius is taken from the fiducials
  double centroid_sigma_mm = 0.002;
  double fiducial_sigma_mm = 0.002;  // how well their places are known
  double residual_mm_max = 0.05;     // rms of the fiducials, one coordinate: beyond it is not air
  bool use_still_units = true;       // as further lights of known place
  double still_sigma_mm = 0.002;     // how exactly a unit that does not move stays
  double gate_squared_sigmas = 18;   // of the blind error: one unit in 8000 is beyond
  double doubt_max = 1e-3;
  double stray_doubt_max = 0.05;
  double motion_doubt_max = 0.01;  // whose spot it is may be certain, and why it is there not
  double blend_mm = 0.5;           // two fibres nearer than this are one spot
  double blend_width_ratio = 1.2;  // a spot wider than this times the median is more than one
  double blend_flux_ratio = 1.6;   // and one brighter than this times the unit's usual
  double outside_mm = 1;           // how far out of patrol a spot is still looked at
  // Odds: shares of units, and of dust against the count of units.
  double did_not_move_share = 0.02;
  double one_axis_stayed_share = 0.01;
  double strayed_share = 0.01;
  double missing_share = 0.01;
  /// Of units of unknown place: those that stand where they say. With a half, neither their word
  /// nor the store's is taken; with 0.25 or 0.9 the log odds of a spot there change by 0.6, of some
  /// 10 that it has.
  double lost_says_right_share = 0.5;
  double dust_share = 0.005;
  double recognised_share_min = 0.5;  // below: another field
  double spots_share_min = 0.3;       // of units and fiducials, else the exposure is refused
  double spots_share_max = 1.5;
};

struct IdentificationRequest {
  const Layout* layout = nullptr;
  std::span<const UnitExpectation> expectations;  // Shape: (n), as the layout
  std::span<const Fiducial> fiducials;
  const CameraModel* camera = nullptr;
  const Exposure* exposure = nullptr;  // has passed CheckSpots
};

struct Identification {
  std::vector<UnitMeasurement> units;  // Shape: (n), as the layout
  std::array<std::uint32_t, kMeasurementStatusCount> count{};
  std::vector<std::uint32_t> unexplained;  // spots that are nobody's, rows of the exposure
  // The camera of this exposure against its model.
  double scale_change = 0;
  double rotation_deg = 0;
  PointFp shift_fp;
  int degree = 0;
  std::uint32_t fiducials_used = 0;
  std::uint32_t fiducials_missing = 0;  // no spot near
  std::uint32_t fiducials_false = 0;    // a spot near that does not fit the others
  std::uint32_t still_units_used = 0;
  double residual_mm = 0;         // of the fiducials, one coordinate, before the air is removed
  AirLaw air;                     // as it was during this exposure
  double map_sigma_mm = 0;        // median over the spots of what is left of both
  std::vector<PointFp> spots_fp;  // every spot on the plate, as the exposure's rows
};

/// Pre: `layout`, `camera`, `exposure` are there; one expectation a unit.
tl::expected<Identification, Refusal> Identify(const IdentificationRequest& request,
                                               const IdentifyOptions& options);

}  // namespace focalfleet
