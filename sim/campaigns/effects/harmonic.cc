#include "sim/campaigns/effects/harmonic.h"

#include <algorithm>
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

void AddMotorWave(const UnitTrack& track, std::size_t axis, double order,
                  const FallsWithDrive& falls, std::span<const double> amplitude,
                  PoseErrors* errors) {
  constexpr double kLevelLeast = 0.05;
  for (std::size_t k = 0; 2 * k < amplitude.size(); ++k) {
    const double sine = amplitude[2 * k], cosine = amplitude[2 * k + 1];
    if (sine == 0 && cosine == 0) continue;
    const double own_order = order * static_cast<double>(k + 1);
    const double power = falls.power + falls.more * static_cast<double>(k);
    std::span<const double> drive;
    if (power != 0) drive = track.Column("drive_amplitude");
    AddRemembered(
        track, axis, Memory::kHold,
        [&](std::size_t i) {
          const double phase = HarmonicPhase(track, axis, i, own_order);
          const double wave = sine * SineOfTurns(phase) + cosine * CosineOfTurns(phase);
          return power == 0 ? wave : wave / std::pow(std::max(drive[i], kLevelLeast), power);
        },
        &errors->angle_deg[axis]);
  }
}

}  // namespace focalfleet::sim
