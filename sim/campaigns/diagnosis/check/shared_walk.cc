#include "sim/campaigns/diagnosis/check/shared_walk.h"

#include <algorithm>

#include "sim/campaigns/diagnosis/check/screen.h"

namespace focalfleet::sim {
namespace {

constexpr double kRemembersShare = 0.3;  // of a rest error

// Whether the structure is of an axis whose noise remembers: only effects of that axis are hidden
// by its noise.
bool IsOfSuchAxis(const UnknownFound& reported, const Noise& noise) {
  return (reported.channel.starts_with("theta") && noise.carry[kTheta] >= kRemembersShare) ||
         (reported.channel.starts_with("phi") && noise.carry[kPhi] >= kRemembersShare);
}

}  // namespace

std::optional<UnknownFound> FindSharedWalk(const Fit& fit, double family_wise, std::uint64_t seed) {
  constexpr double kClearly = 20;
  constexpr int kCurves = 3, kRounds = 2;  // curves: a step is no smooth one
  if (std::max(fit.noise.carry[kTheta], fit.noise.carry[kPhi]) < kRemembersShare)
    return std::nullopt;
  Fit forgetful = fit;
  forgetful.noise = {.least_um = fit.noise.least_um, .unit_factor = fit.noise.unit_factor};
  UpdateNoise(&forgetful);
  UpdateWeights(&forgetful);
  SettleFit(&forgetful, kRounds);
  std::optional<UnknownFound> clearest;
  for (int k = 0; k < kCurves; ++k) {
    const auto left = FindStructure(forgetful, family_wise, seed);
    if (!left || left->term.sharing != Sharing::kFleet || !IsOfSuchAxis(left->reported, fit.noise))
      break;
    if (!clearest) clearest = left->reported;
    forgetful.model.terms.push_back(left->term);
    StepFit(&forgetful);
    SettleFit(&forgetful, kRounds);
    // Each fit is judged by its own noise, which is the difference between them.
    if (NegativeBic(forgetful) > NegativeBic(fit) + kClearly) return clearest;
  }
  return std::nullopt;
}

}  // namespace focalfleet::sim
