#include "fleet/plan/soft_search.h"

#include <algorithm>
#include <utility>

namespace focalfleet {
namespace {

/// Where more steps than these meet others, they do not count any more.
constexpr std::int32_t kLevelsMost = 24;

}  // namespace

/// The sets of a level, from its own sets and those of the level below.
void SoftSearch::SpreadLevel(const StepQuestion& question, std::int32_t level, bool all_free) {
  const std::size_t n = grid_.words();
  const std::int32_t steps = question.end_step;
  std::vector<std::uint64_t>& sets = levels_[static_cast<std::size_t>(level)];
  sets.assign(static_cast<std::size_t>(steps + 1) * n, 0);
  sets[grid_.WordOf(grid_.from())] = PoseGrid::BitOf(grid_.from());
  work_ += static_cast<std::uint64_t>(steps) * n;
  for (std::int32_t step = 0; step < steps; ++step) {
    const std::uint64_t* set = Level(level, step);
    const std::uint64_t* free = all_free ? free_.all() : free_.In(step);
    std::uint64_t* next = Level(level, step + 1);
    const bool may_move = question.MayMove(step);
    for (std::size_t i = 0; i < n; ++i) here_[i] = set[i] & free[i];
    if (may_move) {
      grid_.Spread(here_.data(), scratch_.data(), spread_.data());
      for (std::size_t i = 0; i < n; ++i) next[i] = spread_[i] & free[i];
    } else {
      std::copy(here_.begin(), here_.end(), next);
    }
    if (level == 0 || all_free) continue;
    const std::uint64_t* below = Level(level - 1, step);
    if (may_move) {
      grid_.Spread(below, scratch_.data(), spread_.data());
      below = spread_.data();
    }
    const std::uint64_t* all = free_.all();
    for (std::size_t i = 0; i < n; ++i) next[i] |= below[i] & all[i];
  }
}

/// The unit can have been at `before` when the step began, and is at `after` when it ends. `level`
/// becomes that of the former.
bool SoftSearch::CameFrom(const GridPose& before, const GridPose& after, std::int32_t step,
                          std::int32_t* level, bool all_free) {
  if (!grid_.Contains(before)) return false;
  const std::uint64_t* free = all_free ? free_.all() : free_.In(step);
  if (grid_.Has(free, before) && grid_.Has(free, after) && grid_.Has(Level(*level, step), before))
    return true;
  if (all_free || *level == 0 || !grid_.Has(Level(*level - 1, step), before)) return false;
  --*level;
  return true;
}

std::optional<AxisPaths> SoftSearch::Read(const StepQuestion& question, std::int32_t level,
                                          bool all_free) {
  StepPaths paths(*question.drive, question.steps);
  std::vector<Pose> turns(static_cast<std::size_t>(question.end_step));
  GridPose at = grid_.to();
  GridPose last{};  // the step back that was taken latest
  for (std::int32_t step = question.end_step - 1; step >= 0; --step) {
    // A stand first, then the same step back as before.
    std::array<GridPose, 11> back{};
    std::size_t count = 1;
    if (question.MayMove(step)) {
      back[count++] = last;
      for (std::int32_t a = -1; a <= 1; ++a)
        for (std::int32_t b = -1; b <= 1; ++b) back[count++] = {a, b};
    }
    GridPose before{};
    const auto came = std::find_if(back.begin(), back.begin() + count, [&](const GridPose& by) {
      before = {at[0] + by[0], at[1] + by[1]};
      return CameFrom(before, at, step, &level, all_free);
    });
    if (came == back.begin() + count) return std::nullopt;
    const Pose a = grid_.At(before), b = grid_.At(at);
    turns[static_cast<std::size_t>(step)] = {b[0] - a[0], b[1] - a[1]};
    if (*came != GridPose{}) last = *came;
    at = before;
  }
  for (std::size_t step = 0; step < turns.size(); ++step)
    paths.Turn(static_cast<std::int32_t>(step), turns[step]);
  return paths.Take();
}

std::optional<SoftSearch::Found> SoftSearch::Find(const StepQuestion& question) {
  grid_.SetUp(*question.drive, question.steps, question.from, question.to, question.within);
  if (PoseGrid::StepsBetween(grid_.from(), grid_.to()) > question.end_step) return std::nullopt;
  free_.SetUp(question, grid_);
  scratch_.assign(grid_.words(), 0);
  here_.assign(grid_.words(), 0);
  spread_.assign(grid_.words(), 0);
  levels_.resize(kLevelsMost + 1);
  for (std::int32_t level = 0; level <= kLevelsMost; ++level) {
    const bool all_free = level == kLevelsMost;
    SpreadLevel(question, level, all_free);
    if (!grid_.Has(Level(level, question.end_step), grid_.to())) continue;
    std::optional<AxisPaths> paths = Read(question, level, all_free);
    if (!paths) return std::nullopt;
    return Found{*paths, level};
  }
  return std::nullopt;
}

}  // namespace focalfleet
