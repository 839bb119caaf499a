#include "fleet/plan/schedule.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

constexpr std::int64_t kCountsPerTick = 14'400;
static_assert(static_cast<double>(kCountsPerTick) == kTimerHz * 100e-6);
constexpr double kGrainDeg = 15;  // legs of one axis are cut into parts of about this angle

using AxisCounts = std::array<std::uint32_t, kAxisCount>;

void Count(const Piece& piece, AxisCounts* counts) {
  for (std::size_t k = 0; k < kAxisCount; ++k)
    if (piece.sweep.from[k] != piece.sweep.to[k]) ++(*counts)[k];
}

std::vector<AxisCounts> CountAll(std::span<const Piece> order, std::size_t units) {
  std::vector<AxisCounts> counts(units);
  for (const Piece& piece : order) Count(piece, &counts[piece.unit]);
  return counts;
}

AxisPath Lengthened(const AxisPath& path, std::int32_t by) {
  AxisPath longer;
  for (Segment segment : path.segments()) {
    if (longer.size() + 1 == path.size()) segment.delta += by;
    longer.Append(segment);
  }
  return longer;
}

class Scheduler {
 public:
  Scheduler(std::span<const Piece> order, const Scene& scene, std::span<const UnitDrive> drives,
            const PlanOptions& options, PowerLedger* ledger)
      : order_(order), scene_(scene), drives_(drives), options_(options), ledger_(ledger) {}

  Result<Plan> Run();

 private:
  struct Timed {
    std::uint32_t piece = 0;
    std::int64_t begin = 0;
    std::int64_t end = 0;
  };
  struct Wait {  // `later` begins after one of `earlier` has ended
    std::uint32_t earlier = 0;
    std::uint32_t later = 0;
    std::int64_t left = 0;
    std::int64_t begins = 0;
  };

  /// The first count at which a piece may begin that must not meet one that ends at `end`.
  [[nodiscard]] std::int64_t After(std::int64_t end) const {
    const double error = options_.clock_error;
    const double skew = options_.start_skew_s * kTimerHz;
    const double ended_at_last = static_cast<double>(end) / (1 - error) + skew;
    return static_cast<std::int64_t>((ended_at_last + skew) / (1 - error)) + kCountsPerTick;
  }
  [[nodiscard]] bool Meet(const Piece& a, const Piece& b, double need_mm) const {
    if (scene_.InCell(a.unit, a.sweep.box()) && scene_.InCell(b.unit, b.sweep.box())) return false;
    return !SweepsClear(scene_.arm(a.unit), a.sweep, scene_.arm(b.unit), b.sweep, need_mm, 2000);
  }
  [[nodiscard]] AxisPaths SegmentsOf(const Piece& piece, std::int64_t earliest,
                                     std::int64_t phi) const;
  std::optional<AxisPaths> FindPower(const Piece& piece, std::int64_t earliest);
  Timed Lay(std::uint32_t index, std::int64_t earliest, const AxisPaths& paths);
  Status Place(std::uint32_t index, std::int64_t earliest);
  [[nodiscard]] std::vector<std::uint32_t> FindStages() const;
  Status RunInStages(Plan* plan);
  void Collect(Plan* plan);

  std::span<const Piece> order_;
  const Scene& scene_;
  std::span<const UnitDrive> drives_;
  const PlanOptions& options_;
  PowerLedger* ledger_;
  std::vector<std::vector<Timed>> laid_;  // per unit
  std::vector<UnitPlan> plans_;           // per unit
  std::vector<std::array<std::int64_t, kAxisCount>> axis_end_;
  std::vector<Wait> waits_;
};

/// The segments of a piece that begins at `earliest`. `phi` begins then as well, or later if it
/// need not keep in step with theta.
AxisPaths Scheduler::SegmentsOf(const Piece& piece, std::int64_t earliest, std::int64_t phi) const {
  const Sweep& sweep = piece.sweep;
  const UnitDrive& drive = drives_[piece.unit];
  std::optional<InStep> in_step;
  if (sweep.out_of_step < 1) in_step = KeepInStep(sweep.from, sweep.to, drive);
  AxisPaths paths;
  for (std::size_t k = 0; k < kAxisCount; ++k) {
    if (sweep.to[k] == sweep.from[k]) continue;
    const std::int64_t tick = ((k == 0 ? earliest : phi) + kCountsPerTick - 1) / kCountsPerTick;
    paths[k].Append({static_cast<std::uint32_t>(tick), sweep.to[k] - sweep.from[k],
                     in_step ? in_step->repeat[k] : drive.axis[k].repeat});
  }
  return paths;
}

