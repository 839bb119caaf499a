// Identify leads from the spots of one exposure to the place of each unit's fibre, or the reason
// why it is not known.
//
//   camera's model -> fiducials found (fiducials.h) -> map to the plate, air included (plate_map.h)
//   -> claims of units on spots, each with its odds (claims.h) -> swapped pairs (swaps.h)
//   -> spots assigned, exactly counted (assignment.h) -> those that strayed -> what blends
//
// A spot is assigned only where that is nearly certain; otherwise the unit's status is the reason.
// Three things cannot be seen at all.
// - Theta's whole turn and the elbow's side (ReadPose says what remains open).
// - Two swapped units whose commands put the fibre at the same place.
// - A dark unit whose place another light takes by chance. With the default odds that is one in
// some 20,000 exposures of 5000 units that have 1 % dark fibres and 25 spots of dust.
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
  CovarianceFp covariance;       // centroid, map and air; of a blend also its possible bias
  std::array<bool, kAxisCount> stayed{};  // these axes did not move
  /// Swapped, or suspected: the unit whose command it carried out. Ambiguous: a rival, where there
  /// is one.
  PositionerIndex other = kNoUnit;
  /// False: more than one reason explains the spot. Start and end of the move are near each other,
  /// or one axis may have stayed, or slipped. The place is good, the status is kMeasured.
  bool motion_is_known = true;
  double doubt = 0;  // probability that the spot is another's, by the odds in the options
};

/// Odds before an exposure: shares of units; of dust, against the count of units.
struct PriorShares {
  double did_not_move = 0.02;
  double one_axis_stayed = 0.01;
  double strayed = 0.01;
  double missing = 0.01;
  /// The share of units of unknown place that stand where they report. With a half, neither their
  /// report nor the store's is taken. With 0.25 or 0.9 the log odds of a spot there change by 0.6,
  /// of some 10 that it has.
  double lost_report_right = 0.5;
  double dust = 0.005;
};

struct IdentifyOptions {
  CameraBounds bounds;
  PlateMapOptions map;  // its radius is taken from the fiducials
  double centroid_sigma_mm = 0.002;
  double fiducial_sigma_mm = 0.002;  // how well their places are known
  /// rms of the fiducials, one coordinate; beyond it the residual is not air
  double residual_mm_max = 0.05;
  bool use_still_units = true;      // units that stand still serve as further lights of known place
  double still_sigma_mm = 0.002;    // how exactly a unit that does not move stays
  double gate_squared_sigmas = 18;  // of the blind error: one unit in 8000 is beyond
  double doubt_max = 1e-3;
  double stray_doubt_max = 0.05;
  double motion_doubt_max = 0.01;  // a spot may be certain while its reason is not
  double blend_mm = 0.5;           // two fibres nearer than this are one spot
  double blend_width_ratio = 1.2;  // a spot wider than this times the median is more than one
  double blend_flux_ratio = 1.6;   // and a spot brighter than this times the unit's usual
  double outside_mm = 1;           // a spot is looked at up to so far out of patrol
  PriorShares shares;
  double recognised_share_min = 0.5;  // below: another field
  double spots_share_min = 0.3;       // of units and fiducials; otherwise the exposure is refused
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
  /// spots that belong to no unit or fiducial, rows of the exposure
  std::vector<std::uint32_t> unexplained;
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

/// The place of every unit, or its status. Pre: `layout`, `camera`, `exposure` are there; one
/// expectation a unit. Errors: the reason why the exposure as a whole is not used.
tl::expected<Identification, Refusal> Identify(const IdentificationRequest& request,
                                               const IdentifyOptions& options);

}  // namespace focalfleet
