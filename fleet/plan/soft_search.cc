#include "fleet/plan/soft_search.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace focalfleet {
namespace {

constexpr std::int32_t kEndPose = -1;  // the target itself, which is not on the grid

constexpr std::int32_t kTightSteps = 1;

}  // namespace

void RasterBitsAt(const ArmGeometry& arm, const Pose& pose, const Surround& around,
                  std::size_t words, std::uint64_t* bits) {
  const SegmentFp line = arm.At(pose);
  const RasterWindow& window = around.window;
  const double dx = line.b.x_mm - line.a.x_mm;
  const double dy = line.b.y_mm - line.a.y_mm;
  const int parts = std::max(1, static_cast<int>(std::ceil(arm.phi_arm_mm() / Occupancy::kCellMm)));
  std::size_t before = ~std::size_t{0};
  for (int n = 0; n <= parts; ++n) {
    const double along = static_cast<double>(n) / parts;
    const auto x =
        static_cast<std::int32_t>(std::floor((line.a.x_mm + along * dx) / Occupancy::kCellMm)) -
        window.x0;
    const auto y =
        static_cast<std::int32_t>(std::floor((line.a.y_mm + along * dy) / Occupancy::kCellMm)) -
        window.y0;
    const std::size_t cell = static_cast<std::size_t>(std::clamp(y, 0, window.height - 1)) *
                                 static_cast<std::size_t>(window.width) +
                             static_cast<std::size_t>(std::clamp(x, 0, window.width - 1));
    if (cell == before) continue;
    before = cell;
    const std::uint64_t* from = around.bits.data() + cell * words;
    for (std::size_t w = 0; w < words; ++w) bits[w] |= from[w];
  }
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
    run.until = step + 1;
  }
}

std::optional<AxisPaths> StepPaths::Take() {
  for (std::size_t k = 0; k < kAxisCount; ++k) Close(k);
  if (!fits_) return std::nullopt;
  return paths_;
}

void SoftSearch::SetUp() {
  words_ = q_.steps.words();
  const double step_s = q_.steps.step_s();
  for (std::size_t k = 0; k < kAxisCount; ++k) {
    step_[k] =
        std::max(1, static_cast<std::int32_t>(step_s / SecondsPerVector(q_.drive->axis[k]) + 1e-6));
    low_[k] = -((q_.from[k] - q_.within.low[k]) / step_[k]);
    count_[k] = (q_.within.high[k] - q_.from[k]) / step_[k] - low_[k] + 1;
  }
  const auto poses = static_cast<std::size_t>(count_[0]) * static_cast<std::size_t>(count_[1]);
  pose_runs_.assign(poses, {});
  pose_bits_.resize(std::max(pose_bits_.size(), poses * words_));
  runs_.clear();
  nodes_.clear();
  open_.clear();
  best_end_ = -1;
  FindRests();
  target_bits_.assign(words_, 0);
  ExactBitsAt(q_.to, target_bits_.data());
  target_meets_.assign(static_cast<std::size_t>(q_.steps.count) + 2, 0);
  for (std::int32_t step = q_.steps.count; step >= 0; --step) {
    const bool meets = (target_bits_[static_cast<std::size_t>(step / 64)] >> (step % 64) & 1) != 0;
    target_meets_[static_cast<std::size_t>(step)] =
        target_meets_[static_cast<std::size_t>(step) + 1] + (meets ? 1 : 0);
  }
}

/// Power may have no room in some steps.
void SoftSearch::FindRests() {
  may_leave_.resize(static_cast<std::size_t>(q_.end_step) + 2);
  std::int32_t next = q_.end_step + 1;
  for (std::int32_t step = q_.end_step + 1; step >= 0; --step) {
    if (step <= q_.end_step && (q_.rests.empty() || q_.rests[static_cast<std::size_t>(step)] == 0))
      next = step;
    may_leave_[static_cast<std::size_t>(step)] = next;
  }
}

Pose SoftSearch::PoseOf(std::int32_t pose) const {
  return {q_.from[0] + (pose / count_[1] + low_[0]) * step_[0],
          q_.from[1] + (pose % count_[1] + low_[1]) * step_[1]};
}

/// Near the start or the target, where the raster is too coarse for arms that stand almost
/// touching.
bool SoftSearch::IsTight(const Pose& pose) const {
  const auto near = [&](const Pose& p) {
    return std::abs(pose[0] - p[0]) <= kTightSteps * step_[0] &&
           std::abs(pose[1] - p[1]) <= kTightSteps * step_[1];
  };
  return near(q_.from) || near(q_.to);
}