/// Enters the piece as soon as its rail can feed it. Empty: never.
std::optional<AxisPaths> Scheduler::FindPower(const Piece& piece, std::int64_t earliest) {
  constexpr std::int64_t kStepCounts = 500 * kCountsPerTick;
  constexpr std::int64_t kLast = std::int64_t{limits::kOffsetTicksMax} * kCountsPerTick;
  const Sweep& sweep = piece.sweep;
  const double theta_s =
      std::abs(sweep.to[0] - sweep.from[0]) * SecondsPerVector(drives_[piece.unit].axis[0]);
  for (; earliest < kLast; earliest += kStepCounts) {
    AxisPaths paths = SegmentsOf(piece, earliest, earliest);
    if (ledger_->Enter(piece.unit, paths)) return paths;
    if (sweep.out_of_step < 1 || paths[0].size() == 0 || paths[1].size() == 0) continue;
    const double theta_ends_s = static_cast<double>(earliest) / kTimerHz + theta_s;
    paths = SegmentsOf(piece, earliest,
                       static_cast<std::int64_t>(ledger_->BeginAfter(theta_ends_s) * kTimerHz));
    if (ledger_->Enter(piece.unit, paths)) return paths;
  }
  return std::nullopt;
}

/// Gives a piece its segments; a leg that goes on without pause lengthens the segment before it.
Scheduler::Timed Scheduler::Lay(std::uint32_t index, std::int64_t earliest,
                                const AxisPaths& paths) {
  const Piece& piece = order_[index];
  UnitPlan& plan = plans_[piece.unit];
  if (laid_[piece.unit].empty()) plan.from = piece.sweep.from;
  plan.to = piece.sweep.to;
  Timed timed{index, earliest, earliest};
  for (std::size_t k = 0; k < kAxisCount; ++k) {
    if (paths[k].size() == 0) continue;
    const Segment segment = paths[k].segments().front();
    const std::int64_t lasts = static_cast<std::int64_t>(std::abs(segment.delta)) * segment.repeat *
                               drives_[piece.unit].axis[k].counter1;
    std::int64_t& end = axis_end_[piece.unit][k];
    const std::span<const Segment> before = plan.path[k].segments();
    // An entry in the ledger stays as it was entered.
    const bool goes_on = ledger_ == nullptr && piece.sweep.out_of_step >= 1 && end == earliest &&
                         !before.empty() && before.back().repeat == segment.repeat &&
                         (before.back().delta > 0) == (segment.delta > 0);
    if (goes_on) {
      plan.path[k] = Lengthened(plan.path[k], segment.delta);
      end += lasts;
    } else {
      plan.path[k].Append(segment);
      end = segment.start_ticks * kCountsPerTick + lasts;
    }
    timed.end = std::max(timed.end, end);
  }
  return timed;
}

Result<Plan> Scheduler::Run() {
  laid_.resize(scene_.size());
  plans_.resize(scene_.size());
  axis_end_.resize(scene_.size(), {-1, -1});
  Plan plan;
  if (options_.stall_tolerant) {
    FOCALFLEET_TRY(RunInStages(&plan));
  } else {
    for (std::uint32_t index = 0; index < order_.size(); ++index) FOCALFLEET_TRY(Place(index, 0));
  }
  Collect(&plan);
  return plan;
}

/// The piece begins as soon as it may, not before `earliest`.
Status Scheduler::Place(std::uint32_t index, std::int64_t earliest) {
  const Piece& piece = order_[index];
  if (!laid_[piece.unit].empty()) earliest = std::max(earliest, laid_[piece.unit].back().end);
  const std::size_t first_wait = waits_.size();
  for (const NeighbourNeed& near : scene_.neighbours(piece.unit)) {
    for (const Timed& other : laid_[near.unit]) {
      if (!Meet(piece, order_[other.piece], near.need_mm)) continue;
      earliest = std::max(earliest, After(other.end));
      waits_.push_back({near.unit, piece.unit, other.end, 0});
    }
  }
  AxisPaths paths = SegmentsOf(piece, earliest, earliest);
  if (ledger_ != nullptr) {
    const std::optional<AxisPaths> fed = FindPower(piece, earliest);
    if (!fed) return Fail(ErrorCode::kRefused, "no plan within the limits of power was found");
    paths = *fed;
  }
  for (const AxisPath& path : paths)
    if (path.size() > 0 && path.segments().front().start_ticks > limits::kOffsetTicksMax)
      return Fail(ErrorCode::kRefused, "the motion would take longer than a start offset can say");
  const Timed timed = Lay(index, earliest, paths);
  for (std::size_t k = first_wait; k < waits_.size(); ++k) waits_[k].begins = timed.begin;
  laid_[piece.unit].push_back(timed);
  return {};
}

/// The stage of every piece: behind all pieces that come before it in the order and that it would
/// meet. Pieces of one stage therefore meet no other, wherever their units may halt. Shape: as the
/// order.
std::vector<std::uint32_t> Scheduler::FindStages() const {
  std::vector<std::uint32_t> stages(order_.size(), 0);
  std::vector<std::vector<std::uint32_t>> earlier(scene_.size());
  for (std::uint32_t index = 0; index < order_.size(); ++index) {
    const Piece& piece = order_[index];
    std::uint32_t& stage = stages[index];
    if (!earlier[piece.unit].empty()) stage = stages[earlier[piece.unit].back()];
    for (const NeighbourNeed& near : scene_.neighbours(piece.unit))
      for (const std::uint32_t other : earlier[near.unit])
        if (stages[other] >= stage && Meet(piece, order_[other], near.need_mm))
          stage = stages[other] + 1;
    earlier[piece.unit].push_back(index);
  }
  return stages;
}

