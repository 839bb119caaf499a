// Ripples of gears and motors: a sine of the shaft's angle with an order (periods a turn of the
// output) that the gearbox fixes. Order 1 is the output gear. A gearhead of four planetary stages
// of 60/14 each (337.36 : 1) may be followed by a pinion stage of 45/17; which of the two a unit
// has is read off its gear ratio.
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
  // Whole turns first: at order 5000 the phase keeps its digits.
  return WithoutTurns(order * track.cmd_deg[axis][i]) / 360;
}

/// amplitude[0] sin + amplitude[1] cos of the order, on the axis' angle.
void AddHarmonic(const UnitTrack& track, std::size_t axis, double order,
                 std::span<const double> amplitude, PoseErrors* errors);

/// How a ripple of the motor falls with the drive level: as a power of it, and each further
/// harmonic by so many powers more.
struct FallsWithDrive {
  double power = 0;
  double more = 0;
};

/// sin, cos of the order and of as many of its harmonics as there are amplitudes for, on the axis'
/// angle; what a rotor came to rest with stays until the axis moves again. Pre: column
/// drive_amplitude, unless both powers are 0.
void AddMotorWave(const UnitTrack& track, std::size_t axis, double order,
                  const FallsWithDrive& falls, std::span<const double> amplitude,
                  PoseErrors* errors);

}  // namespace focalfleet::sim
