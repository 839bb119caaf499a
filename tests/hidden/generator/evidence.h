// The visibility of an effect in a campaign is the chi-square that it explains. The noise is made
// white and every unit's static geometry is taken out before.
//
// A measured place is the true one plus two errors. The camera's scatter is new in every picture,
// and the scatter of the axes' rest stays until the axis moves again. The latter is a state with
// two coordinates seen through the arm's Jacobian. A Kalman filter therefore whitens exactly in
// O(moves); a covariance matrix over all moves would cost their cube.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "tests/hidden/generator/campaign.h"

namespace focalfleet::hidden {

struct NoiseModel {
  std::vector<double> centroid_um;  // of one coordinate, by unit
  ByAxis actuation_deg{};
};

using Matrix2 = std::array<double, 4>;  // row by row
using Column = std::vector<double>;

/// The effect of a change of the geometry on a unit's places, one column each. Columns are base x
/// and y, arms (um per um), zeros (um per mdeg). Shape: (6, moves).
std::array<std::vector<Place>, 6> StaticColumns(const Campaign& campaign, std::size_t unit);

/// The data space of a unit. Rows that are not `used` do not exist in it.
class UnitSpace {
 public:
  UnitSpace(const Campaign& campaign, const NoiseModel& noise, std::size_t unit,
            std::span<const char> used);

  /// The column with the noise made white. Shape: (moves) in um, to (2 * used moves).
  [[nodiscard]] Column Whiten(std::span<const Place> um) const;
  /// The whitened column without the part that the static geometry can take up.
  [[nodiscard]] Column Project(std::span<const Place> um) const;
  /// The static columns, whitened: which = 0..5.
  [[nodiscard]] Column Static(std::size_t which) const;

 private:
  struct Step {
    bool used = false;
    std::array<bool, kAxes> renewed{};
    Matrix2 jacobian{};  // um per deg
    Matrix2 gain{};
    Matrix2 whitener{};
  };
  std::vector<Step> steps_;
  std::array<std::vector<Place>, 6> static_um_;
  std::vector<Column> basis_;
};

double Dot(const Column& a, const Column& b);
/// Takes the span of an orthonormal basis out of a column.
void TakeOut(const std::vector<Column>& basis, Column* column);
/// Makes a column orthogonal to the basis and adds it, unless nothing is left of it.
void Extend(std::vector<Column>* basis, Column column);

}  // namespace focalfleet::hidden
