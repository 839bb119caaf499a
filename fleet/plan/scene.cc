#include "fleet/plan/scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace focalfleet {
namespace {

/// The guard covers the rounding of the sums that decide, thousands of times over. The guard is
/// added to what the rule asks.
constexpr double kGuardMm = 2e-4;
/// A pair that starts or ends nearer than planned is planned this much nearer still, so that
/// leaving is clear.
constexpr double kStartSlackMm = 1.5e-4;
constexpr std::size_t kCoverMax = 400;  // capsules of one cover

double BaseDistance(const ArmGeometry& a, const ArmGeometry& b) {
  return std::hypot(a.base_fp().x_mm - b.base_fp().x_mm, a.base_fp().y_mm - b.base_fp().y_mm);
}

/// The least disc around the base that holds the arm, folded back as far as it goes.
double FoldedRadius(const ArmGeometry& arm) {
  const double low = arm.Fold(arm.range().low[1]);
  const double high = arm.Fold(arm.range().high[1]);
  const double half_turn = std::numbers::pi;
  double cosine = std::min(std::cos(low), std::cos(high));
  const double odd = std::ceil((low - half_turn) / (2 * half_turn)) * 2 * half_turn + half_turn;
  if (odd <= high) cosine = -1;
  const double l1 = arm.theta_arm_mm();
  const double l2 = arm.phi_arm_mm();
  const double fibre = std::sqrt(std::max(0.0, l1 * l1 + l2 * l2 + 2 * l1 * l2 * cosine));
  return std::max(l1, fibre);
}

PhiSpan PhiWithin(const ArmGeometry& arm, double radius_mm) {
  const double l1 = arm.theta_arm_mm();
  const double l2 = arm.phi_arm_mm();
  const double cosine = (radius_mm * radius_mm - l1 * l1 - l2 * l2) / (2 * l1 * l2);
  PhiSpan span{arm.range().low[1], arm.range().high[1]};
  if (cosine >= 1) return span;
  const double opening = std::acos(std::max(cosine, -1.0));
  const double step = arm.step_rad(Axis::kPhi);
  const double low = std::ceil((opening - arm.phi_zero_rad()) / step);
  const double high = std::floor((2 * std::numbers::pi - opening - arm.phi_zero_rad()) / step);
  span.low = std::max(span.low, static_cast<std::int32_t>(low));
  span.high = std::min(span.high, static_cast<std::int32_t>(high));
  // The arc cosine rounds, so the radius decides.
  while (span.low <= span.high && arm.FibreRadiusMax(span.low, span.low) > radius_mm) ++span.low;
  while (span.low <= span.high && arm.FibreRadiusMax(span.high, span.high) > radius_mm) --span.high;
  return span;
}

}  // namespace

PoseBox BoxOf(const ArmGeometry& arm, const UnitKnowledge& knowledge) {
  PoseBox box = arm.range();
  for (std::size_t k = 0; k < kAxisCount; ++k) {
    if (knowledge[k].witness == Witness::kUnknown) continue;
    box.low[k] = knowledge[k].low;
    box.high[k] = knowledge[k].high;
  }
  return box;
}

std::vector<Capsule> CoverOf(const ArmGeometry& arm, const PoseBox& box, double slack_mm) {
  // Theta may be anywhere: the arm takes a disc, exactly. An arm of another that stands within its
  // hole, if it has one, would cross the ring around it.
  const double turns = (static_cast<double>(box.high[0]) - box.low[0]) * arm.step_rad(Axis::kTheta);
  if (turns >= 2 * std::numbers::pi) {
    const double fibre_mm = arm.FibreRadiusMax(box.low[1], box.high[1]);
    return {{{arm.base_fp(), arm.base_fp()}, std::max(arm.theta_arm_mm(), fibre_mm)}};
  }
  const double theta_half = (static_cast<double>(box.high[0]) - box.low[0]) / 2;
  const double phi_half = (static_cast<double>(box.high[1]) - box.low[1]) / 2;
  std::array<std::int32_t, kAxisCount> parts{1, 1};
  const auto slack = [&] { return arm.TravelBound(theta_half / parts[0], phi_half / parts[1]); };
  while (slack() > slack_mm) {
    const bool theta =
        arm.TravelBound(theta_half / parts[0], 0) > arm.TravelBound(0, phi_half / parts[1]);
    ++parts[theta ? 0 : 1];
    if (static_cast<std::size_t>(parts[0]) * static_cast<std::size_t>(parts[1]) > kCoverMax) break;
  }
  std::vector<Capsule> cover;
  cover.reserve(static_cast<std::size_t>(parts[0]) * static_cast<std::size_t>(parts[1]));
  for (std::int32_t a = 0; a < parts[0]; ++a) {
    for (std::int32_t b = 0; b < parts[1]; ++b) {
      // The middle of a part need not be whole vectors: the cover takes the nearest whole pose and
      // one vector more.
      const Pose middle{
          static_cast<std::int32_t>(std::lround(box.low[0] + theta_half * (2 * a + 1) / parts[0])),
          static_cast<std::int32_t>(std::lround(box.low[1] + phi_half * (2 * b + 1) / parts[1]))};
      const double rounding = box.low == box.high ? 0 : arm.TravelBound(1, 1);
      cover.push_back({arm.At(middle), slack() + rounding});
    }
  }
  return cover;
}

