// The place where a unit's fibre is expected, and how well it is known: the identification of spots
// starts from it. The blind error of a move is an error of the two angles, so at the fibre it is an
// ellipse:
//
//   S = st^2 jt jt' + sp^2 jp jp' + s0^2 1     jt, jp: fibre per radian of theta and phi,
//                                              perpendicular to base-fibre and elbow-fibre
#pragma once

#include <array>
#include <optional>

#include "fleet/kinematics.h"
#include "fleet/layout.h"
#include "fleet/measurement.h"

namespace focalfleet {

/// Standard deviations after a move that no camera has measured yet.
struct BlindError {
  double theta_sigma_deg = 0.22;  // with 8.25 mm arms: 54 um rms over the patrol area
  double phi_sigma_deg = 0.22;
  double place_sigma_mm = 0.003;
};

/// A range of each axis' own angle, ends included.
struct AngleBox {
  struct Range {
    double low_deg = 0;
    double high_deg = 0;
  };
  std::array<Range, kAxisCount> axis;
  [[nodiscard]] bool Holds(const AxisAngles& angles) const {
    return angles.theta_deg >= axis[0].low_deg && angles.theta_deg <= axis[0].high_deg &&
           angles.phi_deg >= axis[1].low_deg && angles.phi_deg <= axis[1].high_deg;
  }
};

struct UnitExpectation {
  /// The place after the move by the current model. Empty: not known (the knowledge is unknown or
  /// an interval).
  std::optional<PointFp> expected_fp;
  std::optional<AxisAngles> commanded;  // the command that was sent; swaps are found by it
  std::optional<AxisAngles> before;     // where its axes were believed before
  std::optional<PointFp> before_fp;     // where it was seen before, or believed
  double before_sigma_mm = 0.02;        // of one coordinate of before_fp
  /// The unit was commanded elsewhere since before_fp. False: disabled, or without a target; its
  /// light is then a light of known place.
  bool moved = true;
  BlindError blind;
  double flux = 0;  // of its spot, as usual; 0: not known
  /// The place of the unit is not known. expected_fp is then what the unit reports, against the
  /// store: a hypothesis. Empty: it reports nothing, or its report cannot be right.
  bool lost = false;
  /// Angles of a lost unit: its axes stand within these. Empty: anywhere in their ranges.
  std::optional<AngleBox> within;
};

/// The covariance S at these angles.
CovarianceFp CovarianceAt(const Unit& unit, const AxisAngles& angles, const BlindError& blind);

/// Squared distance in units of the covariance with `sigma_mm` added to each coordinate.
double SquaredSigmas(PointFp from, PointFp to, const CovarianceFp& covariance, double sigma_mm);
double LargestVariance(const CovarianceFp& covariance);

/// A unit that moves between two pairs of angles and was seen or believed at `before_fp`.
UnitExpectation ExpectMove(const Unit& unit, const AxisAngles& before, const AxisAngles& commanded,
                           const BlindError& blind);
/// A unit that stays where it is: disabled, or without a target.
UnitExpectation ExpectStill(PointFp seen_fp, double sigma_mm);

/// A unit whose place is not known.
UnitExpectation ExpectLost(const Unit& unit, const std::optional<AxisAngles>& says,
                           const std::optional<AngleBox>& within, const BlindError& blind);

/// The pose that x and y show, and what they leave open. Theta's whole turn and the side of the
/// elbow cannot be seen. They are taken from where the axes are believed, where that decides.
struct PoseReading {
  std::optional<AxisAngles> nearest;  // to the believed angles; empty: no angles reach the place
  bool elbow_is_known = false;        // the other side is farther than `travel_max_deg` away
  bool turn_is_known = false;         // every other whole turn is that far away
};
/// `travel_max_deg`: how far either axis may be from where it is believed. Swapped and strayed
/// units have no believed angles: with 360 or more nothing counts as known.
PoseReading ReadPose(const Unit& unit, PointFp seen_fp, const AxisAngles& believed,
                     double travel_max_deg);

}  // namespace focalfleet
