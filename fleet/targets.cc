#include "fleet/targets.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <unordered_map>

#include "fleet/files/bad_rows.h"
#include "fleet/files/place.h"
#include "fleet/geometry/clearance.h"
#include "fleet/kinematics.h"
#include "fleet/side_choice.h"
#include "protocol/base/check.h"

namespace focalfleet {
namespace {

std::string Number(double value) {
  char text[40];
  std::snprintf(text, sizeof text, std::abs(value) < 1e9 ? "%.4f" : "%g", value);
  return text;
}

std::string At(const Targets& targets, const TargetRow& row) {
  return PlaceIn(targets.source, row.line) + ": unit " + std::to_string(row.unit.value);
}

std::string RangeText(const AxisGeometry& axis) {
  return Number(axis.min_deg) + ".." + Number(axis.max_deg) + " deg";
}

// The known place of a unit; folded where no place is known.
AxisAngles StandsAt(const Unit& unit, const UnitDrive& drive, const UnitKnowledge* known) {
  AxisAngles angles{(unit.theta().min_deg + unit.theta().max_deg) / 2, 180 - unit.phi().zero_deg};
  if (known == nullptr) return angles;
  const auto middle = [&](Axis axis, double otherwise_deg) {
    const AxisKnowledge& k = (*known)[Index(axis)];
    if (k.witness == Witness::kUnknown) return otherwise_deg;
    const double step = DegreesPerVector(unit.axis[Index(axis)], drive.axis[Index(axis)]);
    return (static_cast<double>(k.low) + static_cast<double>(k.high)) / 2 * step;
  };
  return {middle(Axis::kTheta, angles.theta_deg), middle(Axis::kPhi, angles.phi_deg)};
}

// Both axes turn at once, so the way is as long as the slower axis takes.
struct Way {
  double longest_s = 0;
  double sum_s = 0;
};
Way WayTo(const Unit& unit, const UnitDrive& drive, const AxisAngles& from, const AxisAngles& to) {
  const auto seconds = [&](Axis axis, double degrees) {
    const std::size_t k = Index(axis);
    return std::abs(degrees) / DegreesPerVector(unit.axis[k], drive.axis[k]) *
           SecondsPerVector(drive.axis[k]);
  };
  const double theta_s = seconds(Axis::kTheta, to.theta_deg - from.theta_deg);
  const double phi_s = seconds(Axis::kPhi, to.phi_deg - from.phi_deg);
  return {std::max(theta_s, phi_s), theta_s + phi_s};
}

struct Wrong {
  std::string text;
  const char* kind;
};
using Solutions = tl::expected<std::vector<AxisAngles>, Wrong>;
tl::unexpected<Wrong> Not(const char* kind, std::string text) {
  return tl::unexpected<Wrong>(Wrong{std::move(text), kind});
}

constexpr const char* kNotFinite = "not finite";
constexpr const char* kOutOfRange = "out of range";

Solutions SolutionsFor(const TargetAngles& target, const Unit& unit) {
  if (!std::isfinite(target.theta_deg) || !std::isfinite(target.phi_deg))
    return Not(kNotFinite, "the target's angles are not finite numbers");
  for (const Axis axis : kAxes) {
    const double angle_deg = axis == Axis::kTheta ? target.theta_deg : target.phi_deg;
    if (std::abs(angle_deg) > kAngleMaxDeg)
      return Not(kOutOfRange, std::string(Name(axis)) + "_deg " + Number(angle_deg) +
                                  " is not an angle within " +
                                  std::to_string(static_cast<int>(kAngleMaxDeg)));
  }
  if (target.phi_deg < unit.phi().min_deg || target.phi_deg > unit.phi().max_deg)
    return Not(kOutOfRange, "phi_deg " + Number(target.phi_deg) + " is out of its range " +
                                RangeText(unit.phi()));
  std::vector<AxisAngles> solutions;
  for (const double theta_deg : TurnsInRange(target.theta_deg, unit.theta()))
    solutions.push_back({theta_deg, target.phi_deg});
  if (solutions.empty())
    return Not(kOutOfRange, "theta_deg " + Number(target.theta_deg) +
                                ", whole turns added, is out of its range " +
                                RangeText(unit.theta()));
  return solutions;
}

Solutions SolutionsFor(PointFp target, const Unit& unit, double free_theta_deg) {
  if (!std::isfinite(target.x_mm) || !std::isfinite(target.y_mm))
    return Not(kNotFinite, "the target's place is not two finite numbers");
  std::vector<AxisAngles> solutions = AnglesFor(unit, target, free_theta_deg);
  if (!solutions.empty()) return solutions;
  const PatrolLimits patrol = PatrolOf(unit);
  const double distance = DistanceMm(target, unit.base_fp);
  const std::string where = "x_mm " + Number(target.x_mm) + ", y_mm " + Number(target.y_mm) +
                            " is " + Number(distance) + " mm from its base ";
  if (distance < patrol.min_mm || distance > patrol.max_mm)
    return Not("out of patrol", where + "(out of patrol, its fibre reaches " +
                                    Number(patrol.min_mm) + ".." + Number(patrol.max_mm) + " mm)");
  return Not(kOutOfRange, where + "in a direction out of range (theta " + RangeText(unit.theta()) +
                              ", phi " + RangeText(unit.phi()) + ")");
}

PoseChoice NearestFirst(const Unit& unit, const UnitDrive& drive, const AxisAngles& from,
                        std::vector<AxisAngles> solutions) {
  std::stable_sort(solutions.begin(), solutions.end(), [&](const auto& a, const auto& b) {
    const Way way_a = WayTo(unit, drive, from, a);
    const Way way_b = WayTo(unit, drive, from, b);
    return way_a.longest_s != way_b.longest_s ? way_a.longest_s < way_b.longest_s
                                              : way_a.sum_s < way_b.sum_s;
  });
  PoseChoice choice;
  for (const AxisAngles& s : solutions)
    choice.push_back({NearestInRange(s.theta_deg, unit.theta(), drive.axis[0]),
                      NearestInRange(s.phi_deg, unit.phi(), drive.axis[1])});
  return choice;
}

// A row without a fault of its own.
struct Resolved {
  PositionerIndex unit;
  const TargetRow* row = nullptr;
};

// Two fibres requested where their arms touch are the author's error, so all such pairs are named
// with the author's lines.
void FindCollisions(const Targets& targets, std::span<const Resolved> rows, const Layout& layout,
                    std::span<const UnitDrive> drives, std::span<const std::optional<Pose>> poses,
                    BadRows* bad) {
  constexpr double kToleranceMm = 0.002;  // "2 um less is still clear"
  std::unordered_map<std::uint32_t, const TargetRow*> row_of;
  for (const auto& [i, row] : rows) {
    if (!layout.unit(i).enabled) continue;
    const ArmOf arm{i, ArmAt(layout.unit(i), drives[i.value], *poses[i.value])};
    for (const PositionerIndex j : layout.neighbours(i)) {
      const auto earlier = row_of.find(j.value);
      if (earlier == row_of.end()) continue;
      const ArmOf other{j, ArmAt(layout.unit(j), drives[j.value], *poses[j.value])};
      if (IsClear(layout, arm, other, -kToleranceMm)) continue;
      bad->Add(At(targets, *row) + ": its target collides with that of unit " +
                   std::to_string(earlier->second->unit.value) + " in " +
                   LineOrRow(earlier->second->line) + ": their arms would be " +
                   Number(std::sqrt(SquaredDistance(arm.arm_fp, other.arm_fp))) + " mm apart, " +
                   Number(ClearDistanceMm(layout, i, j)) + " mm are needed",
               "collides with another target");
    }
    row_of.emplace(i.value, row);
  }
}

}  // namespace

Result<std::vector<std::optional<Pose>>> ResolveTargets(const Targets& targets,
                                                        const Layout& layout,
                                                        std::span<const UnitDrive> drives,
                                                        std::span<const UnitKnowledge> now) {
  FOCALFLEET_CHECK(drives.size() == layout.size());
  FOCALFLEET_CHECK(now.empty() || now.size() == layout.size());
  std::vector<PoseChoice> choices(layout.size());
  std::vector<std::optional<Pose>> poses(layout.size());
  BadRows bad;
  std::unordered_map<UnitId, int> line_of;
  std::vector<Resolved> resolved;
  for (const TargetRow& row : targets.rows) {
    const std::string at = At(targets, row) + ": ";
    const std::optional<PositionerIndex> index = layout.Find(row.unit);
    if (!index) {
      bad.Add(at + "unknown unit, the layout has none such", "unknown unit");
      continue;
    }
    if (const auto [it, fresh] = line_of.emplace(row.unit, row.line); !fresh) {
      bad.Add(at + "named twice, first in " + LineOrRow(it->second), "named twice");
      continue;
    }
    const std::uint32_t i = index->value;
    const Unit& unit = layout.unit(*index);
    const AxisAngles from = StandsAt(unit, drives[i], now.empty() ? nullptr : &now[i]);
    const auto* angles = std::get_if<TargetAngles>(&row.place);
    auto solutions = angles != nullptr
                         ? SolutionsFor(*angles, unit)
                         : SolutionsFor(std::get<PointFp>(row.place), unit, from.theta_deg);
    if (!solutions) {
      bad.Add(at + solutions.error().text, solutions.error().kind);
      continue;
    }
    choices[i] = NearestFirst(unit, drives[i], from, std::move(*solutions));
    poses[i] = choices[i].front();
    resolved.push_back({*index, &row});
  }
  std::vector<std::optional<SegmentFp>> standing(layout.size());
  for (std::uint32_t i = 0; i < now.size(); ++i)
    if (IsPlace(now[i])) standing[i] = ArmAt(layout.unit({i}), drives[i], PlaceOf(now[i]));
  ChooseSides(layout, drives, std::move(standing), choices, &poses);
  FindCollisions(targets, resolved, layout, drives, poses, &bad);
  FOCALFLEET_TRY(bad.Check());
  return poses;
}

namespace {

// Drawn configurations keep this much more than "clear". A planner needs that room for what it
// bounds or rounds on its way in and out of them. Units: mm.
constexpr double kDrawGuardMm = 0.02;
constexpr double kFoldedBendDeg = 120;  // phi + phi_zero of disabled units, at least
constexpr int kTriesPerPlace = 64;      // random poses of a unit before it takes an occupied place
constexpr int kTriesAmongFixed = 4096;  // where only units that cannot move are in the way
/// Units drawn anew, on average, before the draw is given up.
constexpr std::size_t kEvictionsPerUnit = 50;

// Draws by sequential placing with local repair. A unit that finds no clear place in many tries
// takes one where only movable neighbours stand, and those are drawn anew.
class ConfigurationDrawer {
 public:
  ConfigurationDrawer(const Layout& layout, std::span<const UnitDrive> drives, Rng rng)
      : layout_(layout), drives_(drives), arms_(layout.size()), fixed_(layout.size()) {
    const std::uint64_t seed = rng.Bits();
    poses_.resize(layout.size());
    for (std::uint32_t i = 0; i < layout.size(); ++i)
      streams_.push_back(Rng::Stream(seed, "draw configuration", i));
  }

