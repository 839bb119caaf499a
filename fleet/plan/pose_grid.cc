#include "fleet/plan/pose_grid.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace focalfleet {
namespace {

/// Within so many steps of start or target the raster is too coarse for arms that stand almost
/// touching.
constexpr std::int32_t kTightSteps = 1;
/// Between two samples of an arm it is nearer to what is around by an eighth of a cell at most: a
/// cell is a quarter of the distance that it keeps.
constexpr double kCellsPerSample = 2;

/// Word i has bit k where word k had bit i.
void Transpose(std::array<std::uint64_t, 64>* words) {
  std::uint64_t mask = 0x00000000ffffffffu;
  for (std::size_t half = 32; half != 0; half >>= 1, mask ^= mask << half) {
    for (std::size_t k = 0; k < 64; k = ((k | half) + 1) & ~half) {
      const std::uint64_t swap = (((*words)[k] >> half) ^ (*words)[k | half]) & mask;
      (*words)[k] ^= swap << half;
      (*words)[k | half] ^= swap;
    }
  }
}

}  // namespace

std::int32_t VectorsPerStep(const AxisDrive& drive, const TimeSteps& steps) {
  return std::max(1, static_cast<std::int32_t>(steps.step_s() / SecondsPerVector(drive) + 1e-6));
}

void PoseGrid::SetUp(const UnitDrive& drive, const TimeSteps& steps, const Pose& from,
                     const Pose& to, const PoseBox& within) {
  for (std::size_t k = 0; k < kAxisCount; ++k) {
    const std::int32_t step = VectorsPerStep(drive.axis[k], steps);
    const std::int32_t low = std::min(from[k], to[k]);
    const std::int32_t high = std::max(from[k], to[k]);
    // Whole steps from the start, what is left before the target, and whole steps beyond both.
    std::vector<std::int32_t>& at = vectors_[k];
    at.clear();
    for (std::int32_t v = low - (low - within.low[k]) / step * step; v < low; v += step)
      at.push_back(v);
    const std::int32_t left = (high - low) % step;
    const std::size_t first = at.size();
    at.push_back(low);
    for (std::int32_t v = low + (from[k] <= to[k] || left == 0 ? step : left); v < high; v += step)
      at.push_back(v);
    if (high != low) at.push_back(high);
    from_[k] = static_cast<std::int32_t>(from[k] <= to[k] ? first : at.size() - 1);
    to_[k] = static_cast<std::int32_t>(from[k] <= to[k] ? at.size() - 1 : first);
    for (std::int32_t v = high + step; v <= within.high[k]; v += step) at.push_back(v);
  }
  // A column has a bit to spare: what is shifted beyond its end meets no other column.
  words_per_column_ = vectors_[1].size() / 64 + 1;
}

std::int32_t PoseGrid::StepsBetween(const GridPose& a, const GridPose& b) {
  return std::max(std::abs(a[0] - b[0]), std::abs(a[1] - b[1]));
}

void PoseGrid::Spread(const std::uint64_t* set, std::uint64_t* scratch, std::uint64_t* out) const {
  const std::size_t w = words_per_column_;
  const std::size_t n = words();
  if (w == 1) {
    for (std::size_t i = 0; i < n; ++i) scratch[i] = set[i] | set[i] << 1 | set[i] >> 1;
  } else {
    scratch[0] = scratch[n - 1] = 0;
    for (std::size_t i = 1; i + 1 < n; ++i)
      scratch[i] = set[i] | set[i] << 1 | set[i - 1] >> 63 | set[i] >> 1 | set[i + 1] << 63;
  }
  for (std::size_t i = w; i + w < n; ++i) out[i] = scratch[i - w] | scratch[i] | scratch[i + w];
}

void RasterBitsAt(const SegmentFp& line, const Surround& around, const StepWords& words,
                  std::uint64_t* bits) {
  const RasterWindow& window = around.window;
  // In cells from the window's corner; none is negative but by rounding.
  const double x = line.a.x_mm / window.cell_mm - window.x0;
  const double y = line.a.y_mm / window.cell_mm - window.y0;
  const double dx = (line.b.x_mm - line.a.x_mm) / window.cell_mm;
  const double dy = (line.b.y_mm - line.a.y_mm) / window.cell_mm;
  const int parts = 1 + static_cast<int>((std::abs(dx) + std::abs(dy)) / kCellsPerSample);
  const double part = 1.0 / parts;
  for (int n = 0; n <= parts; ++n) {
    const auto column =
        std::clamp(static_cast<std::int32_t>(x + n * part * dx), 0, window.width - 1);
    const auto row = std::clamp(static_cast<std::int32_t>(y + n * part * dy), 0, window.height - 1);
    const std::uint64_t* from = around.bits.data() + (static_cast<std::size_t>(row) *
                                                          static_cast<std::size_t>(window.width) +
                                                      static_cast<std::size_t>(column)) *
                                                         words.of_cell;
    for (std::size_t w = 0; w < words.first; ++w) bits[w] |= from[w];
  }
}

