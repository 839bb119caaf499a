#include <algorithm>
#include <iterator>
#include <utility>

#include "fleet/plan/in_cell_planner.h"
#include "fleet/plan/planner_run.h"
#include "fleet/plan/sequential_planner.h"
#include "fleet/plan/single_unit_feasibility.h"

namespace focalfleet {
namespace {

Piece BackOf(const Piece& piece) {
  return {piece.unit, {piece.sweep.to, piece.sweep.from, piece.sweep.out_of_step}};
}

}  // namespace

/// Makes one whole attempt: in, turn, out. False: stuck_ has the units that found no way.
bool Planner::Attempt(std::vector<Piece>* order) {
  order->clear();
  stuck_.clear();
  movers_.assign(scene_.size(), 0);
  for (std::uint32_t i = 0; i < scene_.size(); ++i)
    movers_[i] =
        service_.is_movable(i) && (service_.goal(i) != start_[i] || aside_[i] != 0) ? 1 : 0;
  std::vector<std::uint8_t> by_cell = movers_;
  for (std::uint32_t i = 0; i < scene_.size(); ++i)
    if (by_itself_[i] != 0) by_cell[i] = 0;
  SequentialPlanner in(&scene_, request_.drives, &surroundings_, start_, by_cell);
  in.Run();
  SequentialPlanner out(&scene_, request_.drives, &surroundings_, service_.goals(), by_cell);
  out.Run();
  stuck_ = in.stuck();
  stuck_.insert(stuck_.end(), out.stuck().begin(), out.stuck().end());
  if (stuck_.empty()) {
    InCellPlanner turn(&scene_, request_.drives, &surroundings_, in.poses(), out.poses());
    turn.Run();
    stuck_ = turn.stuck();
    *order = in.pieces();
    order->insert(order->end(), turn.pieces().begin(), turn.pieces().end());
    std::transform(out.pieces().rbegin(), out.pieces().rend(), std::back_inserter(*order),
                   [](const Piece& piece) { return BackOf(piece); });
    const std::vector<std::uint32_t> too_many = UnitsWithTooManyPieces(*order, scene_.size());
    stuck_.insert(stuck_.end(), too_many.begin(), too_many.end());
  }
  std::sort(stuck_.begin(), stuck_.end());
  stuck_.erase(std::unique(stuck_.begin(), stuck_.end()), stuck_.end());
  return stuck_.empty();
}

bool Planner::LetStepAside(std::uint32_t stuck) {
  bool added = false;
  for (const NeighbourNeed& near : scene_.neighbours(stuck)) {
    const std::uint32_t j = near.unit;
    if (!service_.is_movable(j) || movers_[j] != 0 || aside_[j] != 0 || !scene_.HasCell(j))
      continue;
    if (options_.fixed && !request_.targets[j]) continue;
    aside_[j] = 1;
    added = true;
  }
  return added;
}

void Planner::Abandon(std::uint32_t unit, std::optional<NoWay> proof) {
  if (service_.goes(unit)) {
    if (hopeful_[unit] != 0) stuck_for_order_.push_back(unit);
    service_.Unserve(unit, UnservedWhy::kBlocked, InTheWayOf(service_, unit), std::move(proof));
  } else
    service_.Hold(unit);
  aside_[unit] = 0;
  by_itself_[unit] = 0;
}

/// Gives up stuck units that no order of moves can help. True: there was one.
bool Planner::AbandonHopeless() {
  bool any = false;
  for (const std::uint32_t i : stuck_) {
    if (IsAbandoned(options_.abandoned)) return any;
    if (hopeful_[i] != 0) continue;
    std::optional<NoWay> proof;
    if (CanEver(service_, i, &surroundings_, &proof)) {
      hopeful_[i] = 1;
      continue;
    }
    Abandon(i, std::move(proof));
    any = true;
  }
  return any;
}

/// Changes the request after a failed attempt. Units with no way at all are given up at once.
/// Standing units may then be moved aside. Where none is left, the stuck unit goes in one way by
/// itself. Where that has failed too, a unit near it, or the stuck unit, is given up and stays.
void Planner::GiveWay() {
  if (AbandonHopeless()) return;
  bool added = false;
  for (const std::uint32_t i : stuck_) added = LetStepAside(i) || added;
  if (added) return;
  // Only one unit of each cluster changes at a time: after its change the others may find a way.
  std::vector<std::uint8_t> changed(scene_.size(), 0);
  for (const std::uint32_t i : stuck_) {
    const auto near = scene_.neighbours(i);
    const auto is_changed = [&](const NeighbourNeed& n) { return changed[n.unit] != 0; };
    if (changed[i] != 0 || std::any_of(near.begin(), near.end(), is_changed)) continue;
    const auto alone = std::find_if(
        near.begin(), near.end(), [&](const NeighbourNeed& n) { return by_itself_[n.unit] != 0; });
    const std::uint32_t which = by_itself_[i] != 0 || alone == near.end() ? i : alone->unit;
    changed[which] = 1;
    if (by_itself_[which] != 0 || service_.goal(which) == start_[which])
      Abandon(which);
    else
      by_itself_[which] = 1;
  }
}

}  // namespace focalfleet
