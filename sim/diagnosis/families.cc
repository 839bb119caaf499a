#include "sim/diagnosis/families.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <span>

namespace focalfleet::sim {
namespace {

// What depends on the direction and length of moves.
constexpr std::string_view kMoves[] = {
    "backlash",   "load_angle_lag", "relaxation",       "supply_droop",        "friction_windup",
    "stiction",   "mode_threshold", "ramp_travel",      "scale_asymmetry",     "start_skew",
    "gear_scale", "fibre_torque",   "thermal_backlash", "command_quantisation"};
// What depends on where the axis stands.
constexpr std::string_view kAngles[] = {"gear_scale",     "eccentricity",   "pinion_runout",
                                        "stage_ripple",   "tooth_mesh",     "tooth_damage",
                                        "axis_tilt",      "hard_stop",      "fibre_torque",
                                        "axis_crosstalk", "gravity_torque", "command_quantisation"};
// What drifts as the night cools and the units run.
constexpr std::string_view kNight[] = {"wear",          "thermal_backlash",   "self_heating",
                                       "supply_drift",  "thermal_arm_growth", "plate_expansion",
                                       "plate_gradient"};
// What moves the whole image.
constexpr std::string_view kImage[] = {"camera_similarity", "air_turbulence", "camera_distortion",
                                       "plate_expansion",   "plate_gradient", "gravity_sag",
                                       "axis_tilt"};
// What turns with the rotor.
constexpr std::string_view kRotor[] = {"cogging", "phase_imbalance", "neighbour_coupling"};

bool Has(std::span<const std::string_view> family, std::string_view cause) {
  return std::find(family.begin(), family.end(), cause) != family.end();
}

bool AxesMeet(const std::string& a, const std::string& b) {
  const auto open = [](const std::string& axis) { return axis == "both" || axis == "none"; };
  return a == b || open(a) || open(b);
}

}  // namespace

bool AreRelated(std::string_view a, std::string_view b) {
  const std::span<const std::string_view> families[] = {kMoves, kAngles, kNight, kImage, kRotor};
  return std::any_of(std::begin(families), std::end(families),
                     [&](const auto& family) { return Has(family, a) && Has(family, b); });
}

void JudgeRemainders(std::vector<CauseFound>* causes) {
  constexpr double kShape = 0.03, kCandidate = 0.1;  // of the relative's evidence
  std::vector<CauseFound> kept;
  for (CauseFound& cause : *causes) {
    CauseFound* relative = nullptr;
    for (CauseFound& other : kept)
      if (AreRelated(other.cause, cause.cause) && AxesMeet(other.axis, cause.axis) &&
          cause.delta_log_likelihood < kCandidate * other.delta_log_likelihood) {
        relative = &other;
        break;
      }
    if (relative == nullptr) {
      kept.push_back(std::move(cause));
      continue;
    }
    if (cause.delta_log_likelihood < kShape * relative->delta_log_likelihood) {
      char size[32];
      std::snprintf(size, sizeof size, "%.2g", cause.size_um);
      relative->shape +=
          "; what its shape leaves, " + std::string(size) + " um, looks like " + cause.cause;
      continue;
    }
    const std::string name = relative->cause;
    kept.push_back(std::move(cause));
    auto& candidates = kept.back().candidates;
    if (std::find(candidates.begin(), candidates.end(), name) == candidates.end())
      candidates.push_back(name);
  }
  *causes = std::move(kept);
}

void JudgeSeries(std::vector<CauseFound>* causes, std::vector<UnknownFound>* unknown) {
  constexpr std::size_t kSeries = 3;
  for (const char* axis : {"theta", "phi"}) {
    std::vector<CauseFound*> members;
    double square = 0;
    for (CauseFound& cause : *causes)
      if (cause.axis == axis && Has(kAngles, cause.cause)) {
        members.push_back(&cause);
        square += cause.size_um * cause.size_um;
      }
    if (members.size() < kSeries) continue;
    for (CauseFound* one : members)
      for (const CauseFound* other : members)
        if (std::find(one->candidates.begin(), one->candidates.end(), other->cause) ==
            one->candidates.end())
          one->candidates.push_back(other->cause);
    unknown->push_back(
        {std::string(axis) + "_cmd_deg", std::string(axis) + " angle", 0, std::sqrt(square)});
  }
}

}  // namespace focalfleet::sim
