#include "fleet/coordinate/sector_round.h"

#include <cmath>
#include <cstdlib>

#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

constexpr double kTimeMaxS = 1e5;  // beyond 24-bit offsets of 100 us: 28 minutes

bool IsTime(double time_s) { return std::isfinite(time_s) && std::abs(time_s) <= kTimeMaxS; }

bool IsMove(const UnitPlan& move, std::size_t units) {
  if (move.unit.value >= units || move.mode > WaveMode::kSevenSegment) return false;
  for (const Axis axis : kAxes) {
    std::int64_t at = move.from[Index(axis)];
    for (const Segment& segment : move.path[Index(axis)].segments()) {
      at += segment.delta;
      if (segment.start_ticks > limits::kOffsetTicksMax || segment.repeat == 0 ||
          std::abs(at) > limits::kPositionMax)
        return false;
    }
    if (at != move.to[Index(axis)]) return false;
  }
  for (const UnitPlan::Follower& follower : move.followers)
    if (follower.unit.value >= units || !IsTime(follower.begins_s) || !IsTime(follower.left_s) ||
        !IsTime(follower.since_s))
      return false;
  return true;
}

}  // namespace

std::string FaultOf(const SectorRound& round, std::size_t units) {
  for (std::size_t n = 0; n < round.moves.size(); ++n) {
    if (!IsMove(round.moves[n], units)) return "a move is none of this sector";
    if (n > 0 && !(round.moves[n - 1].unit < round.moves[n].unit))
      return "moves are not in order, or a unit has two";
  }
  for (std::size_t n = 0; n < round.homing.size(); ++n) {
    if (round.homing[n].value >= units) return "a unit that homes is none of this sector";
    if (n > 0 && !(round.homing[n - 1] < round.homing[n]))
      return "units that home are not in order, or one comes twice";
  }
  if (!round.homing.empty() && !round.moves.empty()) return "it moves and homes";
  for (const SectorRound::Refused& refused : round.refused)
    if (refused.unit.value >= units) return "a refused unit is none of this sector";
  for (const SectorRound::FollowsBeyond& follows : round.follows)
    if (follows.follower.unit.value >= units || !IsTime(follows.follower.begins_s) ||
        !IsTime(follows.follower.left_s) || !IsTime(follows.follower.since_s))
      return "a follower is none of this sector";
  for (const SectorRound::LeadsBeyond& leads : round.leads)
    if (leads.unit.value >= units || !IsTime(leads.since_s) || !IsTime(leads.left_s))
      return "a leader is none of this sector";
  if (!(round.start_skew_s >= 0 && round.start_skew_s <= 1) || !IsTime(round.makespan_s) ||
      !std::isfinite(round.energy_J) || !std::isfinite(round.peak_power_W))
    return "a figure is none";
  if (round.finished && !(round.moves.empty() && round.homing.empty())) return "it ends and moves";
  const bool ends = IsOver(round.end) && round.end <= ConfigurationState::kFailed;
  if (!ends || (!round.finished && round.end != ConfigurationState::kDone))
    return "it ends in a state that is none, or does not end";
  return {};
}

}  // namespace focalfleet
