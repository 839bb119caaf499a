// Whitening turns a unit's residuals into independent numbers of variance one. An axis that has
// come to rest a little off stays there until it moves again, and so does the whole unit, as its
// carrier tilts. Errors of neighbouring exposures are therefore alike. The estimate of these rest
// errors from the places before is subtracted from each place (a Kalman filter along the unit's
// moves). The difference is divided by its spread.
//
// Noise of one measured place:
//   cov = place^2 I + var(rest of the unit) + sum over axes of t t' (angle^2 + var(rest)),
//   t = dplace / dangle,
//   rest <- carry rest + N(0, rest^2) whenever the axis moves, N(0, rest^2) after a homing,
//   rest of the unit, x and y: the same whenever either axis moves,
// times factors of the unit and of the exposure. Place times these has a floor, by the rounding of
// the places (place_steps.h). Rows count less (Huber) where the whitened length is beyond noise;
// the filter gives them less weight, too.
// Source: Durbin and Koopman, Time Series Analysis by State Space Methods, chapter 4.
#pragma once

#include <Eigen/Dense>
#include <cstddef>
#include <span>
#include <vector>

#include "sim/campaigns/campaign/place_steps.h"
#include "sim/campaigns/diagnosis/model/model.h"

namespace focalfleet::sim {

struct Noise {
  double place_um = 1;
  double least_um = kNoiseLeast_um;     // least own noise of a place, of any unit and exposure
  double angle_deg[2] = {0, 0};         // new at each exposure
  double rest_deg[2] = {0, 0};          // new at each move of the axis, held until the next
  double rest_um = 0;                   // in x and in y: new at each move of either axis
  double carry[3] = {0, 0, 0};          // share that the next move takes along, 0..1: axes, unit
  bool may_carry = false;               // whether the shares carried are fitted
  std::vector<double> unit_factor;      // Shape: (units)
  std::vector<double> exposure_factor;  // Shape: (exposures), or empty: all 1; of place_um
  bool fitted = false;                  // where a new search begins near
  double typical_um = 0;                // size of the residuals that it was fitted to
};

struct Fit;

/// The rest errors that a filter follows: of theta and phi, degrees; of the place in x and y, um.
inline constexpr std::size_t kRestErrors = 4;

/// The whitening of a used row: y = w (r - H e), e <- keep .* e before and + gain (r - H e) after.
struct RowFilter {
  double w[3];                   // symmetric root of the inverse covariance: xx, xy, yy; per um
  double gain[2 * kRestErrors];  // of each rest error by x, y
  double keep[3];                // of theta, phi, place, since the used row before

  [[nodiscard]] Eigen::Matrix2d root() const {
    return (Eigen::Matrix2d() << w[0], w[1], w[1], w[2]).finished();
  }
};

struct WhiteUnit {
  UnitTrack track;
  std::vector<std::size_t> moves;  // indices of the used moves in the track
  std::vector<RowFilter> filter;   // Shape: (moves)
  std::vector<double> turn_um;     // Shape: (moves, 4): d place / d theta, d phi; um per degree
  Eigen::VectorXd y;               // residuals; Shape: (2 moves)
  Eigen::MatrixXd geometry;        // d place / d (base, arms, zeros), per mm and degree

  /// Whitens a displacement given in um, interleaved x and y, in place. Shape: (2 moves).
  void Apply(double* xy_um) const;
};

/// The same for the rows of a filter. Shapes: filter (n), turn_um (n, 4), xy_um (2 n).
void ApplyFilter(std::span<const RowFilter> filter, std::span<const double> turn_um, double* xy_um);

/// The unit's rows with the weights that the fit has.
WhiteUnit Whiten(const Fit& fit, std::size_t unit);
/// The same with all weights 1, and only y, from which the rows' weights are made. `weights` gets
/// the Huber weight of each used row, which the filter uses as it goes.
WhiteUnit WhitenAnew(const Fit& fit, std::size_t unit, std::vector<double>* weights);

/// The displacements of a used row by a shift of the image in x and y, by its turn and by its
/// scale: per um, and per um at the radius. Before whitening.
Eigen::Matrix<double, 2, kExposureParameters> ImageDisplacements(const WhiteUnit& white,
                                                                 std::size_t k, double radius_mm);

/// The displacements that static geometry makes, in um per mm and degree, and that pose errors
/// make, in um. Shapes: (2 moves, 6), (2 moves).
Eigen::MatrixXd GeometryDisplacements(const WhiteUnit& white);
void Displacement(const WhiteUnit& white, const PoseErrors& errors, double* out);

/// The displacement that pose errors make, whitened. Shape: (2 moves).
void WhiteDisplacement(const WhiteUnit& white, const PoseErrors& errors, double* out);

}  // namespace focalfleet::sim
