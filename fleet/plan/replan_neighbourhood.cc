#include "fleet/plan/replan_neighbourhood.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numeric>

#include "protocol/base/instants.h"

namespace focalfleet {
namespace {

constexpr double kNearGuardMm = 1.5e-4;  // of a pair that may be as near as the rule allows
constexpr double kCoverSlackMm = 0.05;   // capsules of a cover may be this much too wide

}  // namespace

std::uint32_t TicksOf(double t_s) { return static_cast<std::uint32_t>(std::llround(t_s / kTickS)); }

ReplanNeighbourhood::ReplanNeighbourhood(const RunningPlan& running, const ReplanQuestion& question)
    : running_(running), scene_(running.scene_), q_(question) {}

const ArmGeometry& ReplanNeighbourhood::arm() const { return scene_.arm(q_.unit.value); }

Status ReplanNeighbourhood::CheckTarget() const {
  const SegmentFp line = arm().At(q_.to);
  const std::string target = "the target of " + running_.NameOf(q_.unit.value);
  std::string text;
  for (const Other& other : others_) {
    const double distance = DistanceMm(line, scene_.arm(other.unit).At(other.ends));
    const double need = scene_.FullNeed(q_.unit.value, other.unit);
    if (distance >= need - kClearToleranceMm) continue;
    std::array<char, 200> words{};
    std::snprintf(words.data(), words.size(),
                  "%s%s and the place where %s ends are %.4f mm apart, %.4f mm needed",
                  text.empty() ? "" : "; ", target.c_str(), running_.NameOf(other.unit).c_str(),
                  distance, need);
    text += words.data();
  }
  std::uint32_t named = q_.unit.value;
  for (const Blocker& thing : standing_) {
    if (thing.by == named) continue;
    if (DistanceMm(line, thing.capsule.line) > thing.capsule.radius_mm + thing.need_mm) continue;
    named = thing.by;
    text += (text.empty() ? "" : "; ") + target + " is not clear of " +
            (named == kNoUnitIndex ? "a fixed obstacle"
                                   : "where " + running_.NameOf(named) + " may stand");
  }
  if (!text.empty()) return Fail(ErrorCode::kInvalid, text);
  return {};
}

Tolerance ReplanNeighbourhood::ToleranceOf(const Other& other, bool with_notice) const {
  Tolerance tolerance = other.tolerance;
  if (!with_notice) tolerance.notice_s = 0;
  return tolerance;
}

/// A pair may stand as near as the rule allows where it starts or ends, as in Scene::AllowFor.
void ReplanNeighbourhood::AllowFor(Other* other, const Pose& starts) const {
  const double least = scene_.FullNeed(q_.unit.value, other->unit) - kClearToleranceMm;
  for (const Pose& mine : {q_.from, q_.to}) {
    for (const Pose& theirs : {starts, other->ends}) {
      const double distance = DistanceMm(arm().At(mine), scene_.arm(other->unit).At(theirs));
      other->need_mm = std::max(least, std::min(other->need_mm, distance - kNearGuardMm));
    }
  }
}

void ReplanNeighbourhood::AddCover(const NeighbourNeed& near, const UnitKnowledge& knowledge) {
  const ArmGeometry& other = scene_.arm(near.unit);
  for (const Capsule& capsule : CoverOf(other, BoxOf(other, knowledge), kCoverSlackMm))
    standing_.push_back({capsule, near.need_mm, near.unit});
}

void ReplanNeighbourhood::AddOther(const NeighbourNeed& near, const Deviation* deviation) {
  const std::uint32_t j = near.unit;
  const ArmGeometry& other_arm = scene_.arm(j);
  Other other;
  other.unit = j;
  other.need_mm = near.need_mm;
  other.skew_s = running_.options_.start_skew_s;
  Pose starts = running_.from_[j];
  if (deviation == nullptr) {
    other.ends = running_.to_[j];
    other.track = Track(other_arm, running_.drives_[j], starts, running_.paths_[j]);
  } else if (deviation->goes) {
    const LateMove& late = *deviation->goes;
    starts = late.move.from;
    other.ends = late.move.to;
    other.skew_s = late.start_skew_s;
    other.track = Track(other_arm, running_.drives_[j], starts,
                        Shifted(late.move.path, TicksOf(late.start_s)));
  } else {
    starts = other.ends = PlaceOf(deviation->stands);
    other.track = Track(other_arm, starts);
  }
  other.tolerance = {(other.skew_s + q_.start_skew_s) / 2, running_.options_.clock_error,
                     running_.options_.notice_s};
  AllowFor(&other, starts);
  others_.push_back(std::move(other));
}

void ReplanNeighbourhood::LookAround(std::span<const Deviation> deviations) {
  std::vector<std::uint32_t> deviating;
  for (const NeighbourNeed& near : scene_.neighbours(q_.unit.value)) {
    const auto it =
        std::find_if(deviations.begin(), deviations.end(),
                     [&](const Deviation& deviation) { return deviation.unit.value == near.unit; });
    const Deviation* deviation = it == deviations.end() ? nullptr : &*it;
    if (deviation != nullptr) deviating.push_back(near.unit);
    const bool is_place = deviation == nullptr
                              ? scene_.is_place(near.unit)
                              : deviation->goes.has_value() || IsPlace(deviation->stands);
    if (is_place)
      AddOther(near, deviation);
    else if (deviation != nullptr)
      AddCover(near, deviation->stands);
  }
  for (const StandingThing& thing : scene_.standing(q_.unit.value)) {
    // A deviation says more about its unit than the scene does.
    if (std::find(deviating.begin(), deviating.end(), thing.by) != deviating.end()) continue;
    double need_mm = thing.need_mm;
    if (thing.by == kNoUnitIndex)
      for (const Pose& pose : {q_.from, q_.to})
        need_mm = std::max(
            thing.least_mm,
            std::min(need_mm, DistanceMm(arm().At(pose), thing.capsule.line) - kNearGuardMm));
    standing_.push_back({thing.capsule, need_mm, thing.by});
  }
  order_.resize(others_.size());
  std::iota(order_.begin(), order_.end(), std::size_t{0});
}

bool ReplanNeighbourhood::IsClear(const Track& track, bool with_notice) {
  for (const Blocker& thing : standing_) {
    if (PassesClearOf(arm(), track, thing.capsule, thing.need_mm)) continue;
    ++things_met_;
    thing_ = thing.by;
    return false;
  }
  for (std::size_t k = 0; k < order_.size(); ++k) {
    Other& other = others_[order_[k]];
    if (PassesClearSince(q_.now_s, arm(), track, scene_.arm(other.unit), other.track, other.need_mm,
                         ToleranceOf(other, with_notice)))
      continue;
    ++other.met;
    std::rotate(order_.begin(), order_.begin() + static_cast<std::ptrdiff_t>(k),
                order_.begin() + static_cast<std::ptrdiff_t>(k) + 1);
    return false;
  }
  return true;
}

double ReplanNeighbourhood::OthersEnd() const {
  double end_s = 0;
  for (const Other& other : others_)
    end_s = std::max(
        end_s, other.track.end_s() + other.tolerance.Slip(other.track.end_s() + Track::kSliceS));
  return end_s;
}

const ReplanNeighbourhood::Other* ReplanNeighbourhood::MostMet() const {
  const auto most = std::max_element(others_.begin(), others_.end(),
                                     [](const Other& a, const Other& b) { return a.met < b.met; });
  return most == others_.end() ? nullptr : &*most;
}

std::uint32_t ReplanNeighbourhood::most_met() const {
  const Other* most = MostMet();
  return most == nullptr ? 0 : most->met;
}

std::string ReplanNeighbourhood::InTheWay() const {
  const std::uint32_t met = most_met();
  if (things_met_ > met)
    return (thing_ == kNoUnitIndex ? "a fixed obstacle"
                                   : "where " + running_.NameOf(thing_) + " may stand") +
           " is in the way";
  return met > 0 ? running_.NameOf(MostMet()->unit) + " is in the way" : "";
}

}  // namespace focalfleet
