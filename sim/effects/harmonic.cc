#include "sim/effects/harmonic.h"

#include <cmath>
#include <numbers>

namespace focalfleet::sim {
namespace {

// Gear ratios of real units differ from the nominal one by parts in a thousand.
constexpr double kTolerance = 0.05;

bool HasPinionStage(double gear) {
  return std::abs(gear / kGearheadRatio / (kOutputTeeth / kPinionTeeth) - 1) < kTolerance;
}

}  // namespace

double PinionRatio(const CampaignUnit& unit, std::size_t axis) {
  return HasPinionStage(unit.gear[axis]) ? kOutputTeeth / kPinionTeeth : 1;
}

bool HasPinion(const CampaignFacts& facts) {
  for (const CampaignUnit& unit : facts.campaign->units)
    if (HasPinionStage(unit.gear[kTheta]) || HasPinionStage(unit.gear[kPhi])) return true;
  return false;
}

double HarmonicPhase(const UnitTrack& track, std::size_t axis, std::size_t i, double order) {
  // Whole turns first: at order 5000 the phase keeps its digits.
  const double turns = std::remainder(order * track.cmd_deg[axis][i], 360.0) / 360;
  return 2 * std::numbers::pi * turns;
}

void AddHarmonic(const UnitTrack& track, std::size_t axis, double order,
                 std::span<const double> amplitude, PoseErrors* errors) {
  for (std::size_t i = 0; i < track.moves; ++i) {
    const double phase = HarmonicPhase(track, axis, i, order);
    errors->angle_deg[axis][i] += amplitude[0] * std::sin(phase) + amplitude[1] * std::cos(phase);
  }
}

}  // namespace focalfleet::sim