/// Each stage begins when all pieces of the one before it have ended, and there was time to look.
Status Scheduler::RunInStages(Plan* plan) {
  const std::vector<std::uint32_t> stages = FindStages();
  std::vector<std::uint32_t> sorted(order_.size());
  for (std::uint32_t index = 0; index < order_.size(); ++index) sorted[index] = index;
  std::stable_sort(sorted.begin(), sorted.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return stages[a] < stages[b]; });
  std::int64_t begin = 0;
  std::int64_t end = 0;
  for (std::size_t k = 0; k < sorted.size(); ++k) {
    if (k == 0 || stages[sorted[k]] != stages[sorted[k - 1]]) {
      if (k > 0) begin = After(end);
      plan->stages_s.push_back(static_cast<double>(begin) / kTimerHz);
    }
    FOCALFLEET_TRY(Place(sorted[k], begin));
    end = std::max(end, laid_[order_[sorted[k]].unit].back().end);
  }
  return {};
}

void Scheduler::Collect(Plan* plan) {
  std::sort(waits_.begin(), waits_.end(), [](const Wait& a, const Wait& b) {
    return std::tie(a.earlier, a.later, a.begins) < std::tie(b.earlier, b.later, b.begins);
  });
  std::size_t next = 0;
  for (std::uint32_t i = 0; i < scene_.size(); ++i) {
    std::vector<UnitPlan::Follower> followers;
    for (; next < waits_.size() && waits_[next].earlier == i; ++next) {
      const Wait& wait = waits_[next];
      const double left_s = static_cast<double>(wait.left) / kTimerHz;
      if (!followers.empty() && followers.back().unit.value == wait.later) {
        followers.back().left_s = std::max(followers.back().left_s, left_s);
        continue;
      }
      followers.push_back({{wait.later}, static_cast<double>(wait.begins) / kTimerHz, left_s});
    }
    if (laid_[i].empty()) continue;
    UnitPlan& unit = plans_[i];
    unit.unit = {i};
    unit.mode = drives_[i].mode;
    unit.followers = std::move(followers);
    plan->makespan_s = std::max(plan->makespan_s, EndOf(unit, drives_[i]));
    plan->moves.push_back(std::move(unit));
  }
}

/// The number of parts that a leg is cut into; only legs of one axis are cut. The unit's counts
/// grow by it.
std::int32_t PartsOf(const Piece& piece, const Scene& scene, AxisCounts* counts) {
  const Sweep& sweep = piece.sweep;
  const bool theta = sweep.from[0] != sweep.to[0];
  const bool phi = sweep.from[1] != sweep.to[1];
  if (theta == phi) return 1;
  const std::size_t k = theta ? 0 : 1;
  const double length_deg = std::abs(sweep.to[k] - sweep.from[k]) *
                            scene.arm(piece.unit).step_rad(kAxes[k]) * 180 / std::numbers::pi;
  const auto wanted = static_cast<std::int32_t>(std::ceil(length_deg / kGrainDeg));
  const auto spare =
      static_cast<std::int32_t>(limits::kSegmentsPerAxis) - static_cast<std::int32_t>((*counts)[k]);
  // Half of the spare segments: the way out needs some, too.
  const std::int32_t parts = std::clamp(wanted, 1, 1 + std::max(0, (spare + 1) / 2));
  (*counts)[k] += static_cast<std::uint32_t>(parts - 1);
  return parts;
}

}  // namespace

std::vector<Piece> CutPieces(std::span<const Piece> order, const Scene& scene) {
  std::vector<AxisCounts> counts = CountAll(order, scene.size());
  std::vector<Piece> cut;
  cut.reserve(order.size() * 3);
  for (const Piece& piece : order) {
    const Sweep& sweep = piece.sweep;
    const std::int32_t parts = PartsOf(piece, scene, &counts[piece.unit]);
    Pose at = sweep.from;
    for (std::int32_t part = 1; part <= parts; ++part) {
      Pose next = sweep.to;
      for (std::size_t k = 0; k < kAxisCount; ++k) {
        const std::int64_t way = sweep.to[k] - sweep.from[k];
        next[k] = sweep.from[k] + static_cast<std::int32_t>(way * part / parts);
      }
      if (next != at) cut.push_back({piece.unit, {at, next, sweep.out_of_step}});
      at = next;
    }
  }
  return cut;
}

std::vector<std::uint32_t> UnitsWithTooManyPieces(std::span<const Piece> order, std::size_t units) {
  const std::vector<AxisCounts> counts = CountAll(order, units);
  std::vector<std::uint32_t> too_many;
  for (std::uint32_t i = 0; i < units; ++i)
    if (std::max(counts[i][0], counts[i][1]) > limits::kSegmentsPerAxis) too_many.push_back(i);
  return too_many;
}

Result<Plan> Schedule(std::span<const Piece> order, const Scene& scene,
                      std::span<const UnitDrive> drives, const PlanOptions& options,
                      PowerLedger* ledger) {
  return Scheduler(order, scene, drives, options, ledger).Run();
}

}  // namespace focalfleet
