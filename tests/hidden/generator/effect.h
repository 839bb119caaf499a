// An effect has a cause, an owner, a size for each unit, and the physics that carries it from the
// drive to the camera. A unit's campaign is a Track of its axes' angles in every move. Each effect
// changes the track at its own stage, so that effects act on each other as in a real unit. A
// slipped revolution shifts the phase of a ripple, and backlash follows the lagging rotor.
//
//   travel      the firmware and the gears turn a command into motion; errors stay until the next
//               homing
//   rest        the rotor comes to rest in its electrical field
//   history     parts between rotor and arm with memory: play, bristles, stiction
//   gear        transmission error of the gears, as a function of the arm's angle
//   exposure    dependence on time, gravity, heat and neighbours when the picture is taken
//   plate       the fibre's place: plate, telescope
//   camera      the measured place
#pragma once

#include <array>
#include <complex>
#include <cstdint>
#include <string_view>
#include <vector>

#include "tests/hidden/generator/campaign.h"

namespace focalfleet::hidden {

enum class Stage : std::uint8_t { kTravel, kRest, kHistory, kGear, kExposure, kPlate, kCamera };
enum class Owner : std::uint8_t { kUnit, kRail, kBus, kPlate, kCamera };
enum class AxisUse : std::uint8_t { kEither, kThetaOnly, kNone };

std::string_view NameOf(Owner owner);

/// The campaign of one unit, move by move. Shapes: (moves).
struct Track {
  std::array<std::vector<double>, kAxes> angle_deg;  // of the axis, stage by stage
  std::array<std::vector<double>, kAxes> growth;     // of the arm, relative
  std::array<std::vector<double>, kAxes> tilt_rad;   // of the axis out of the plate's normal: x, y
  std::vector<Place> place_mm;                       // from the stage of the plate on
};

struct Effect;

/// The laws by which causes act: mechanisms that are integrated, or curves (curves.h).
enum class Physics : std::uint8_t { kMechanisms, kCurves };

/// The data that an effect may read: commands and conditions, never the other units' true state.
struct Scene {
  const Campaign* campaign = nullptr;
  Physics physics = Physics::kMechanisms;
  std::vector<std::vector<std::size_t>> neighbours;
};

struct EffectKind {
  std::string_view cause;
  Stage stage = Stage::kExposure;
  AxisUse axis = AxisUse::kNone;
  double typical = 1;  // amplitude of size 1, in `amplitude_unit`
  std::string_view amplitude_unit;
  double size_max = 30;  // multiples of the typical amplitude that physics still allows
  bool either_sign = false;
  std::vector<Owner> owners;
  std::vector<std::string_view> columns;  // of moves.csv, needed to name it
  int phases = 1;                         // free coefficients per owner: 2 where a phase is free
  // A realisation of chance: no other cause's signature can be compared with it.
  bool is_event = false;
  void (*apply)(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) = nullptr;
};

struct Effect {
  const EffectKind* kind = nullptr;
  std::size_t axis = kTheta;
  Owner owner = Owner::kUnit;
  double size = 0;                // multiples of the typical, signed
  std::array<double, 4> shape{};  // uniform in 0..1: parameters that the cause leaves open
  std::uint64_t seed = 0;         // of events
  std::vector<double> weight;     // by unit; 0: without the effect
  std::vector<double> phase_rad;  // by unit
  // sensor_bias: the growth per K that is computed from the sensor's readings.
  double read_through = 0;
  [[nodiscard]] double Amount(std::size_t unit) const {
    return kind->typical * size * weight[unit];
  }
};

/// Every cause of the library that a fibre's place shows, then effects that no library holds (their
/// ids begin with "other_").
const std::vector<EffectKind>& Catalogue();
const EffectKind* FindKind(std::string_view cause);
inline bool IsForeign(const EffectKind& kind) { return kind.cause.substr(0, 6) == "other_"; }
/// Columns in which an analyst would see a foreign effect.
std::vector<std::string_view> ForeignCovariates(std::string_view cause);

/// The catalogue's parts, each a family of physics.
std::vector<EffectKind> TravelEffects();
std::vector<EffectKind> RotorEffects();
std::vector<EffectKind> HistoryEffects();
std::vector<EffectKind> GearEffects();
std::vector<EffectKind> ArmEffects();
std::vector<EffectKind> ThermalEffects();
std::vector<EffectKind> PlateEffects();
std::vector<EffectKind> CameraEffects();
std::vector<EffectKind> ForeignEffects();

/// The last direction in which a unit's axis was driven, move by move: +1, -1. After homing it is
/// the direction into the stop.
std::vector<double> Directions(const Campaign& campaign, std::size_t unit, std::size_t axis);

}  // namespace focalfleet::hidden
