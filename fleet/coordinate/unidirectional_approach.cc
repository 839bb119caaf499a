#include "fleet/coordinate/unidirectional_approach.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>

namespace focalfleet {
namespace {

// Share of the tolerance that the last correction aims for: another exposure has its own error.
constexpr double kWellWithin = 0.8;
constexpr double kSigmasShort = 3;  // of its scatter

std::int8_t SignOf(double value) {
  return static_cast<std::int8_t>((value > 0 ? 1 : 0) - (value < 0 ? 1 : 0));
}

/// The side of the axis' play after `left` more vectors; 0: not known.
std::int8_t SideAfter(const ApproachUnit& unit, Axis axis, std::int32_t left) {
  const double length = ApproachLength(unit, axis);
  return length > 0 ? unit.play[Index(axis)].SideAfter(left / length) : std::int8_t{0};
}

/// Angles by which axes may go farther than they are sent, arms and gears not being quite as
/// described. Arms that are a little longer put the same fibre on another angle of phi. The nearer
/// phi is to stretched or folded, the larger is the effect. Theta has to make up for the change of
/// the fibre's direction by phi.
std::array<double, kAxisCount> GainDoubtDeg(const Unit& unit, const AxisAngles& at,
                                            const std::array<double, kAxisCount>& left_deg) {
  constexpr double kLeast = 0.05;
  constexpr double kMost = 0.3;
  constexpr double kArmsMm = 0.08;  // standard deviation of both together
  constexpr double kMostDeg = 0.2;  // an error beyond that needs another correction anyhow
  const double phi = (at.phi_deg + unit.phi().zero_deg) * std::numbers::pi / 180;
  const double a = unit.theta().arm_mm, b = unit.phi().arm_mm;
  const double r2 = a * a + b * b + 2 * a * b * std::cos(phi);
  const double outwards_mm = a * b * std::abs(std::sin(phi)) / std::sqrt(std::max(r2, 1e-6));
  const double off_rad = kArmsMm / std::max(outwards_mm, 1e-3);
  const double gain =
      std::clamp(2 * off_rad * std::abs(std::cos(phi)) / std::max(std::abs(std::sin(phi)), 1e-3),
                 kLeast, kMost);
  const double turn = std::abs(b * b + a * b * std::cos(phi)) / std::max(r2, b * b / 4);
  const double theta_deg = kLeast * std::abs(left_deg[0]) + turn * gain * std::abs(left_deg[1]);
  return {std::min(theta_deg, kMostDeg), std::min(gain * std::abs(left_deg[1]), kMostDeg)};
}

/// Standard deviation of where an axis ends after a way (CoordinatorConfig::scatter_deg).
double ScatterDeg(const CoordinatorConfig& config, double way_deg) {
  constexpr double kTravelDeg = 360;
  return config.scatter_deg * std::sqrt(2 * (1 - std::exp(-way_deg / kTravelDeg)));
}

/// The aim of the last correction. Nothing mends the scatter of its approaches, so they are made by
/// as few axes as bring the fibre well within the tolerance.
Pose LastAimOf(const ApproachUnit& unit, const Pose& goal,
               const std::array<bool, kAxisCount>& approaches, double tolerance_um) {
  const Pose place = unit.place();
  const PointFp wanted = FibreAt(unit.unit, unit.drive, goal);
  const auto off_um = [&](const Pose& pose) {
    return 1e3 * DistanceMm(FibreAt(unit.unit, unit.drive, pose), wanted);
  };
  const Pose stays{approaches[0] ? place[0] : goal[0], approaches[1] ? place[1] : goal[1]};
  if (off_um(stays) <= kWellWithin * tolerance_um) return stays;
  if (!approaches[0] || !approaches[1]) return goal;
  const Pose theta_stays{place[0], goal[1]}, phi_stays{goal[0], place[1]};
  const Pose& better = off_um(theta_stays) < off_um(phi_stays) ? theta_stays : phi_stays;
  return off_um(better) <= kWellWithin * tolerance_um ? better : goal;
}

}  // namespace

std::int8_t UsualSide(const CoordinatorConfig& config, Axis axis) {
  return SignOf(config.approach_deg[Index(axis)]);
}

std::int32_t ApproachLength(const ApproachUnit& unit, Axis axis) {
  return std::abs(NearestVectors(unit.config.approach_deg[Index(axis)], unit.unit.axis[Index(axis)],
                                 unit.drive.axis[Index(axis)]));
}

bool NeedsApproach(const ApproachUnit& unit, Axis axis, std::int32_t left) {
  const std::int32_t length = ApproachLength(unit, axis);
  if (length == 0) return false;
  if (unit.correction) {
    const std::int8_t side = unit.correction->side[Index(axis)];
    return side != 0 && SideAfter(unit, axis, left) != side;
  }
  if (unit.knowledge[Index(axis)].witness != Witness::kMeasured) return true;
  return left != 0 && (unit.play[Index(axis)].side() != SignOf(left) || std::abs(left) > length);
}

std::vector<Pose> PosesPast(const ApproachUnit& unit, const Pose& target) {
  const Pose place = unit.place();
  if (!unit.correction && place == target) return {};
  // Choices of each axis: the usual side, the other side, and its place if it needs or gets none.
  std::array<std::array<std::int32_t, 3>, kAxisCount> choice{};
  bool any = false;
  for (const Axis axis : kAxes) {
    choice[Index(axis)].fill(place[Index(axis)]);
    if (!NeedsApproach(unit, axis, target[Index(axis)] - place[Index(axis)])) continue;
    any = true;
    const std::int8_t side =
        unit.correction ? unit.correction->side[Index(axis)] : UsualSide(unit.config, axis);
    const std::int32_t back = side * ApproachLength(unit, axis);
    std::size_t option = 0;
    for (const std::int32_t past : {target[Index(axis)] - back, target[Index(axis)] + back}) {
      if (unit.range[Index(axis)].contains(past)) choice[Index(axis)][option++] = past;
      if (unit.correction) break;
    }
  }
  if (!any) return {};
  std::vector<Pose> wished;
  constexpr std::array<std::array<std::size_t, 2>, 8> kOrder{
      {{0, 0}, {0, 1}, {1, 0}, {1, 1}, {0, 2}, {2, 0}, {1, 2}, {2, 1}}};
  for (const auto& [theta, phi] : kOrder) {
    const Pose pose{choice[0][theta], choice[1][phi]};
    if (pose != place && std::ranges::find(wished, pose) == wished.end()) wished.push_back(pose);
  }
  return wished;
}

std::vector<Pose> PosesAside(const ApproachUnit& unit) {
  const auto& [aim, side, has_no_room] = *unit.correction;
  std::vector<Pose> aside;
  for (const std::int32_t times : {1, 2})
    for (const auto& [theta, phi] : {std::array{1, 0}, std::array{0, 1}, std::array{1, 1}}) {
      const Pose pose{aim[0] - theta * times * side[0] * ApproachLength(unit, Axis::kTheta),
                      aim[1] - phi * times * side[1] * ApproachLength(unit, Axis::kPhi)};
      const bool comes_back = (theta == 0 || side[0] != 0) && (phi == 0 || side[1] != 0);
      if (comes_back && unit.range[0].contains(pose[0]) && unit.range[1].contains(pose[1]))
        aside.push_back(pose);
    }
  return aside;
}

Pose NextPose(const ApproachUnit& unit) {
  const Pose& aim = unit.correction->aim;
  const Pose place = unit.place();
  Pose next = aim;
  for (const Axis axis : kAxes) {
    const std::int32_t left = aim[Index(axis)] - place[Index(axis)];
    if (NeedsApproach(unit, axis, left) && 2 * std::abs(left) < ApproachLength(unit, axis))
      next[Index(axis)] = place[Index(axis)];
  }
  return next;
}

Pose AimOf(const ApproachUnit& unit, const Pose& goal, bool is_last, double tolerance_um) {
  const Pose place = unit.place();
  Pose aim = goal;
  std::array<bool, kAxisCount> approaches{};
  std::array<double, kAxisCount> left_deg{};
  for (const Axis axis : kAxes) {
    const std::size_t a = Index(axis);
    approaches[a] = NeedsApproach(unit, axis, aim[a] - place[a]);
    left_deg[a] = AngleDeg(aim[a] - place[a], unit.unit.axis[a], unit.drive.axis[a]);
  }
  if (is_last) return LastAimOf(unit, goal, approaches, tolerance_um);
  const std::array<double, kAxisCount> doubt_deg =
      GainDoubtDeg(unit.unit, AnglesOf(unit.unit, unit.drive, place), left_deg);
  for (const Axis axis : kAxes) {
    const std::size_t a = Index(axis);
    const double approach_deg = std::abs(unit.config.approach_deg[a]);
    const double short_deg =
        doubt_deg[a] + (approaches[a]
                            ? unit.config.creep_deg
                            : kSigmasShort * ScatterDeg(unit.config, std::abs(left_deg[a])));
    // Without an approach the axis cannot end farther back than it is.
    const double most_deg = approaches[a] ? approach_deg : std::abs(left_deg[a]);
    if (approach_deg > 0)
      aim[a] -= unit.correction->side[a] * NearestVectors(std::min(short_deg, most_deg),
                                                          unit.unit.axis[a], unit.drive.axis[a]);
  }
  return aim;
}

}  // namespace focalfleet
