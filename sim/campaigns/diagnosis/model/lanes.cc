#include "sim/campaigns/diagnosis/model/lanes.h"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <vector>

#include "protocol/base/units.h"
#include "sim/campaigns/diagnosis/model/neighbour_sum.h"

namespace focalfleet::sim {
namespace {

// Four lanes in one register, or in two where registers are half as wide. A compiler left to itself
// gathers lanes across rows instead.
struct FourOf {
  using Numbers [[gnu::vector_size(32), gnu::may_alias]] = double;
};
using Four = FourOf::Numbers;
constexpr std::size_t kFours = sizeof(Lanes) / sizeof(Four);

// Makes a second version of a function, for machines with wide registers. Both do the same
// operations on each lane, and none of them is fused: the results are the same. The loader chooses
// before a sanitizer is ready, so that those builds have one version.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define FOCALFLEET_ALSO_WIDE [[gnu::target_clones("avx2", "default")]]
#else
#define FOCALFLEET_ALSO_WIDE
#endif

[[gnu::always_inline]] inline Four* FoursOf(Lanes* lanes) {
  return reinterpret_cast<Four*>(lanes->at);
}
[[gnu::always_inline]] inline const Four* FoursOf(const Lanes* lanes) {
  return reinterpret_cast<const Four*>(lanes->at);
}
[[gnu::always_inline]] inline void Put(const Four* fours, Lanes* lanes) {
  for (std::size_t j = 0; j < kFours; ++j) FoursOf(lanes)[j] = fours[j];
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

FOCALFLEET_ALSO_WIDE
void WhitenLanes(std::span<const RowFilter> filter, const double* turn_um, const Lanes* from,
                 Lanes* to) {
  // Rest errors, estimated from the rows so far.
  Four theta[kFours] = {}, phi[kFours] = {}, x[kFours] = {}, y[kFours] = {};
  const double* t = turn_um;
  for (const RowFilter& f : filter) {
    for (std::size_t j = 0; j < kFours; ++j) {
      const Four a = theta[j] * f.keep[0], b = phi[j] * f.keep[1];
      const Four c = x[j] * f.keep[2], d = y[j] * f.keep[2];
      const Four dx = FoursOf(from)[j] - t[0] * a - t[2] * b - c;
      const Four dy = FoursOf(from + 1)[j] - t[1] * a - t[3] * b - d;
      theta[j] = a + (f.gain[0] * dx + f.gain[1] * dy);
      phi[j] = b + (f.gain[2] * dx + f.gain[3] * dy);
      x[j] = c + (f.gain[4] * dx + f.gain[5] * dy);
      y[j] = d + (f.gain[6] * dx + f.gain[7] * dy);
      FoursOf(to)[j] = f.w[0] * dx + f.w[1] * dy;
      FoursOf(to + 1)[j] = f.w[1] * dx + f.w[2] * dy;
    }
    from += 2, to += 2, t += 4;
  }
}

FOCALFLEET_ALSO_WIDE
void MultiplyLanes(const Eigen::MatrixXd& columns, const Lanes* rows, Lanes* sums) {
  const auto n = static_cast<std::size_t>(columns.rows());
  const auto count = static_cast<std::size_t>(columns.cols());
  const double* a = columns.data();
  for (std::size_t c = 0; c < count; c += 2, a += 2 * n) {
    // Two sums at a time wait less for each other.
    const double* b = c + 1 < count ? a + n : a;
    Four first[kFours] = {}, second[kFours] = {};
    for (std::size_t r = 0; r < n; ++r) {
      const Four* row = FoursOf(rows + r);
      for (std::size_t j = 0; j < kFours; ++j) {
        first[j] += a[r] * row[j];
        second[j] += b[r] * row[j];
      }
    }
    Put(first, sums + c);
    if (c + 1 < count) Put(second, sums + c + 1);
  }
}

FOCALFLEET_ALSO_WIDE
void SubtractColumns(const Eigen::MatrixXd& columns, const Lanes* parts, const Lanes* rows,
                     Lanes* left) {
  const auto n = static_cast<std::size_t>(columns.rows());
  const auto count = static_cast<std::size_t>(columns.cols());
  for (std::size_t r = 0; r < n; ++r) {
    const Four* row = FoursOf(rows + r);
    Four sum[kFours] = {row[0], row[1]};
    const double* a = columns.data() + r;
    for (std::size_t c = 0; c < count; ++c, a += n) {
      const Four* part = FoursOf(parts + c);
      for (std::size_t j = 0; j < kFours; ++j) sum[j] -= *a * part[j];
    }
    Put(sum, left + r);
  }
}

FOCALFLEET_ALSO_WIDE
LaneProducts MultiplyBlocks(const Lanes* a, const Lanes* b, std::size_t rows) {
  // Half of the lanes of `a` at a time: sums of more would not stay in registers.
  LaneProducts out;
  for (std::size_t begin = 0; begin < kLanes; begin += kLanes / 2) {
    Four sum[kLanes / 2][kFours] = {};
    for (std::size_t r = 0; r < rows; ++r)
      for (std::size_t i = 0; i < kLanes / 2; ++i)
        for (std::size_t j = 0; j < kFours; ++j)
          sum[i][j] += a[r].at[begin + i] * FoursOf(b + r)[j];
    for (std::size_t i = 0; i < kLanes / 2; ++i) Put(sum[i], &out[begin + i]);
  }
  return out;
}

FOCALFLEET_ALSO_WIDE
Lanes SquareLanes(const Lanes* rows, std::size_t count) {
  Four sum[kFours] = {};
  for (std::size_t r = 0; r < count; ++r) {
    const Four* row = FoursOf(rows + r);
    for (std::size_t j = 0; j < kFours; ++j) sum[j] += row[j] * row[j];
  }
  Lanes out;
  Put(sum, &out);
  return out;
}

FOCALFLEET_ALSO_WIDE
OwnProducts MultiplyByThemselves(const Lanes* rows, std::size_t moves, Lanes* products) {
  Four sum[kFours] = {}, most[kFours] = {};
  for (std::size_t k = 0; k < moves; ++k) {
    const Four* x = FoursOf(rows + 2 * k);
    const Four* y = FoursOf(rows + 2 * k + 1);
    Four* product = FoursOf(products + k);
    for (std::size_t j = 0; j < kFours; ++j) {
      const Four both = x[j] * x[j] + y[j] * y[j];
      product[j] = both;
      sum[j] += both;
      most[j] = most[j] < both ? both : most[j];
    }
  }
  OwnProducts out;
  Put(sum, &out.sum), Put(most, &out.most);
  return out;
}

FOCALFLEET_ALSO_WIDE
Lanes MultiplyByData(const Lanes* rows, const Eigen::VectorXd& y, Lanes* products) {
  Four sum[kFours] = {};
  const double* data = y.data();
  const auto moves = static_cast<std::size_t>(y.size()) / 2;
  for (std::size_t k = 0; k < moves; ++k, data += 2) {
    const Four* first = FoursOf(rows + 2 * k);
    const Four* second = FoursOf(rows + 2 * k + 1);
    Four* product = FoursOf(products + k);
    for (std::size_t j = 0; j < kFours; ++j) {
      const Four both = first[j] * data[0] + second[j] * data[1];
      product[j] = both;
      sum[j] += both;
    }
  }
  Lanes out;
  Put(sum, &out);
  return out;
}

void AddLanes(const Lanes& from, Lanes* to) {
  for (std::size_t j = 0; j < kFours; ++j) FoursOf(to)[j] += FoursOf(&from)[j];
}

FOCALFLEET_ALSO_WIDE
void AddLanesAt(const Lanes* from, std::span<const std::size_t> at, Lanes* to) {
  for (const std::size_t place : at) {
    for (std::size_t j = 0; j < kFours; ++j) FoursOf(to + place)[j] += FoursOf(from)[j];
    ++from;
  }
}

FOCALFLEET_ALSO_WIDE
Lanes SumAlikeNeighbours(const Lanes* b, const Lanes* g, const Lanes& own, std::size_t moves) {
  static_assert(kNeighbourLags == 4);
  constexpr double w[] = {NeighbourShare(1), NeighbourShare(2), NeighbourShare(3),
                          NeighbourShare(4)};
  Lanes out;
  for (std::size_t j = 0; j < kFours; ++j) {
    const Four mean = FoursOf(&own)[j];
    Four sum = {}, past[kNeighbourLags] = {};
    for (std::size_t k = 0; k < moves; ++k) {
      const Four v = FoursOf(b + k)[j] - FoursOf(g + k)[j] * mean;
      sum += v * (v + 2 * (w[0] * past[0] + w[1] * past[1] + w[2] * past[2] + w[3] * past[3]));
      past[3] = past[2], past[2] = past[1], past[1] = past[0], past[0] = v;
    }
    FoursOf(&out)[j] = sum;
  }
  for (double& value : out.at) value = std::max(value, 0.0);
  return out;
}

}  // namespace focalfleet::sim
