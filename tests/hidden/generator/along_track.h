// Walks along a unit's track, and the numbers of its drive and gears, which the laws of both
// physics have in common.
#pragma once

#include <cmath>
#include <cstddef>

#include "tests/hidden/generator/effect.h"

namespace focalfleet::hidden {

inline constexpr double kSpur = 45.0 / 17;
inline constexpr double kStage = 60.0 / 14;  // each of the four planetary stages

inline bool HasSpur(const Scene& scene, std::size_t unit, std::size_t axis) {
  return scene.campaign->units[unit].gear[axis] > 500;
}

inline double TravelOf(const Row& row, std::size_t axis) {
  return row.cmd_deg[axis] - row.from_deg[axis];
}

/// The field of the rotor, as a share of the nominal one.
inline double DriveOf(const Campaign& campaign, std::size_t move, std::size_t unit) {
  return campaign.At(move, unit).v_bus_V / campaign.v_nominal_V *
         campaign.exposures[move].drive_amplitude;
}

/// Adds `extra_deg(row, move)` to each move's travel; the sum stays until the unit is homed.
template <class Extra>
void AddTravel(const Scene& scene, const Effect& effect, std::size_t unit, const Extra& extra_deg,
               Track* track) {
  double sum_deg = 0;
  for (std::size_t m = 0; m < scene.campaign->move_count(); ++m) {
    const Row& row = scene.campaign->At(m, unit);
    if (row.rehomed) sum_deg = 0;
    if (row.Moved(effect.axis)) sum_deg += extra_deg(row, m);
    track->angle_deg[effect.axis][m] += sum_deg;
  }
}

/// Adds `made_deg(row, move)` when the axis moves; it stays until the axis moves or is homed.
template <class Made>
void AddHeld(const Scene& scene, const Effect& effect, std::size_t unit, const Made& made_deg,
             Track* track) {
  double held_deg = 0;
  for (std::size_t m = 0; m < scene.campaign->move_count(); ++m) {
    const Row& row = scene.campaign->At(m, unit);
    if (row.Moved(effect.axis))
      held_deg = made_deg(row, m);
    else if (row.rehomed)
      held_deg = 0;
    track->angle_deg[effect.axis][m] += held_deg;
  }
}

/// Adds `lag_rad(move, rotor_rad)` of the rotor when the axis moves. The rotor stays there until it
/// moves again, because its magnets hold it.
template <class Lag>
void AddAtRest(const Scene& scene, const Effect& effect, std::size_t unit, const Lag& lag_rad,
               Track* track) {
  const double gear = scene.campaign->units[unit].gear[effect.axis];
  AddHeld(
      scene, effect, unit,
      [&](const Row&, std::size_t m) {
        const double turns_deg = track->angle_deg[effect.axis][m] * gear;
        return lag_rad(m, std::remainder(turns_deg, 360.0) * kDegree) / kDegree / gear;
      },
      track);
}

/// Adds `error_deg(angle in rad)` in every move.
template <class Error>
void AddOfAngle(const Effect& effect, const Error& error_deg, Track* track) {
  for (double& angle : track->angle_deg[effect.axis]) angle += error_deg(angle * kDegree);
}

}  // namespace focalfleet::hidden