/// All that comes so near to the start or the target that poses next to them may meet it.
void FreePoses::FindParts(const StepQuestion& q, const PoseGrid& grid) {
  parts_.clear();
  double slack_mm = 0;
  for (const GridPose& end : {grid.from(), grid.to()})
    for (std::int32_t a = -1; a <= 1; a += 2)
      for (std::int32_t b = -1; b <= 1; b += 2) {
        const GridPose at{end[0] + a * kTightSteps, end[1] + b * kTightSteps};
        if (!grid.Contains(at)) continue;
        const Pose p = grid.At(at);
        const Pose e = grid.At(end);
        slack_mm =
            std::max(slack_mm, q.arm->TravelBound(std::abs(p[0] - e[0]), std::abs(p[1] - e[1])));
      }
  const std::array<SegmentFp, 2> ends{q.arm->At(q.from), q.arm->At(q.to)};
  const auto add = [&](const SegmentFp& line, double need_mm, double from_s, double to_s) {
    const double far = need_mm + slack_mm;
    if (SquaredDistance(line, ends[0]) > far * far && SquaredDistance(line, ends[1]) > far * far)
      return;
    const double h = q.steps.step_s();
    const double last = static_cast<double>(q.end_step);
    parts_.push_back({line, need_mm,
                      static_cast<std::int32_t>(std::floor(std::clamp(from_s / h, 0.0, last))),
                      static_cast<std::int32_t>(std::floor(std::clamp(to_s / h, -1.0, last)))});
  };
  for (const StandingThing& thing : q.standing)
    add(thing.capsule.line, thing.need_mm + thing.capsule.radius_mm, 0, Track::kForever);
  for (const MovingNeighbour& near : q.moving) {
    for (const Leg& leg : near.track->legs()) {
      if (leg.stands()) {
        add(ArmAt(*near.arm, leg, 0), near.need_mm, leg.begin_s - near.tolerance.Slip(leg.begin_s),
            leg.end_s + near.tolerance.Slip(leg.end_s));
        continue;
      }
      const int parts = std::max(
          1, static_cast<int>(std::ceil((leg.end_s - leg.begin_s) / (q.steps.step_s() / 2))));
      const double lasts = (leg.end_s - leg.begin_s) / parts;
      for (int n = 0; n < parts; ++n) {
        const double begin = leg.begin_s + n * lasts;
        const double slip = near.tolerance.Slip(begin + lasts);
        add(ArmAt(*near.arm, leg, begin + lasts / 2), near.need_mm, begin - slip,
            begin + lasts + slip);
      }
    }
  }
}

void FreePoses::ExactBitsAt(const SegmentFp& line, std::uint64_t* bits) const {
  std::fill_n(bits, step_words_.first, 0);
  for (const Part& part : parts_) {
    if (SquaredDistance(line, part.line) > part.need_mm * part.need_mm) continue;
    for (std::int32_t step = part.first; step <= part.last; ++step)
      bits[static_cast<std::size_t>(step / 64)] |= std::uint64_t{1} << (step % 64);
  }
}

void FreePoses::SetUp(const StepQuestion& question, const PoseGrid& grid) {
  words_ = grid.words();
  step_words_ = {.first = static_cast<std::size_t>(question.end_step) / 64 + 1,
                 .of_cell = question.steps.words()};
  free_.assign(static_cast<std::size_t>(question.end_step + 1) * words_, 0);
  all_.assign(words_, 0);
  bits_.assign(64 * step_words_.of_cell, 0);
  folds_.clear();
  for (std::int32_t phi = 0; phi < grid.count(1); ++phi)
    folds_.push_back(DirectionOf(question.arm->Fold(grid.At({0, phi})[1])));
  FindParts(question, grid);
  // Two columns of up to 32 poses fill a block of 64.
  const std::int32_t together = grid.count(1) <= 32 ? 2 : 1;
  for (std::int32_t theta = 0; theta < grid.count(0); theta += together)
    for (std::int32_t first = 0; first < grid.count(1); first += 64) {
      const std::array<std::uint64_t, 2> inside{
          TakeColumn(question, grid, {theta, first}, 0),
          together == 2 && theta + 1 < grid.count(0)
              ? TakeColumn(question, grid, {theta + 1, first}, 32)
              : 0};
      TurnBlock(question, grid.WordOf({theta, first}), inside, together == 2 ? 32 : 0);
    }
}

