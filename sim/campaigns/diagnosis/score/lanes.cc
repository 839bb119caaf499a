#include "sim/campaigns/diagnosis/score/lanes.h"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <vector>

#include "protocol/base/units.h"
#include "sim/campaigns/diagnosis/score/neighbour_sum.h"

namespace focalfleet::sim {
namespace {

// Two lanes in one register, which every machine has. A compiler left to itself gathers lanes
// across rows instead.
struct PairOf {
  using Numbers [[gnu::vector_size(16), gnu::may_alias]] = double;
};
using NumberPair = PairOf::Numbers;
constexpr std::size_t kPairs = sizeof(Lanes) / sizeof(NumberPair);

NumberPair* PairsOf(Lanes* lanes) { return reinterpret_cast<NumberPair*>(lanes->at); }
const NumberPair* PairsOf(const Lanes* lanes) {
  return reinterpret_cast<const NumberPair*>(lanes->at);
}
void Put(const NumberPair* pairs, Lanes* lanes) {
  for (std::size_t j = 0; j < kPairs; ++j) PairsOf(lanes)[j] = pairs[j];
}

bool IsAllZero(const std::vector<double>& values) {
  std::uint64_t bits = 0;
  for (const double value : values) bits |= std::bit_cast<std::uint64_t>(value);
  return bits << 1 == 0;  // but for the sign
}

// Puts errors of a single axis' angle, as most effects make, into a lane.
void PutTurn(const WhiteUnit& white, const std::vector<double>& angle_deg, std::size_t axis,
             std::size_t lane, Lanes* rows) {
  const std::size_t* moves = white.moves.data();
  const double* t = white.turn_um.data() + 2 * axis;
  const double* angle = angle_deg.data();
  for (std::size_t k = 0; k < white.moves.size(); ++k, t += 4) {
    const double a = angle[moves[k]];
    rows[2 * k].at[lane] = t[0] * a;
    rows[2 * k + 1].at[lane] = t[1] * a;
  }
}

}  // namespace

void PutDisplacement(const WhiteUnit& white, const PoseErrors& errors, std::size_t lane,
                     Lanes* rows) {
  const bool arms = !IsAllZero(errors.arm_mm[kTheta]) || !IsAllZero(errors.arm_mm[kPhi]);
  const bool place = !IsAllZero(errors.x_mm) || !IsAllZero(errors.y_mm);
  for (const std::size_t axis : {kTheta, kPhi})
    if (!arms && !place && IsAllZero(errors.angle_deg[1 - axis]))
      return PutTurn(white, errors.angle_deg[axis], axis, lane, rows);
  std::vector<double> column(2 * white.moves.size());
  Displacement(white, errors, column.data());
  for (std::size_t r = 0; r < column.size(); ++r) rows[r].at[lane] = column[r];
}

void WhitenLanes(const WhiteUnit& white, Lanes* rows) {
  // Rest errors, estimated from the rows so far.
  NumberPair theta[kPairs] = {}, phi[kPairs] = {}, x[kPairs] = {}, y[kPairs] = {};
  const RowFilter* f = white.filter.data();
  const double* t = white.turn_um.data();
  for (std::size_t k = 0; k < white.filter.size(); ++k, ++f, t += 4) {
    NumberPair* to_x = PairsOf(rows + 2 * k);
    NumberPair* to_y = PairsOf(rows + 2 * k + 1);
    for (std::size_t j = 0; j < kPairs; ++j) {
      const NumberPair a = theta[j] * f->keep[0], b = phi[j] * f->keep[1];
      const NumberPair c = x[j] * f->keep[2], d = y[j] * f->keep[2];
      const NumberPair dx = to_x[j] - t[0] * a - t[2] * b - c;
      const NumberPair dy = to_y[j] - t[1] * a - t[3] * b - d;
      theta[j] = a + (f->gain[0] * dx + f->gain[1] * dy);
      phi[j] = b + (f->gain[2] * dx + f->gain[3] * dy);
      x[j] = c + (f->gain[4] * dx + f->gain[5] * dy);
      y[j] = d + (f->gain[6] * dx + f->gain[7] * dy);
      to_x[j] = f->w[0] * dx + f->w[1] * dy;
      to_y[j] = f->w[1] * dx + f->w[2] * dy;
    }
  }
}

void MultiplyLanes(const Eigen::MatrixXd& columns, const Lanes* rows, Lanes* sums) {
  const auto n = static_cast<std::size_t>(columns.rows());
  const auto count = static_cast<std::size_t>(columns.cols());
  const double* a = columns.data();
  for (std::size_t c = 0; c < count; c += 2, a += 2 * n) {
    // Two sums at a time wait less for each other.
    const double* b = c + 1 < count ? a + n : a;
    NumberPair first[kPairs] = {}, second[kPairs] = {};
    for (std::size_t r = 0; r < n; ++r) {
      const NumberPair* row = PairsOf(rows + r);
      for (std::size_t j = 0; j < kPairs; ++j) {
        first[j] += a[r] * row[j];
        second[j] += b[r] * row[j];
      }
    }
    Put(first, sums + c);
    if (c + 1 < count) Put(second, sums + c + 1);
  }
}

void SubtractColumns(const Eigen::MatrixXd& columns, const Lanes* parts, const Lanes* rows,
                     Lanes* left) {
  const auto n = static_cast<std::size_t>(columns.rows());
  const auto count = static_cast<std::size_t>(columns.cols());
  for (std::size_t r = 0; r < n; ++r) {
    const NumberPair* row = PairsOf(rows + r);
    NumberPair sum[kPairs] = {row[0], row[1], row[2], row[3]};
    const double* a = columns.data() + r;
    for (std::size_t c = 0; c < count; ++c, a += n) {
      const NumberPair* part = PairsOf(parts + c);
      for (std::size_t j = 0; j < kPairs; ++j) sum[j] -= *a * part[j];
    }
    Put(sum, left + r);
  }
}

Lanes SquareLanes(const Lanes* rows, std::size_t count) {
  NumberPair sum[kPairs] = {};
  for (std::size_t r = 0; r < count; ++r) {
    const NumberPair* row = PairsOf(rows + r);
    for (std::size_t j = 0; j < kPairs; ++j) sum[j] += row[j] * row[j];
  }
  Lanes out;
  Put(sum, &out);
  return out;
}

OwnProducts MultiplyByThemselves(const Lanes* rows, std::size_t moves, Lanes* products) {
  NumberPair sum[kPairs] = {}, most[kPairs] = {};
  for (std::size_t k = 0; k < moves; ++k) {
    const NumberPair* x = PairsOf(rows + 2 * k);
    const NumberPair* y = PairsOf(rows + 2 * k + 1);
    NumberPair* product = PairsOf(products + k);
    for (std::size_t j = 0; j < kPairs; ++j) {
      const NumberPair both = x[j] * x[j] + y[j] * y[j];
      product[j] = both;
      sum[j] += both;
      most[j] = most[j] < both ? both : most[j];
    }
  }
  OwnProducts out;
  Put(sum, &out.sum), Put(most, &out.most);
  return out;
}

Lanes MultiplyByData(const Lanes* rows, const Eigen::VectorXd& y, Lanes* products) {
  NumberPair sum[kPairs] = {};
  const double* data = y.data();
  const auto moves = static_cast<std::size_t>(y.size()) / 2;
  for (std::size_t k = 0; k < moves; ++k, data += 2) {
    const NumberPair* first = PairsOf(rows + 2 * k);
    const NumberPair* second = PairsOf(rows + 2 * k + 1);
    NumberPair* product = PairsOf(products + k);
    for (std::size_t j = 0; j < kPairs; ++j) {
      const NumberPair both = first[j] * data[0] + second[j] * data[1];
      product[j] = both;
      sum[j] += both;
    }
  }
  Lanes out;
  Put(sum, &out);
  return out;
}

void AddLanes(const Lanes& from, Lanes* to) {
  for (std::size_t j = 0; j < kPairs; ++j) PairsOf(to)[j] += PairsOf(&from)[j];
}

Lanes SumAlikeNeighbours(const Lanes* b, const Lanes* g, const Lanes& own, std::size_t moves) {
  static_assert(kNeighbourLags == 4);
  constexpr double w[] = {NeighbourShare(1), NeighbourShare(2), NeighbourShare(3),
                          NeighbourShare(4)};
  Lanes out;
  for (std::size_t j = 0; j < kPairs; ++j) {
    const NumberPair mean = PairsOf(&own)[j];
    NumberPair sum = {}, past[kNeighbourLags] = {};
    for (std::size_t k = 0; k < moves; ++k) {
      const NumberPair v = PairsOf(b + k)[j] - PairsOf(g + k)[j] * mean;
      sum += v * (v + 2 * (w[0] * past[0] + w[1] * past[1] + w[2] * past[2] + w[3] * past[3]));
      past[3] = past[2], past[2] = past[1], past[1] = past[0], past[0] = v;
    }
    PairsOf(&out)[j] = sum;
  }
  for (double& value : out.at) value = std::max(value, 0.0);
  return out;
}

}  // namespace focalfleet::sim
