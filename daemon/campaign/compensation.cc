#include "daemon/campaign/compensation.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "daemon/campaign/campaign_log.h"
#include "fleet/place_inverse.h"
#include "protocol/base/units.h"

namespace focalfleet {
namespace {

using sim::kPhi;
using sim::kTheta;

constexpr double kSameDeg = 1e-6;
constexpr std::size_t kRestsMax = 32;
constexpr std::size_t kRestsKept = 8;  // effects that fade have faded by then

bool IsCompensated(const sim::Template& form) {
  return form.axis != sim::EffectAxis::kNone && sim::IsOfPosesAlone(form);
}

}  // namespace

Compensation::Compensation(const ModelFile& file, const Layout& layout) : units_(layout.size()) {
  const sim::CampaignModel& model = file.model;
  for (std::size_t n = 0; n < units_.size(); ++n) {
    if (!file.left[n]) continue;
    units_[n] = KnownUnit{.geometry = model.units[n],
                          .terms = {},
                          .added_deg = file.left[n]->added_deg,
                          .begin_deg = file.left[n]->pose_deg,
                          .rests_deg = {}};
    for (const sim::ModelTerm& term : model.terms) {
      const std::span<const double> amplitude = term.AmplitudeOf(n);
      if (!amplitude.empty() && IsCompensated(term.form))
        units_[n]->terms.push_back({term.form, {amplitude.begin(), amplitude.end()}});
    }
  }
  for (const sim::ModelTerm& term : model.terms) {
    const std::string cause(term.form.effect->cause);
    if (!IsCompensated(term.form) && std::ranges::find(left_out_, cause) == left_out_.end())
      left_out_.push_back(cause);
  }
}

sim::PoseTrack Compensation::WayOf(const KnownUnit& unit) {
  sim::PoseTrack way(unit.geometry, unit.begin_deg);
  for (const AxisPair& rest : unit.rests_deg) way.Go(rest);
  return way;
}

/// The place of the fibre after the last move of the way.
PointFp Compensation::PlaceAfter(const KnownUnit& unit, sim::PoseTrack* way,
                                 sim::PoseErrors* errors) {
  const sim::UnitTrack& track = way->track();
  errors->Reset(track.moves);
  for (const Term& term : unit.terms)
    term.form.effect->apply(track, term.form, term.amplitude, errors);
  const std::size_t last = track.moves - 1;
  sim::CampaignUnit bent = unit.geometry;
  std::array<double, 2> angle_deg{};
  for (const std::size_t axis : {kTheta, kPhi}) {
    bent.arm_mm[axis] += errors->arm_mm[axis][last];
    angle_deg[axis] =
        track.cmd_deg[axis][last] + errors->angle_deg[axis][last] + unit.added_deg[axis];
  }
  const sim::PlacePoint place = sim::PlaceOf(bent, angle_deg[kTheta], angle_deg[kPhi]);
  return {place.x_mm + errors->x_mm[last], place.y_mm + errors->y_mm[last]};
}

std::optional<AxisAngles> Compensation::CountFor(PositionerIndex i, const Wish& wish) const {
  if (!units_[i.value]) return std::nullopt;
  const KnownUnit& unit = *units_[i.value];
  sim::PoseTrack way = WayOf(unit);
  const AxisPair now{wish.now.theta_deg, wish.now.phi_deg};
  const AxisPair& known = unit.rests_deg.empty() ? unit.begin_deg : unit.rests_deg.back();
  if (std::abs(now[0] - known[0]) > kSameDeg || std::abs(now[1] - known[1]) > kSameDeg) way.Go(now);
  const std::size_t before = way.moves();
  const bool runs_up = wish.last_deg[0] != 0 || wish.last_deg[1] != 0;
  sim::PoseErrors errors;
  const sim::CampaignUnit& arms = unit.geometry;
  const PlaceModel model = [&](const AxisAngles& count) {
    way.Cut(before);
    if (runs_up) way.Go({count.theta_deg - wish.last_deg[0], count.phi_deg - wish.last_deg[1]});
    way.Go({count.theta_deg, count.phi_deg});
    const PointFp fibre = PlaceAfter(unit, &way, &errors);
    const double theta = (count.theta_deg + errors.angle_deg[kTheta].back() +
                          unit.added_deg[kTheta] + arms.zero_deg[kTheta]) *
                         kRadiansPerDegree;
    return SegmentFp{{arms.base_x_mm + arms.arm_mm[kTheta] * std::cos(theta),
                      arms.base_y_mm + arms.arm_mm[kTheta] * std::sin(theta)},
                     fibre};
  };
  return CountAt({.fibre_fp = wish.fibre_fp,
                  .guess = wish.guess,
                  .base_fp = {arms.base_x_mm, arms.base_y_mm},
                  .arm_mm = {arms.arm_mm[kTheta], arms.arm_mm[kPhi]}},
                 model);
}

std::optional<Pose> Compensation::OffsetFor(PositionerIndex i, const Stand& stand,
                                            const Pose& target) const {
  const Pose& offset = stand.offset;
  const auto counted = [&](const Pose& place) {
    return AnglesOf(*stand.unit, *stand.drive, {place[0] - offset[0], place[1] - offset[1]});
  };
  const auto count = CountFor(i, {.fibre_fp = FibreAt(*stand.unit, *stand.drive, target),
                                  .now = counted(stand.place),
                                  .guess = counted(target),
                                  .last_deg = stand.last_deg});
  if (!count) return std::nullopt;
  const double angle_deg[kAxisCount] = {count->theta_deg, count->phi_deg};
  Pose more = target;
  for (const Axis axis : kAxes)
    more[Index(axis)] -= NearestVectors(angle_deg[Index(axis)], stand.unit->axis[Index(axis)],
                                        stand.drive->axis[Index(axis)]);
  return more;
}

std::optional<PointFp> Compensation::FibreAfter(PositionerIndex i, const AxisAngles& count) const {
  if (!units_[i.value]) return std::nullopt;
  sim::PoseTrack way = WayOf(*units_[i.value]);
  way.Go({count.theta_deg, count.phi_deg});
  sim::PoseErrors errors;
  return PlaceAfter(*units_[i.value], &way, &errors);
}

void Compensation::Rests(PositionerIndex i, const AxisAngles& count) {
  if (!units_[i.value]) return;
  KnownUnit& unit = *units_[i.value];
  const AxisPair& known = unit.rests_deg.empty() ? unit.begin_deg : unit.rests_deg.back();
  if (std::abs(count.theta_deg - known[0]) < kSameDeg &&
      std::abs(count.phi_deg - known[1]) < kSameDeg)
    return;
  unit.rests_deg.push_back({count.theta_deg, count.phi_deg});
  if (unit.rests_deg.size() > kRestsMax) Shorten(&unit);
}

/// Replaces the older rests by the sum of their effects.
void Compensation::Shorten(KnownUnit* unit) {
  const std::size_t gone = unit->rests_deg.size() - kRestsKept;
  sim::PoseTrack way = WayOf(*unit);
  way.Cut(gone);
  sim::PoseErrors errors;
  errors.Reset(gone);
  for (const Term& term : unit->terms)
    if (term.form.memory == sim::Memory::kChain)
      term.form.effect->apply(way.track(), term.form, term.amplitude, &errors);
  for (const std::size_t axis : {kTheta, kPhi})
    unit->added_deg[axis] += errors.angle_deg[axis].back();
  unit->begin_deg = unit->rests_deg[gone - 1];
  unit->rests_deg.erase(unit->rests_deg.begin(),
                        unit->rests_deg.begin() + static_cast<std::ptrdiff_t>(gone));
}

std::size_t Compensation::units() const {
  return static_cast<std::size_t>(
      std::ranges::count_if(units_, [](const auto& unit) { return unit.has_value(); }));
}

Result<ModelInForce> ReadModelInForce(std::string_view text, const std::string& file,
                                      const Layout& layout) {
  std::vector<sim::CampaignUnit> units;
  for (const Unit& unit : layout.units()) units.push_back(DescribeUnit(unit));
  FOCALFLEET_TRY_ASSIGN(ModelFile read, ReadModelFile(text, file, units));
  if (read.verdict == "insufficient")
    return Fail(ErrorCode::kInvalid, file + ": its campaign was insufficient for a diagnosis");
  Compensation compensation(read, layout);
  if (compensation.units() == 0)
    return Fail(ErrorCode::kInvalid,
                file + ": it says of no unit of this fleet where its campaign left it");
  return ModelInForce{std::move(read), std::move(compensation)};
}

}  // namespace focalfleet