void SoftSearch::ExactBitsAt(const Pose& pose, std::uint64_t* bits) const {
  const SegmentFp line = q_.arm->At(pose);
  const double h = q_.steps.step_s();
  const auto last_step = static_cast<std::int32_t>(words_ * 64) - 1;
  std::fill_n(bits, words_, 0);
  const auto set = [&](double from_s, double to_s) {
    const auto first = static_cast<std::int32_t>(std::floor(std::clamp(from_s / h, 0.0, 1e6)));
    const auto last = static_cast<std::int32_t>(std::floor(std::clamp(to_s / h, -1.0, 1e6)));
    for (std::int32_t step = std::min(first, last_step); step <= std::min(last, last_step); ++step)
      bits[static_cast<std::size_t>(step / 64)] |= std::uint64_t{1} << (step % 64);
  };
  for (const MovingNeighbour& near : q_.moving) {
    const double far = near.need_mm + near.track->reach_mm();
    if (SquaredDistance(near.arm->base_fp(), line) > far * far) continue;
    const double need2 = near.need_mm * near.need_mm;
    for (const Leg& leg : near.track->legs()) {
      if (leg.stands()) {
        if (SquaredDistance(line, ArmAt(*near.arm, leg, 0)) <= need2)
          set(leg.begin_s - near.tolerance.Slip(leg.begin_s),
              leg.end_s + near.tolerance.Slip(leg.end_s));
        continue;
      }
      const int parts =
          std::max(1, static_cast<int>(std::ceil((leg.end_s - leg.begin_s) / (h / 2))));
      const double lasts = (leg.end_s - leg.begin_s) / parts;
      for (int n = 0; n < parts; ++n) {
        const double begin = leg.begin_s + n * lasts;
        if (SquaredDistance(line, ArmAt(*near.arm, leg, begin + lasts / 2)) > need2) continue;
        const double slip = near.tolerance.Slip(begin + lasts);
        set(begin - slip, begin + lasts + slip);
      }
    }
  }
}

const SoftSearch::PoseRuns& SoftSearch::RunsAt(std::int32_t pose) {
  PoseRuns& known = pose_runs_[static_cast<std::size_t>(pose)];
  if (known.first >= 0) return known;
  std::uint64_t* bits = pose_bits_.data() + static_cast<std::size_t>(pose) * words_;
  std::fill_n(bits, words_, 0);
  RasterBitsAt(*q_.arm, PoseOf(pose), *q_.around, words_, bits);
  if (std::any_of(bits, bits + words_, [](std::uint64_t w) { return w != 0; }) &&
      IsTight(PoseOf(pose)))
    ExactBitsAt(PoseOf(pose), bits);
  known.first = static_cast<std::int32_t>(runs_.size());
  for (std::int32_t step = 0; step <= q_.end_step;) {
    const bool meets = BitOf(pose, step);
    std::int32_t last = step;
    while (last < q_.end_step && BitOf(pose, last + 1) == meets) ++last;
    runs_.push_back({static_cast<std::int16_t>(step), static_cast<std::int16_t>(last), meets, -1});
    step = last + 1;
  }
  known.count = static_cast<std::int32_t>(runs_.size()) - known.first;
  return known;
}

std::int32_t SoftSearch::StepsLeft(const Pose& pose) const {
  std::int32_t left = 0;
  for (std::size_t k = 0; k < kAxisCount; ++k)
    left = std::max(left, (std::abs(q_.to[k] - pose[k]) + step_[k] - 1) / step_[k]);
  return left;
}

void SoftSearch::Reach(const Node& node) {
  Run& run = runs_[static_cast<std::size_t>(node.run)];
  if (run.node >= 0) {
    Node& before = nodes_[static_cast<std::size_t>(run.node)];
    if (before.cost <= node.cost) return;
    before.done = true;
  }
  const std::int32_t left = StepsLeft(PoseOf(node.pose));
  if (node.step + left > q_.end_step) return;
  run.node = static_cast<std::int32_t>(nodes_.size());
  nodes_.push_back(node);
  open_.push_back({node.cost + 2 * left, left, run.node});
  std::push_heap(open_.begin(), open_.end());
}

void SoftSearch::Expand(std::int32_t index) {
  const Node node = nodes_[static_cast<std::size_t>(index)];
  const Run here = runs_[static_cast<std::size_t>(node.run)];
  const std::int32_t a = node.pose / count_[1];
  const std::int32_t b = node.pose % count_[1];
  // Waiting into the next run.
  const PoseRuns own = pose_runs_[static_cast<std::size_t>(node.pose)];
  if (node.run + 1 < own.first + own.count) {
    const std::int32_t waits = here.last + 1 - node.step;
    Reach({index,
           node.pose,
           node.run + 1,
           node.cost + (here.meets ? waits * q_.meets_cost : 0),
           static_cast<std::int16_t>(here.last + 1),
           {0, 0},
           false});
  }
  for (std::int32_t da = -1; da <= 1; ++da) {
    for (std::int32_t db = -1; db <= 1; ++db) {
      if ((da == 0 && db == 0) || a + da < 0 || a + da >= count_[0] || b + db < 0 ||
          b + db >= count_[1])
        continue;
      const std::int32_t there = (a + da) * count_[1] + b + db;
      const PoseRuns runs = RunsAt(there);
      for (std::int32_t r = runs.first; r < runs.first + runs.count; ++r) {
        const Run run = runs_[static_cast<std::size_t>(r)];
        if (run.first > here.last) break;
        const std::int32_t leaves =
            may_leave_[static_cast<std::size_t>(std::max<std::int32_t>(node.step, run.first))];
        // The step in which it moves belongs to both poses; it must still be there after it.
        if (leaves > here.last || leaves + 1 > run.last) continue;
        const std::int32_t met =
            (here.meets ? leaves - node.step + 1 : 0) + (!here.meets && run.meets ? 1 : 0);
        Reach({index,
               there,
               r,
               node.cost + 2 + met * q_.meets_cost,
               static_cast<std::int16_t>(leaves + 1),
               {static_cast<std::int8_t>(da), static_cast<std::int8_t>(db)},
               false});
      }
    }
  }
}

