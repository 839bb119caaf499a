#include "sim/world/spread.h"

#include <algorithm>
#include <cmath>

#include "protocol/base/rng.h"

namespace focalfleet::sim {
namespace {

constexpr double kOffScaleShare = 0.085;
constexpr double kSlippingShare = 0.02;
constexpr double kDeadShare = 0.02;

// A draw for each unit decides whether it has a bad axis, and another which axis. A unit has at
// most one of these.
void DrawBadAxes(const UnitDescription& description, std::uint64_t seed, UnitTraits* traits) {
  Rng rng = Rng::Stream(seed, "bad axis", description.id.value);
  const double lot = rng.Uniform();
  AxisTraits& axis = traits->axis[rng.Below(kAxisCount)];
  const double amount = rng.Uniform();
  if (lot < kDeadShare) {
    axis.grip = 0;
  } else if (lot < kDeadShare + kSlippingShare) {
    axis.grip = 0.3 + 0.6 * amount;
  } else if (lot < kDeadShare + kSlippingShare + kOffScaleShare) {
    axis.gear *= amount < 0.5 ? 1.02 + 0.16 * amount : 0.90 + 0.08 * amount;
  }
}

void DrawReal(const UnitDescription& description, std::uint64_t seed, UnitTraits* traits) {
  for (const Axis which : kAxes) {
    const std::uint64_t stream = description.id.value * kAxisCount + Index(which);
    AxisTraits& axis = traits->axis[Index(which)];
    Rng rng = Rng::Stream(seed, "spread", stream);
    axis.backlash_deg = rng.Uniform(1.4, 1.6);
    axis.periodic_deg = 0.1;
    axis.periodic_phase_deg = rng.Uniform(0, 360);
    axis.scatter_deg = rng.Uniform(0.09, 0.14);
    axis.gear *= 1 + 0.003 * rng.Normal();
    axis.scatter_seed = rng.Bits();
    traits->mechanism.arm_mm[Index(which)] += 0.057 * rng.Normal();
    traits->mechanism.zero_deg[Index(which)] += 0.5 * rng.Normal();
  }
  DrawBadAxes(description, seed, traits);
}

void Plant(const PlantedTrait& planted, const UnitDescription& description, std::uint64_t seed,
           UnitTraits* traits) {
  for (const Axis which : kAxes) {
    if (!planted.on_axis[Index(which)]) continue;
    const std::uint64_t stream = description.id.value * kAxisCount + Index(which);
    Rng rng =
        Rng::Stream(seed, kPlantedCauseNames[static_cast<std::size_t>(planted.cause)], stream);
    AxisTraits& axis = traits->axis[Index(which)];
    switch (planted.cause) {
      case PlantedCause::kZeroOffset:
        traits->mechanism.zero_deg[Index(which)] += planted.size * rng.Normal();
        break;
      case PlantedCause::kArmLength:
        traits->mechanism.arm_mm[Index(which)] += planted.size * rng.Normal();
        break;
      case PlantedCause::kGearScale:
        axis.gear *= 1 + planted.size * rng.Normal();
        break;
      case PlantedCause::kBacklash:
        axis.backlash_deg += planted.size;
        break;
      case PlantedCause::kEccentricity:
        axis.periodic_deg += planted.size;
        axis.periodic_phase_deg = rng.Uniform(0, 360);
        break;
    }
  }
}

}  // namespace

FactoryRange FactoryRangeOf(const AxisDescription& axis, Axis which, std::int32_t subdivision) {
  const double per_deg = subdivision * axis.gear / 360;
  // The ends are whole vectors on the outer side, so that an end that was rounded to nearest is
  // still inside.
  FactoryRange range{static_cast<std::int32_t>(std::floor(axis.min_deg * per_deg)),
                     static_cast<std::int32_t>(std::ceil(axis.max_deg * per_deg)), 0};
  const double home_deg = which == Axis::kPhi ? axis.max_deg : axis.min_deg;
  range.home_position = static_cast<std::int32_t>(std::lround(home_deg * per_deg));
  return range;
}

UnitTraits DrawTraits(const UnitDescription& description, const TraitsOptions& options) {
  UnitTraits traits;
  traits.mechanism = BuiltAsDescribed(description);
  Rng rng = Rng::Stream(options.seed, "unit", description.id.value);
  const double drawn = rng.Uniform(-options.clock_error_max, options.clock_error_max);
  traits.clock.rate = 1 + description.clock_error.value_or(drawn);
  for (const Axis which : kAxes) {
    const AxisDescription& described = description.axis[Index(which)];
    AxisTraits& axis = traits.axis[Index(which)];
    axis.gear = described.gear;
    axis.load_phase_deg = rng.Uniform(0, 360);
    // The stop stands a quarter of an electrical turn beyond the last vector. A rotor that is
    // driven against it then agrees with that vector and no other.
    const FactoryRange range = FactoryRangeOf(described, which, options.subdivision);
    const double deg_per_vector = 360 / (options.subdivision * described.gear);
    const double beyond = options.subdivision / 4.0;
    axis.stop_low_deg = (range.min_position - beyond) * deg_per_vector;
    axis.stop_high_deg = (range.max_position + beyond) * deg_per_vector;
  }
  if (options.spread == Spread::kReal) DrawReal(description, options.seed, &traits);
  for (const PlantedTrait& planted : options.planted)
    Plant(planted, description, options.seed, &traits);
  return traits;
}

std::array<double, kAxisCount> FirstPoseDeg(const UnitDescription& description,
                                            std::uint64_t seed) {
  const AxisDescription& theta = description.axis[Index(Axis::kTheta)];
  const AxisDescription& phi = description.axis[Index(Axis::kPhi)];
  std::array<double, kAxisCount> pose{(theta.min_deg + theta.max_deg) / 2,
                                      std::clamp(180 - phi.zero_deg, phi.min_deg, phi.max_deg)};
  if (!description.enabled) {
    Rng rng = Rng::Stream(seed, "broken pose", description.id.value);
    pose[0] = rng.Uniform(theta.min_deg, theta.max_deg);
    const double low_deg = std::clamp(120 - phi.zero_deg, phi.min_deg, phi.max_deg);
    pose[1] = rng.Uniform(low_deg, phi.max_deg);
  }
  for (std::size_t i = 0; i < kAxisCount; ++i)
    pose[i] = description.axis[i].angle_deg.value_or(pose[i]);
  return pose;
}

}  // namespace focalfleet::sim
