// Lanes are columns side by side. Operations that are the same for many signatures of one unit run
// on eight at a time, with a row's eight numbers together in memory. Every column's sums run over
// its rows in their order, and no column touches another. The result of a column therefore depends
// neither on its neighbours nor on the width of the machine's registers.
#pragma once

#include <Eigen/Dense>
#include <array>
#include <cstddef>
#include <span>

#include "sim/campaigns/diagnosis/model/whiten.h"

namespace focalfleet::sim {

inline constexpr std::size_t kLanes = 8;

struct alignas(64) Lanes {
  double at[kLanes] = {};
};

// Rows of places are interleaved as everywhere: x of a move, then its y. Shapes: rows (2 moves).

/// Puts the displacement that pose errors make, in um, into one lane.
void PutDisplacement(const WhiteUnit& white, const PoseErrors& errors, std::size_t lane,
                     Lanes* rows);

/// Whitens every lane, as ApplyFilter does a single column. `from` and `to` may be the same rows.
/// Shapes: filter (moves), turn_um (moves, 4).
void WhitenLanes(std::span<const RowFilter> filter, const double* turn_um, const Lanes* from,
                 Lanes* to);

/// sums[c] = the c-th column times each lane. Shapes: columns (2 moves, c), sums (c).
void MultiplyLanes(const Eigen::MatrixXd& columns, const Lanes* rows, Lanes* sums);

/// left = rows - columns * parts. Shapes: parts (c), left as rows.
void SubtractColumns(const Eigen::MatrixXd& columns, const Lanes* parts, const Lanes* rows,
                     Lanes* left);

/// Products of each lane of `a` with each of `b`, summed over the rows. Shape: (lanes of a).
using LaneProducts = std::array<Lanes, kLanes>;
LaneProducts MultiplyBlocks(const Lanes* a, const Lanes* b, std::size_t rows);

/// Squared length of each lane.
Lanes SquareLanes(const Lanes* rows, std::size_t count);

/// Each move's products with itself, their sum and the largest. Shape: products (moves).
struct OwnProducts {
  Lanes sum, most;
};
OwnProducts MultiplyByThemselves(const Lanes* rows, std::size_t moves, Lanes* products);

/// Each move's products with `y`, and their sum. Shapes: y (2 moves), products (moves).
Lanes MultiplyByData(const Lanes* rows, const Eigen::VectorXd& y, Lanes* products);

void AddLanes(const Lanes& from, Lanes* to);
/// Adds the k-th of `from` to the at[k]-th of `to`.
void AddLanesAt(const Lanes* from, std::span<const std::size_t> at, Lanes* to);

/// Variance of the sum of each lane's scores b - g own about its own fit, where neighbours may be
/// alike (neighbour_sum.h). Shapes: b, g (moves).
Lanes SumAlikeNeighbours(const Lanes* b, const Lanes* g, const Lanes& own, std::size_t moves);

}  // namespace focalfleet::sim