  void Fix(std::uint32_t i, const Pose& pose) {
    Place(i, pose);
    fixed_[i] = 1;
  }

  Status DrawAll() {
    std::vector<std::uint32_t> waiting;  // taken from the back: disabled units first, ascending
    for (const bool enabled : {true, false})
      for (std::uint32_t i = Count(); i-- > 0;)
        if (layout_.unit({i}).enabled == enabled && !fixed_[i]) waiting.push_back(i);
    std::size_t evictions_left = kEvictionsPerUnit * layout_.size();
    while (!waiting.empty()) {
      const std::uint32_t i = waiting.back();
      waiting.pop_back();
      FOCALFLEET_TRY_ASSIGN(const std::vector<std::uint32_t> evicted, FindPlace(i));
      for (const std::uint32_t j : evicted) {
        if (evictions_left-- == 0) return NoRoom(i);
        arms_[j].reset();
        waiting.push_back(j);
      }
    }
    return {};
  }

  [[nodiscard]] const std::vector<Pose>& poses() const { return poses_; }

 private:
  [[nodiscard]] std::uint32_t Count() const { return static_cast<std::uint32_t>(layout_.size()); }

  [[nodiscard]] Status NoRoom(std::uint32_t i) const {
    return Fail(ErrorCode::kRefused, "unit " + std::to_string(layout_.unit({i}).id.value) +
                                         " finds no place clear of what stands around it");
  }