Scene::Scene(const Layout& layout, std::span<const UnitDrive> drives,
             std::span<const UnitKnowledge> start, std::span<const Pose> offsets)
    : layout_(&layout) {
  const std::size_t n = layout.size();
  arms_.reserve(n);
  is_place_.resize(n);
  needs_begin_.reserve(n + 1);
  needs_begin_.push_back(0);
  for (std::uint32_t i = 0; i < n; ++i) {
    arms_.emplace_back(layout.unit({i}), drives[i]);
    if (!offsets.empty()) arms_.back().ShiftRange(offsets[i]);
    is_place_[i] = IsPlace(start[i]) ? 1 : 0;
  }
  for (std::uint32_t i = 0; i < n; ++i) {
    for (const PositionerIndex j : layout.neighbours({i})) {
      const double need_mm = FullNeed(i, j.value) + kGuardMm;
      needs_.push_back({j.value, need_mm, need_mm});
    }
    needs_begin_.push_back(static_cast<std::uint32_t>(needs_.size()));
  }
  FindCells();
  FindStanding(start);
}

void Scene::FindCells() {
  const std::size_t n = size();
  std::vector<double> radius_mm(n);
  std::vector<double> least(n);
  const auto room = [&](std::uint32_t i, const NeighbourNeed& near) {
    return BaseDistance(arms_[i], arms_[near.unit]) - near.need_mm;
  };
  for (std::uint32_t i = 0; i < n; ++i) {
    least[i] = FoldedRadius(arms_[i]) + kGuardMm;
    double radius = arms_[i].theta_arm_mm() + arms_[i].phi_arm_mm();
    for (const NeighbourNeed& near : neighbours(i)) {
      const double wider = arms_[near.unit].half_width_mm() - arms_[i].half_width_mm();
      const double equal_discs = (room(i, near) + wider) / 2;
      radius = std::min(radius, equal_discs);
    }
    radius_mm[i] = radius;
  }
  const std::vector<double> equal = radius_mm;
  for (std::uint32_t i = 0; i < n; ++i) {
    if (equal[i] >= least[i]) continue;
    radius_mm[i] = least[i];
    for (const NeighbourNeed& near : neighbours(i))
      radius_mm[near.unit] = std::min(radius_mm[near.unit], room(i, near) - least[i]);
  }
  cells_.resize(n);
  for (std::uint32_t i = 0; i < n; ++i)
    if (radius_mm[i] >= least[i]) cells_[i] = PhiWithin(arms_[i], radius_mm[i]);
}

