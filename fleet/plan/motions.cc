#include "fleet/plan/motions.h"

#include <algorithm>
#include <numeric>

#include "protocol/base/check.h"

namespace focalfleet {

Motions::Motions(const LocalSearchRequest& request)
    : q_(request),
      scene_(*request.scene),
      without_notice_(request.tolerance),
      paths_(scene_.size()),
      tracks_(scene_.size()),
      unnoticed_(scene_.size()),
      weight_(scene_.size()),
      order_(scene_.size()),
      count_(scene_.size(), 0),
      answers_(scene_.size()),
      met_standing_(scene_.size()) {
  without_notice_.notice_s = 0;
  for (std::uint32_t i = 0; i < scene_.size(); ++i) {
    const std::size_t near = scene_.neighbours(i).size();
    weight_[i].assign(near, 1);
    unnoticed_[i].assign(near, 0);
    answers_[i].assign(near, {});
    order_[i].resize(near);
    std::iota(order_[i].begin(), order_[i].end(), 0u);
  }
}

void Motions::Begin(std::uint32_t unit, const AxisPaths& path) {
  ++count_[unit];
  paths_[unit] = path;
  tracks_[unit] = TrackOf(unit, path);
}

void Motions::BeginStanding(std::uint32_t unit) {
  ++count_[unit];
  tracks_[unit] = Track(scene_.arm(unit), q_.from[unit]);
}

void Motions::Replace(std::uint32_t unit, const AxisPaths& paths, Track track) {
  if (q_.ledger != nullptr) {
    q_.ledger->Remove(unit, paths_[unit]);
    FOCALFLEET_CHECK(q_.ledger->Enter(unit, paths));
  }
  if (in_trial_) before_.push_back({unit, std::move(paths_[unit]), std::move(tracks_[unit])});
  ++count_[unit];
  paths_[unit] = paths;
  tracks_[unit] = std::move(track);
}

std::uint32_t Motions::SlotOf(std::uint32_t unit, std::uint32_t other) const {
  const auto near = scene_.neighbours(unit);
  const auto it = std::find_if(near.begin(), near.end(),
                               [&](const NeighbourNeed& n) { return n.unit == other; });
  return static_cast<std::uint32_t>(it - near.begin());
}

bool Motions::Meets(std::uint32_t unit, const Track& track, std::uint32_t slot) const {
  const NeighbourNeed& near = scene_.neighbours(unit)[slot];
  if (!scene_.is_place(near.unit) || tracks_[near.unit].legs().empty()) return false;
  if (IsGiven(unit) && IsGiven(near.unit)) return false;
  const Tolerance& tolerance = ToleranceOf(unit, slot);
  const Track& other = tracks_[near.unit];
  if (!track.moves() && !other.moves()) return false;
  // Near touching, the order of the two arguments may matter: it is always the same.
  return unit < near.unit ? !PassesClear(scene_.arm(unit), track, scene_.arm(near.unit), other,
                                         near.need_mm, tolerance)
                          : !PassesClear(scene_.arm(near.unit), other, scene_.arm(unit), track,
                                         near.need_mm, tolerance);
}

bool Motions::Meet(std::uint32_t unit, std::uint32_t slot) {
  const std::uint32_t other = scene_.neighbours(unit)[slot].unit;
  Answer& answer = answers_[unit][slot];
  if (answer.known && answer.own_count == count_[unit] && answer.other_count == count_[other])
    return answer.meet;
  answer = {count_[unit], count_[other], true, Meets(unit, tracks_[unit], slot)};
  answers_[other][SlotOf(other, unit)] = {count_[other], count_[unit], true, answer.meet};
  return answer.meet;
}

double Motions::Cost(std::uint32_t unit, const Track& track, double limit) {
  // A unit that merely stands was not brought there by this plan.
  if (track.moves() && !scene_.PassesClearOfStanding(unit, track, &met_standing_[unit]))
    return kNever;
  double cost = 0;
  std::vector<std::uint32_t>& order = order_[unit];
  for (std::size_t k = 0; k < order.size(); ++k) {
    const std::uint32_t slot = order[k];
    if (!Meets(unit, track, slot)) continue;
    if (q_.movable[scene_.neighbours(unit)[slot].unit] == 0) return kNever;
    cost += static_cast<double>(weight_[unit][slot]);
    if (k > 0) std::swap(order[k], order[k - 1]);
    if (cost >= limit) return cost;
  }
  return cost;
}

void Motions::AddWeight(std::uint32_t unit, std::uint32_t slot) {
  const std::uint32_t other = scene_.neighbours(unit)[slot].unit;
  weight_[unit][slot] += 1;
  weight_[other][SlotOf(other, unit)] += 1;
}

void Motions::GiveUpNotice(std::uint32_t unit, std::uint32_t slot) {
  unnoticed_[unit][slot] = 1;
  answers_[unit][slot].known = false;
  const std::uint32_t other = scene_.neighbours(unit)[slot].unit;
  unnoticed_[other][SlotOf(other, unit)] = 1;
  answers_[other][SlotOf(other, unit)].known = false;
}

void Motions::BeginTrial() {
  before_.clear();
  unnoticed_before_ = unnoticed_;
  in_trial_ = true;
}

bool Motions::EndTrial() {
  in_trial_ = false;
  const bool clear = std::none_of(before_.begin(), before_.end(),
                                  [&](const Before& made) { return InConflict(made.unit); });
  if (clear) return true;
  for (auto it = before_.rbegin(); it != before_.rend(); ++it) {
    ++count_[it->unit];
    paths_[it->unit] = std::move(it->path);
    tracks_[it->unit] = std::move(it->track);
  }
  unnoticed_ = unnoticed_before_;
  for (std::vector<Answer>& answers : answers_) answers.assign(answers.size(), {});
  return false;
}

void Motions::MoveInto(LocalSearchResult* result) {
  for (std::uint32_t i = 0; i < scene_.size(); ++i)
    for (std::uint32_t slot = 0; slot < unnoticed_[i].size(); ++slot)
      if (const std::uint32_t j = scene_.neighbours(i)[slot].unit;
          unnoticed_[i][slot] != 0 && i < j)
        result->without_notice.emplace_back(i, j);
  result->paths = std::move(paths_);
  result->tracks = std::move(tracks_);
}

bool MeetsForGood(std::uint32_t unit, Motions* motions) {
  const Scene& scene = motions->scene();
  const Track& own = motions->track(unit);
  std::uint32_t met = 0;
  if (own.moves() && !scene.PassesClearOfStanding(unit, own, &met)) return true;
  for (std::uint32_t slot = 0; slot < scene.neighbours(unit).size(); ++slot)
    if (motions->request().movable[scene.neighbours(unit)[slot].unit] == 0 &&
        motions->Meet(unit, slot))
      return true;
  return false;
}

}  // namespace focalfleet
