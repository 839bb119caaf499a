// The exact ways in which a cause turns a rotor that is far out of its field. The waves of the
// templates are sines, which are right for a small turn; a turn of many electrical degrees bends
// them, and the bend tells causes of one harmonic apart.
#pragma once

#include <span>
#include <string_view>

namespace focalfleet::sim {

struct RotorWay {
  std::string_view cause;
  double harmonic;  // of the motor's turn
  double falls;     // power of the drive by which the strength falls
  /// The error in electrical radians by the wave's phase in radians, and its strength at drive 1.
  double (*error)(double harmonic, double wave_rad, double strength);
};

std::span<const RotorWay> RotorWays();

/// The causes that have such ways, each once.
std::span<const std::string_view> RotorWayCauses();
bool HasRotorWays(std::string_view cause);

/// The angle from the commanded one at which a rotor comes to rest: the root nearest zero of
/// sin(lag) = detent sin(wave - harmonic lag).
/// Units: degrees, electrical. `detent`: of the pull-out torque at this drive. `wave_deg`: the
/// harmonic times the angle, and a phase.
double DetentError(double harmonic, double wave_deg, double detent);

}  // namespace focalfleet::sim