  void Place(std::uint32_t i, const Pose& pose) {
    poses_[i] = pose;
    arms_[i] = ArmAt(layout_.unit({i}), drives_[i], pose);
  }

  // Uniform over the area that the fibre reaches: r^2 and direction are uniform.
  Pose DrawEnabled(std::uint32_t i) {
    const Unit& unit = layout_.unit({i});
    const PatrolLimits patrol = PatrolOf(unit);
    Rng& rng = streams_[i];
    constexpr int kDirectionTries = 1000;
    for (int k = 0; k < kDirectionTries; ++k) {
      const double r =
          std::sqrt(rng.Uniform(patrol.min_mm * patrol.min_mm, patrol.max_mm * patrol.max_mm));
      const double direction = rng.Uniform(-std::numbers::pi, std::numbers::pi);
      const PointFp point{unit.base_fp.x_mm + r * std::cos(direction),
                          unit.base_fp.y_mm + r * std::sin(direction)};
      const std::vector<AxisAngles> solutions = AnglesFor(unit, point);
      if (solutions.empty()) continue;  // theta does not turn that far
      return InVectors(i, solutions[rng.Below(solutions.size())]);
    }
    return DrawFolded(i);
  }

  Pose DrawFolded(std::uint32_t i) {
    const Unit& unit = layout_.unit({i});
    const AxisGeometry& phi = unit.phi();
    double low = std::max(phi.min_deg, kFoldedBendDeg - phi.zero_deg);
    const double high = std::min(phi.max_deg, 360 - kFoldedBendDeg - phi.zero_deg);
    if (low > high) low = high;  // phi does not fold that far: as far as it goes
    Rng& rng = streams_[i];
    const double theta_deg = rng.Uniform(unit.theta().min_deg, unit.theta().max_deg);
    return InVectors(i, {theta_deg, rng.Uniform(low, high)});
  }

