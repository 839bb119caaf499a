// The parameters of one 4 mm motor and of the load on its shaft. Paper 1 prints resistance,
// inductance and inertia, but neither flux nor load. Five sets are each consistent with its
// critical n = 37 at 1.8 V, and its measurements single out none of them. A result that needs one
// of the sets says which.
#pragma once

#include <array>
#include <optional>
#include <string_view>

namespace focalfleet::sim {

/// The motor has one pole pair: an electrical turn is a turn of the rotor. Units: SI, torques at
/// the motor shaft.
struct MotorParameters {
  double resistance_ohm = 14.85;  // of a phase, at 20 degrees Celsius
  double inductance_H = 37e-6;    // of a phase; the magnet has no saliency: Ld = Lq
  double flux_linkage_Wb = 0.15e-3;
  double inertia_kg_m2 = 8.7e-11;
  double viscous_Nms = 1e-8;
  double load_Nm = 4.07e-6;      // dry friction: opposes motion; mean over an output turn
  double load_variation = 0.20;  // amplitude over one output turn, as a share of the mean
};

/// A consistent choice of the parameters that the paper leaves open.
struct ParameterSet {
  std::string_view name;
  MotorParameters motor;
};

/// Set C has constant torque and no viscous drag. V: V_bus * n falls nowhere. W lies between. 9 has
/// the strongest magnet; without drag it starts bare at 9 V with n = 8. J2 is 9 with twice the
/// inertia.
inline constexpr std::array<ParameterSet, 5> kParameterSets = {{
    {"C", {.flux_linkage_Wb = 0.15e-3, .viscous_Nms = 0, .load_Nm = 5.93e-6}},
    {"V", {.flux_linkage_Wb = 0.15e-3, .viscous_Nms = 1e-8, .load_Nm = 4.07e-6}},
    {"W", {.flux_linkage_Wb = 0.20e-3, .viscous_Nms = 2e-8, .load_Nm = 5.06e-6}},
    {"9", {.flux_linkage_Wb = 0.30e-3, .viscous_Nms = 2e-8, .load_Nm = 11.62e-6}},
    {"J2",
     {.flux_linkage_Wb = 0.30e-3,
      .inertia_kg_m2 = 17.4e-11,
      .viscous_Nms = 1e-8,
      .load_Nm = 9.23e-6}},
}};

constexpr std::optional<MotorParameters> FindParameterSet(std::string_view name) {
  for (const ParameterSet& set : kParameterSets)
    if (set.name == name) return set.motor;
  return std::nullopt;
}

/// The load of a motor without its gearhead (paper 1's bench).
inline constexpr double kBareLoad_Nm = 1e-6;

}  // namespace focalfleet::sim