void Scene::FindStanding(std::span<const UnitKnowledge> start) {
  constexpr double kCoverSlackMm = 0.05;
  std::vector<std::vector<Capsule>> covers(size());
  for (std::uint32_t i = 0; i < size(); ++i)
    if (is_place_[i] == 0) covers[i] = CoverOf(arms_[i], BoxOf(arms_[i], start[i]), kCoverSlackMm);
  standing_begin_.push_back(0);
  for (std::uint32_t i = 0; i < size(); ++i) {
    const ArmGeometry& arm = arms_[i];
    const double reach = arm.theta_arm_mm() + arm.phi_arm_mm();
    for (const Obstacle& obstacle : layout_->obstacles()) {
      const double need =
          arm.half_width_mm() + obstacle.radius_mm + layout_->clearance_mm() + kGuardMm;
      const PointFp& c = obstacle.centre_fp;
      if (DistanceMm(arm.base_fp(), c) > reach + need) continue;
      const double least = need - kGuardMm - kClearToleranceMm;
      standing_.push_back({{{c, c}, 0}, need, least, kNoUnitIndex, false});
    }
    for (const NeighbourNeed& near : neighbours(i)) {
      if (is_place_[near.unit] != 0) continue;
      const bool in_cell = InCell(near.unit, BoxOf(arms_[near.unit], start[near.unit]));
      for (const Capsule& capsule : covers[near.unit]) {
        if (DistanceMm(arm.base_fp(), capsule.line) > reach + near.need_mm + capsule.radius_mm)
          continue;
        standing_.push_back({capsule, near.need_mm, near.need_mm, near.unit, in_cell});
      }
    }
    standing_begin_.push_back(static_cast<std::uint32_t>(standing_.size()));
  }
  bundles_.resize(size());
  for (std::uint32_t i = 0; i < size(); ++i) BundleUp(standing(i), &bundles_[i]);
}

bool Scene::PassesClearOfStanding(std::uint32_t unit, const Track& track,
                                  std::uint32_t* met) const {
  constexpr int kFewDistances = 16;  // a bundle that is not soon found clear is opened
  const ArmGeometry& arm = arms_[unit];
  const std::span<const StandingThing> things = standing(unit);
  const auto clear_of = [&](std::uint32_t k) {
    return PassesClearOf(arm, track, things[k].capsule, things[k].need_mm);
  };
  if (*met < things.size() && !clear_of(*met)) return false;
  for (const Bundle& bundle : bundles_[unit]) {
    if (bundle.has_several() && PassesClearOf(arm, track, bundle.around, 0, kFewDistances))
      continue;
    for (std::uint32_t k = bundle.begin; k < bundle.end; ++k) {
      if (clear_of(k)) continue;
      *met = k;
      return false;
    }
  }
  return true;
}

void Scene::AllowFor(std::span<const Pose> poses) {
  for (std::uint32_t i = 0; i < size(); ++i) {
    if (is_place_[i] == 0) continue;
    const SegmentFp line = arms_[i].At(poses[i]);
    for (std::uint32_t k = needs_begin_[i]; k < needs_begin_[i + 1]; ++k) {
      NeighbourNeed& near = needs_[k];
      if (is_place_[near.unit] == 0) continue;
      const double least = FullNeed(i, near.unit) - kClearToleranceMm;
      const double distance = DistanceMm(line, arms_[near.unit].At(poses[near.unit]));
      near.need_mm = std::max(least, std::min(near.need_mm, distance - kStartSlackMm));
      near.at_start_mm = std::min(near.at_start_mm, near.need_mm);
    }
    for (std::uint32_t k = standing_begin_[i]; k < standing_begin_[i + 1]; ++k) {
      StandingThing& thing = standing_[k];
      if (thing.by != kNoUnitIndex) continue;
      const double distance = DistanceMm(line, thing.capsule.line);
      thing.need_mm = std::max(thing.least_mm, std::min(thing.need_mm, distance - kStartSlackMm));
    }
  }
}

void Scene::LeadApart(std::span<const Pose> poses) {
  // Arms nearer than this may have crossed: the direction apart is then not known.
  constexpr double kCrossedMm = 0.2;
  for (std::uint32_t i = 0; i < size(); ++i) {
    if (is_place_[i] == 0) continue;
    const SegmentFp line = arms_[i].At(poses[i]);
    for (std::uint32_t k = needs_begin_[i]; k < needs_begin_[i + 1]; ++k) {
      NeighbourNeed& near = needs_[k];
      if (is_place_[near.unit] == 0) continue;
      const double distance = DistanceMm(line, arms_[near.unit].At(poses[near.unit]));
      if (distance > kCrossedMm)
        near.at_start_mm = std::min(near.at_start_mm, distance - kStartSlackMm);
    }
  }
}

void Scene::LeadApartThroughout(std::span<const Pose> poses) {
  LeadApart(poses);
  for (NeighbourNeed& near : needs_) near.need_mm = std::min(near.need_mm, near.at_start_mm);
}

}  // namespace focalfleet