  [[nodiscard]] Pose InVectors(std::uint32_t i, const AxisAngles& angles) const {
    const Unit& unit = layout_.unit({i});
    return {NearestInRange(angles.theta_deg, unit.theta(), drives_[i].axis[0]),
            NearestInRange(angles.phi_deg, unit.phi(), drives_[i].axis[1])};
  }

  struct Contact {
    bool with_fixed = false;
    std::vector<std::uint32_t> with;
  };
  [[nodiscard]] Contact Contacts(std::uint32_t i, const SegmentFp& arm) const {
    Contact contact;
    for (const PositionerIndex j : layout_.neighbours({i})) {
      if (!arms_[j.value]) continue;
      if (IsClear(layout_, {{i}, arm}, {j, *arms_[j.value]}, kDrawGuardMm)) continue;
      contact.with_fixed |= fixed_[j.value] != 0;
      contact.with.push_back(j.value);
    }
    for (const Obstacle& obstacle : layout_.obstacles())
      contact.with_fixed |= !IsClear(layout_, {{i}, arm}, obstacle, kDrawGuardMm);
    return contact;
  }

  // Places unit i. Returns the units that must leave for it.
  Result<std::vector<std::uint32_t>> FindPlace(std::uint32_t i) {
    const bool enabled = layout_.unit({i}).enabled;
    std::optional<std::pair<Pose, std::vector<std::uint32_t>>> least;
    for (int k = 0; k < kTriesAmongFixed && (k < kTriesPerPlace || !least); ++k) {
      const Pose pose = enabled ? DrawEnabled(i) : DrawFolded(i);
      Contact contact = Contacts(i, ArmAt(layout_.unit({i}), drives_[i], pose));
      if (contact.with_fixed) continue;
      if (!least || contact.with.size() < least->second.size())
        least.emplace(pose, std::move(contact.with));
      if (least->second.empty()) break;
    }
    if (!least) return tl::unexpected<Error>(NoRoom(i).error());
    Place(i, least->first);
    return std::move(least->second);
  }

  const Layout& layout_;
  std::span<const UnitDrive> drives_;
  std::vector<Rng> streams_;
  std::vector<Pose> poses_;
  std::vector<std::optional<SegmentFp>> arms_;  // of placed units; empty: not placed
  std::vector<std::uint8_t> fixed_;
};

Pose FoldedPose(const Unit& unit, const UnitDrive& drive) {
  const AxisAngles angles = StandsAt(unit, drive, nullptr);
  return {NearestInRange(angles.theta_deg, unit.theta(), drive.axis[0]),
          NearestInRange(angles.phi_deg, unit.phi(), drive.axis[1])};
}

}  // namespace

Result<std::vector<Pose>> DrawConfiguration(const Layout& layout, std::span<const UnitDrive> drives,
                                            std::span<const std::optional<Pose>> standing,
                                            Rng rng) {
  FOCALFLEET_CHECK(drives.size() == layout.size());
  FOCALFLEET_CHECK(standing.empty() || standing.size() == layout.size());
  ConfigurationDrawer drawer(layout, drives, rng);
  for (std::uint32_t i = 0; i < standing.size(); ++i)
    if (standing[i]) drawer.Fix(i, *standing[i]);
  FOCALFLEET_TRY(drawer.DrawAll());
  return drawer.poses();
}

std::vector<Pose> FoldedConfiguration(const Layout& layout, std::span<const UnitDrive> drives) {
  FOCALFLEET_CHECK(drives.size() == layout.size());
  std::vector<std::optional<Pose>> standing(layout.size());
  for (std::uint32_t i = 0; i < layout.size(); ++i)
    if (layout.unit({i}).enabled) standing[i] = FoldedPose(layout.unit({i}), drives[i]);
  if (auto drawn = DrawConfiguration(layout, drives, standing, Rng(0))) return *drawn;
  // A disabled unit has no clear place at all: folded it is least in the way.
  std::vector<Pose> poses;
  for (std::uint32_t i = 0; i < layout.size(); ++i)
    poses.push_back(FoldedPose(layout.unit({i}), drives[i]));
  return poses;
}

}  // namespace focalfleet
