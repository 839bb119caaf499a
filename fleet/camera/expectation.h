// Where a unit's fibre is expected, and how well: what the identification of spots starts from. The
// blind error of a move is an error of the two angles, so at the fibre it is an ellipse:
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

/// Standard deviations after a move that nobody has measured yet.
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
  /// By the current model, after the move. None: nobody can say (unknown, an interval).
  std::optional<PointFp> expected_fp;
  std::optional<AxisAngles> commanded;  // what it was told; swaps are found by it
  std::optional<AxisAngles> before;     // where its axes were believed before
  std::optional<PointFp> before_fp;     // where it was seen before, or believed
  double before_sigma_mm = 0.02;        // of one coordinate of before_fp
  /// Told to go elsewhere since before_fp. False: disabled, or without a target: it only shines.
  bool moved = true;
  BlindError blind;
  double flux = 0;  // of its spot, as usual; 0: not known
  /// Its place is not known. expected_fp is then what the unit says itself, against the store: a
  /// hypothesis; none: it says nothing, or its word cannot be right.
  bool lost = false;
  /// Of a lost unit: its axes stand within these angles; none: anywhere in their ranges.
  std::optional<AngleBox> within;
};

/// S at these angles.
CovarianceFp CovarianceAt(const Unit& unit, const AxisAngles& angles, const BlindError& blind);

/// Squared distance in units of the covariance with `sigma_mm` added to each coordinate.
double SquaredSigmas(PointFp from, PointFp to, const CovarianceFp& covariance, double sigma_mm);
double LargestVariance(const CovarianceFp& covariance);

/// A move between two pairs of angles, seen or believed at `before_fp`.
UnitExpectation ExpectMove(const Unit& unit, const AxisAngles& before, const AxisAngles& commanded,
                           const BlindError& blind);
/// A unit that stays where it is: disabled, or without a target.
UnitExpectation ExpectStill(PointFp seen_fp, double sigma_mm);

/// A unit whose place is not known.
UnitExpectation ExpectLost(const Unit& unit, const std::optional<AxisAngles>& says,
                           const std::optional<AngleBox>& within, const BlindError& blind);

/// What x and y leave open. Theta's whole turn and the side of the elbow cannot be seen; they are
/// taken from where the axes are believed, where that decides.
struct PoseReading {
  std::optional<AxisAngles> nearest;  // to the believed angles; none: no angles reach the place
  bool elbow_is_known = false;        // the other side is farther than `travel_max_deg` away
  bool turn_is_known = false;         // so is every other whole turn
};
/// `travel_max_deg`: how far an axis may be from where it is believed, of either axis. Swapped and
/// strayed units have no believed angles: give 360 or more, and nothing is known.
PoseReading ReadPose(const Unit& unit, PointFp seen_fp, const AxisAngles& believed,
                     double travel_max_deg);

}  // namespace focalfleet