/// The last part of a step leads from here to the target, at the moment at which that meets least.
void SoftSearch::ReachEnd(std::int32_t index) {
  const Node node = nodes_[static_cast<std::size_t>(index)];
  const Run here = runs_[static_cast<std::size_t>(node.run)];
  std::int32_t best = -1;
  std::int32_t best_cost = 0;
  for (std::int32_t leaves = node.step;
       leaves <= std::min<std::int32_t>(here.last, q_.end_step - 1); ++leaves) {
    if (may_leave_[static_cast<std::size_t>(leaves)] != leaves) continue;
    const bool meets =
        here.meets ||
        (target_bits_[static_cast<std::size_t>(leaves / 64)] >> (leaves % 64) & 1) != 0;
    const std::int32_t met = (here.meets ? leaves - node.step : 0) + (meets ? 1 : 0) +
                             target_meets_[static_cast<std::size_t>(leaves) + 1];
    const std::int32_t cost = node.cost + met * q_.meets_cost;
    if (best < 0 || cost < best_cost) {
      best = leaves;
      best_cost = cost;
    }
  }
  if (best < 0) return;
  if (best_end_ >= 0 && nodes_[static_cast<std::size_t>(best_end_)].cost <= best_cost) return;
  best_end_ = static_cast<std::int32_t>(nodes_.size());
  nodes_.push_back(
      {index, kEndPose, -1, best_cost, static_cast<std::int16_t>(best + 1), {0, 0}, false});
  open_.push_back({best_cost, 0, best_end_});
  std::push_heap(open_.begin(), open_.end());
}

std::optional<AxisPaths> SoftSearch::LayOut(std::int32_t last) const {
  struct Turn {
    std::int32_t begins;
    Pose by;
  };
  std::vector<Turn> turns;
  const Node& end = nodes_[static_cast<std::size_t>(last)];
  const Pose before = PoseOf(nodes_[static_cast<std::size_t>(end.came_from)].pose);
  turns.push_back({end.step - 1, {q_.to[0] - before[0], q_.to[1] - before[1]}});
  for (std::int32_t at = end.came_from; nodes_[static_cast<std::size_t>(at)].came_from >= 0;
       at = nodes_[static_cast<std::size_t>(at)].came_from) {
    const Node& node = nodes_[static_cast<std::size_t>(at)];
    turns.push_back({node.step - 1, {node.turned[0] * step_[0], node.turned[1] * step_[1]}});
  }
  std::reverse(turns.begin(), turns.end());
  StepPaths paths(*q_.drive, q_.steps);
  for (const Turn& turn : turns) paths.Turn(turn.begins, turn.by);
  return paths.Take();
}

std::optional<SoftSearch::Found> SoftSearch::Find(const Question& question) {
  q_ = question;
  SetUp();
  const std::int32_t start = -low_[0] * count_[1] - low_[1];
  const PoseRuns runs = RunsAt(start);
  Reach({-1, start, runs.first, 0, 0, {0, 0}, false});
  std::uint32_t expansions = 0;
  while (!open_.empty() && ++expansions <= q_.expansions_max) {
    std::pop_heap(open_.begin(), open_.end());
    const Open next = open_.back();
    open_.pop_back();
    ++expansions_;
    Node& node = nodes_[static_cast<std::size_t>(next.node)];
    if (node.done) continue;
    node.done = true;
    if (node.pose == kEndPose) {
      std::int32_t moves = 0;
      for (std::int32_t at = node.came_from; nodes_[static_cast<std::size_t>(at)].came_from >= 0;
           at = nodes_[static_cast<std::size_t>(at)].came_from)
        if (nodes_[static_cast<std::size_t>(at)].turned[0] != 0 ||
            nodes_[static_cast<std::size_t>(at)].turned[1] != 0)
          ++moves;
      const std::int32_t met = (node.cost - 2 * moves) / q_.meets_cost;
      std::optional<AxisPaths> paths = LayOut(next.node);
      if (!paths) return std::nullopt;
      return Found{*paths, met};
    }
    if (next.left <= 1) ReachEnd(next.node);
    Expand(next.node);
  }
  return std::nullopt;
}

}  // namespace focalfleet
