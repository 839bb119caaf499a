// Ripples of gears and motors are a sine of the shaft's angle with an order (periods a turn of the
// output) that the gearbox fixes. Order 1 is the output gear. A gearhead of four planetary stages
// of 60/14 each (337.36 : 1) may be followed by a pinion stage of 45/17. The gear ratio shows which
// of the two a unit has.
#pragma once

#include <cstddef>
#include <span>

#include "sim/campaigns/effects/effect.h"
#include "sim/campaigns/effects/wave.h"

namespace focalfleet::sim {

inline constexpr double kStageRatio = 60.0 / 14.0;
inline constexpr double kGearheadRatio = 337.36;
inline constexpr double kOutputTeeth = 45;
inline constexpr double kPinionTeeth = 17;
inline constexpr double kRingTeeth = 46;

/// Turns of the last planetary carrier per turn of the output: 45/17, or 1 without a pinion stage.
double PinionRatio(const CampaignUnit& unit, std::size_t axis);
bool HasPinion(const CampaignFacts& facts);

/// Phase of the order at the commanded angle of move i, in turns, -1/2 to 1/2.
inline double HarmonicPhase(const UnitTrack& track, std::size_t axis, std::size_t i, double order) {
  // Whole turns are removed first: at order 5000 the phase keeps its digits.
  return WithoutTurns(order * track.cmd_deg[axis][i]) / 360;
}

/// Adds amplitude[0] sin + amplitude[1] cos of the order to the axis' angle.
void AddHarmonic(const UnitTrack& track, std::size_t axis, double order,
                 std::span<const double> amplitude, PoseErrors* errors);

/// The fall of a motor's ripple with the drive level: a power of the level, and for each further
/// harmonic so many powers more.
struct FallsWithDrive {
  double power = 0;
  double more = 0;
};

/// Adds sin and cos of the order, and of as many harmonics as there are amplitudes for, to the
/// axis' angle. The error at rest stays until the axis moves again. Pre: column drive_amplitude,
/// unless both powers are 0.
void AddMotorWave(const UnitTrack& track, std::size_t axis, double order,
                  const FallsWithDrive& falls, std::span<const double> amplitude,
                  PoseErrors* errors);

}  // namespace focalfleet::sim
