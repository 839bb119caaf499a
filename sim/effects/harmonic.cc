#include "sim/effects/harmonic.h"

#include <cmath>

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

void AddHarmonic(const UnitTrack& track, std::size_t axis, double order,
                 std::span<const double> amplitude, PoseErrors* errors) {
  const double* cmd_deg = track.cmd_deg[axis].data();
  double* angle_deg = errors->angle_deg[axis].data();
  for (std::size_t part = 0; part < 2; ++part) {
    if (amplitude[part] == 0) continue;
    const double ahead = part == 0 ? 0 : 0.25;  // a cosine is a sine a quarter ahead
    for (std::size_t i = 0; i < track.moves; ++i)
      angle_deg[i] += amplitude[part] * SineOfTurns(WithoutTurns(order * cmd_deg[i]) / 360 + ahead);
  }
}

}  // namespace focalfleet::sim
