#include "fleet/plan/soft_search.h"

#include <algorithm>
#include <utility>

namespace focalfleet {
namespace {

/// Where more steps than these meet others, they do not count any more.
constexpr std::int32_t kLevelsMost = 24;

}  // namespace

/// The sets of a level, from its own sets and those of the level below.
void SoftSearch::SpreadLevel(const View& view, std::int32_t level, bool all_free) {
  const std::size_t n = grid_.words();
  const std::int32_t steps = view.q->end_step;
  std::vector<std::uint64_t>& sets = levels_[static_cast<std::size_t>(level)];
  sets.assign(static_cast<std::size_t>(steps + 1) * n, 0);
  const GridPose& begin = view.late ? grid_.to() : grid_.from();
  sets[grid_.WordOf(begin)] = PoseGrid::BitOf(begin);
  work_ += static_cast<std::uint64_t>(steps) * n;
  for (std::int32_t k = 0; k < steps; ++k) {
    const std::int32_t step = view.StepAt(k);
    const std::uint64_t* set = Level(level, k);
    const std::uint64_t* free = all_free ? free_.all() : free_.In(step);
    std::uint64_t* next = Level(level, k + 1);
    const bool may_move = view.q->MayMove(step);
    for (std::size_t i = 0; i < n; ++i) here_[i] = set[i] & free[i];
    if (may_move) {
      grid_.Spread(here_.data(), scratch_.data(), spread_.data());
      for (std::size_t i = 0; i < n; ++i) next[i] = spread_[i] & free[i];
    } else {
      std::copy(here_.begin(), here_.end(), next);
    }
    if (level == 0 || all_free) continue;
    const std::uint64_t* below = Level(level - 1, k);
    if (may_move) {
      grid_.Spread(below, scratch_.data(), spread_.data());
      below = spread_.data();
    }
    const std::uint64_t* all = free_.all();
    for (std::size_t i = 0; i < n; ++i) next[i] |= below[i] & all[i];
  }
}

/// The unit can have been at `before` when step k of the view began, and is at `after` when it
/// ends. `level` becomes that of the former.
bool SoftSearch::CameFrom(const View& view, const GridPose& before, const GridPose& after,
                          std::int32_t k, std::int32_t* level, bool all_free) {
  if (!grid_.Contains(before)) return false;
  const std::uint64_t* free = all_free ? free_.all() : free_.In(view.StepAt(k));
  if (grid_.Has(free, before) && grid_.Has(free, after) && grid_.Has(Level(*level, k), before))
    return true;
  if (all_free || *level == 0 || !grid_.Has(Level(*level - 1, k), before)) return false;
  --*level;
  return true;
}

std::optional<AxisPaths> SoftSearch::Read(const View& view, std::int32_t level, bool all_free) {
  const StepQuestion& q = *view.q;
  std::vector<GridPose> way(static_cast<std::size_t>(q.end_step) + 1);
  GridPose at = view.late ? grid_.from() : grid_.to();
  GridPose last{};  // its latest turn
  for (std::int32_t k = q.end_step; k > 0; --k) {
    way[static_cast<std::size_t>(k)] = at;
    std::array<GridPose, 11> turns{};
    std::size_t count = 1;
    if (q.MayMove(view.StepAt(k - 1))) {
      turns[count++] = last;
      for (std::int32_t a = -1; a <= 1; ++a)
        for (std::int32_t b = -1; b <= 1; ++b) turns[count++] = {a, b};
    }
    // A stand first, then the same turn as before.
    std::size_t chosen = 0;
    GridPose before{};
    for (; chosen < count; ++chosen) {
      before = {at[0] + turns[chosen][0], at[1] + turns[chosen][1]};
      if (CameFrom(view, before, at, k - 1, &level, all_free)) break;
    }
    if (turns[chosen] != GridPose{}) last = turns[chosen];
    at = before;
  }
  way[0] = at;
  if (view.late) std::reverse(way.begin(), way.end());
  StepPaths paths(*q.drive, q.steps);
  for (std::size_t s = 0; s + 1 < way.size(); ++s) {
    const Pose a = grid_.At(way[s]);
    const Pose b = grid_.At(way[s + 1]);
    paths.Turn(static_cast<std::int32_t>(s), {b[0] - a[0], b[1] - a[1]});
  }
  return paths.Take();
}

std::optional<SoftSearch::Found> SoftSearch::Find(const StepQuestion& question, bool late) {
  grid_.SetUp(*question.drive, question.steps, question.from, question.to, question.within);
  if (PoseGrid::StepsBetween(grid_.from(), grid_.to()) > question.end_step) return std::nullopt;
  free_.SetUp(question, grid_);
  scratch_.assign(grid_.words(), 0);
  here_.assign(grid_.words(), 0);
  spread_.assign(grid_.words(), 0);
  levels_.resize(kLevelsMost + 1);
  const View view{&question, late};
  const GridPose& end = late ? grid_.from() : grid_.to();
  for (std::int32_t level = 0; level <= kLevelsMost; ++level) {
    const bool all_free = level == kLevelsMost;
    SpreadLevel(view, level, all_free);
    if (!grid_.Has(Level(level, question.end_step), end)) continue;
    std::optional<AxisPaths> paths = Read(view, level, all_free);
    if (!paths) return std::nullopt;
    return Found{*paths, level};
  }
  return std::nullopt;
}

}  // namespace focalfleet