/// Looks at up to 64 poses of a column from `at` on; their bits stand from row `row` of the block
/// on. Returns which of them are on ways that end in time.
std::uint64_t FreePoses::TakeColumn(const StepQuestion& q, const PoseGrid& grid,
                                    const GridPose& from, std::size_t row) {
  const ArmGeometry& arm = *q.arm;
  const Direction inner = DirectionOf(arm.Theta(grid.At({from[0], 0})[0]));
  const PointFp elbow{arm.base_fp().x_mm + arm.theta_arm_mm() * inner.cos,
                      arm.base_fp().y_mm + arm.theta_arm_mm() * inner.sin};
  const std::int32_t count = std::min(grid.count(1) - from[1], 64);
  std::uint64_t inside = 0;
  for (std::int32_t k = 0; k < count; ++k) {
    const GridPose at{from[0], from[1] + k};
    const std::int32_t before = PoseGrid::StepsBetween(grid.from(), at);
    const std::int32_t after = PoseGrid::StepsBetween(at, grid.to());
    if (before + after > q.end_step) continue;
    inside |= std::uint64_t{1} << k;
    std::uint64_t* bits = bits_.data() + (row + static_cast<std::size_t>(k)) * step_words_.of_cell;
    const Direction& fold = folds_[static_cast<std::size_t>(at[1])];
    const PointFp fibre{
        elbow.x_mm + arm.phi_arm_mm() * (inner.cos * fold.cos - inner.sin * fold.sin),
        elbow.y_mm + arm.phi_arm_mm() * (inner.sin * fold.cos + inner.cos * fold.sin)};
    RasterBitsAt({elbow, fibre}, *q.around, step_words_, bits);
    if (std::min(before, after) <= kTightSteps &&
        std::any_of(bits, bits + step_words_.first, [](std::uint64_t w) { return w != 0; }))
      ExactBitsAt({elbow, fibre}, bits);
  }
  return inside;
}

/// The block becomes a word a step, of each of its columns, and is empty again.
void FreePoses::TurnBlock(const StepQuestion& q, std::size_t word,
                          const std::array<std::uint64_t, 2>& inside, std::size_t second_row) {
  for (std::size_t n = 0; n < 2; ++n)
    if (inside[n] != 0) all_[word + n] = inside[n];
  for (std::size_t w = 0; w < step_words_.first; ++w) {
    std::array<std::uint64_t, 64> block;
    std::uint64_t any = 0;
    for (std::size_t k = 0; k < 64; ++k) {
      block[k] = bits_[k * step_words_.of_cell + w];
      any |= block[k];
    }
    if (any != 0) Transpose(&block);
    const std::size_t last =
        std::min<std::size_t>(64, static_cast<std::size_t>(q.end_step) + 1 - w * 64);
    for (std::size_t t = 0; t < last; ++t) {
      std::uint64_t* set = free_.data() + (w * 64 + t) * words_ + word;
      set[0] = inside[0] & ~block[t];
      if (inside[1] != 0) set[1] = inside[1] & ~(block[t] >> second_row);
    }
  }
  std::fill(bits_.begin(), bits_.end(), 0);
}

StepPaths::StepPaths(const UnitDrive& drive, const TimeSteps& steps)
    : drive_(drive), steps_(steps) {
  for (std::size_t k = 0; k < kAxisCount; ++k) whole_[k] = VectorsPerStep(drive.axis[k], steps);
}

void StepPaths::Close(std::size_t axis) {
  Run& run = runs_[axis];
  if (run.delta == 0) return;
  if (paths_[axis].full())
    fits_ = false;
  else
    paths_[axis].Append({static_cast<std::uint32_t>(run.since * steps_.ticks), run.delta,
                         drive_.axis[axis].repeat});
  run.delta = 0;
}

void StepPaths::Turn(std::int32_t step, const Pose& by) {
  for (std::size_t k = 0; k < kAxisCount; ++k) {
    Run& run = runs_[k];
    if (by[k] == 0) continue;
    if (step != run.until || (run.delta > 0) != (by[k] > 0)) {
      Close(k);
      run.since = step;
    }
    run.delta += by[k];
    // After a part of a step the axis waits for the next one.
    run.until = std::abs(by[k]) < whole_[k] ? -1 : step + 1;
  }
}

std::optional<AxisPaths> StepPaths::Take() {
  for (std::size_t k = 0; k < kAxisCount; ++k) Close(k);
  if (!fits_) return std::nullopt;
  return paths_;
}

}  // namespace focalfleet
