#include "fleet/plan/unit_ways.h"

#include <algorithm>
#include <optional>
#include <utility>

namespace focalfleet {
namespace {

/// The search in time is quick and coarse for so many attempts of a unit, then thorough.
constexpr int kQuickAttempts = 3;
constexpr std::uint32_t kQuickExpansions = 500;  // nodes of a search
constexpr std::uint32_t kThoroughExpansions = 4000;
constexpr double kCoarseGridDeg = 6;  // quick attempts use this grid alone
constexpr double kFineGridDeg = 3;

}  // namespace

CandidateQuestion UnitWays::QuestionFor(std::uint32_t unit, double within_s) const {
  return {.scene = &motions_.scene(),
          .drive = &q_.drives[unit],
          .unit = unit,
          .from = q_.from[unit],
          .to = q_.to[unit],
          .within_s = within_s,
          .round = {}};
}

std::vector<Candidate> UnitWays::All(std::uint32_t unit, double within_s) const {
  std::vector<Candidate> ways;
  CandidateQuestion question = QuestionFor(unit, within_s);
  for (const CandidateRound& round : kCandidateRounds) {
    question.round = round;
    AppendCandidates(question, &ways);
  }
  std::erase_if(ways, [&](const Candidate& way) { return way.end_s > within_s; });
  return ways;
}

std::vector<Candidate> UnitWays::ViaCell(std::uint32_t unit, std::uint32_t other, double within_s) {
  const Scene& scene = motions_.scene();
  std::vector<Candidate> ways;
  if (!scene.HasCell(unit)) return ways;
  PoseBox cell = scene.arm(unit).range();
  cell.low[1] = std::max(cell.low[1], scene.cell(unit).low);
  cell.high[1] = std::min(cell.high[1], scene.cell(unit).high);
  if (cell.low[1] > cell.high[1]) return ways;
  const Way in = AmongStanding(unit, q_.from[unit], cell, other, q_.from);
  const Way& out = AmongStanding(unit, q_.to[unit], cell, other, q_.to);
  AppendVia(QuestionFor(unit, within_s), in, out, &ways);
  std::erase_if(ways, [&](const Candidate& way) { return way.end_s > within_s; });
  return ways;
}

const Way& UnitWays::AmongStanding(std::uint32_t unit, const Pose& from, const PoseBox& goal,
                                   std::uint32_t other, std::span<const Pose> poses) {
  std::vector<KnownWay>& ways = known_ways_[unit];
  const auto known = std::ranges::find_if(ways, [&](const KnownWay& way) {
    return way.other == other && way.poses == poses.data() && way.from == from && way.goal == goal;
  });
  if (known != ways.end()) return known->way;
  Way way = FindAmongStanding(unit, from, goal, other, poses);
  return ways.emplace_back(other, poses.data(), from, goal, std::move(way)).way;
}

Way UnitWays::FindAmongStanding(std::uint32_t unit, const Pose& from, const PoseBox& goal,
                                std::uint32_t other, std::span<const Pose> poses) {
  const Scene& scene = motions_.scene();
  blockers_.clear();
  for (const NeighbourNeed& near : scene.neighbours(unit)) {
    if (!scene.is_place(near.unit)) continue;
    if ((q_.movable[near.unit] != 0 && near.unit != other) || motions_.IsGiven(near.unit)) continue;
    const SegmentFp line = scene.arm(near.unit).At(poses[near.unit]);
    blockers_.push_back({{line, 0}, near.need_mm, near.unit});
  }
  for (const StandingThing& thing : scene.standing(unit))
    blockers_.push_back({thing.capsule, thing.need_mm, thing.by});
  PathSearch::Question question;
  question.arm = &scene.arm(unit);
  question.drive = &q_.drives[unit];
  question.blockers = blockers_;
  question.from = from;
  question.within = RangeAround(*question.arm, from);
  question.goal = goal;
  for (const double grid_deg : kSearchGridsDeg) {
    question.grid_deg = grid_deg;
    Way way = path_search_.Find(question);
    if (!way.empty()) return way;
  }
  return {};
}

double UnitWays::Cheapest(std::uint32_t unit, double within_s,
                          std::span<const Candidate> candidates, std::size_t first,
                          std::size_t* chosen) {
  double best = Motions::kNever;
  int ties = 0;
  for (std::size_t c = first; c < candidates.size() && best > 0; ++c) {
    const Candidate& candidate = candidates[c];
    if (candidate.end_s > std::min(within_s, kOffsetMaxS)) continue;
    const Track track = motions_.TrackOf(unit, candidate.path);
    const double limit = best == Motions::kNever ? best : best + 1e-9;
    const double cost = motions_.Cost(unit, track, limit);
    if (cost > best || cost == Motions::kNever) continue;
    if (!motions_.KeepsLimits(unit, candidate.path)) continue;
    ties = cost < best ? 1 : ties + 1;
    if (cost == best && rng_.Below(static_cast<std::uint64_t>(ties)) != 0) continue;
    best = cost;
    *chosen = c;
  }
  return best;
}

bool UnitWays::TakeFirstClear(std::uint32_t unit, std::vector<Candidate>* ways) {
  for (std::size_t k = 0; k < ways->size(); ++k) {
    const Candidate& way = (*ways)[k];
    Track track = motions_.TrackOf(unit, way.path);
    if (motions_.Cost(unit, track, 1) >= 1 || !motions_.KeepsLimits(unit, way.path)) continue;
    motions_.Replace(unit, way.path, std::move(track));
    ways->erase(ways->begin(), ways->begin() + static_cast<std::ptrdiff_t>(k) + 1);
    return true;
  }
  ways->clear();
  return false;
}

bool UnitWays::TakeBySearchInTime(std::uint32_t unit, double end_s, int attempts) {
  const Scene& scene = motions_.scene();
  moving_.clear();
  for (std::uint32_t slot = 0; slot < scene.neighbours(unit).size(); ++slot) {
    const NeighbourNeed& near = scene.neighbours(unit)[slot];
    if (scene.is_place(near.unit))
      moving_.push_back({&scene.arm(near.unit), &motions_.track(near.unit), near.need_mm,
                         motions_.ToleranceOf(unit, slot)});
  }
  blockers_.clear();
  for (const StandingThing& thing : scene.standing(unit))
    blockers_.push_back({thing.capsule, thing.need_mm, thing.by});
  const ArmGeometry& arm = scene.arm(unit);
  TimeSearch::Question question{.arm = &arm,
                                .drive = &q_.drives[unit],
                                .moving = moving_,
                                .standing = blockers_,
                                .from = q_.from[unit],
                                .to = q_.to[unit],
                                .within = RangeAround(arm, q_.from[unit]),
                                .end_s = end_s};
  const bool quick = attempts < kQuickAttempts;
  for (const double grid_deg : {kCoarseGridDeg, kFineGridDeg}) {
    if (grid_deg < kCoarseGridDeg && quick) break;
    question.grid_deg = grid_deg;
    question.expansions_max = quick ? kQuickExpansions : kThoroughExpansions;
    const std::optional<AxisPaths> paths = time_search_.Find(question);
    if (!paths) continue;
    Track track = motions_.TrackOf(unit, *paths);
    if (motions_.Cost(unit, track, 1) >= 1) continue;
    if (!motions_.KeepsLimits(unit, *paths)) continue;
    motions_.Replace(unit, *paths, std::move(track));
    return true;
  }
  return false;
}

}  // namespace focalfleet
