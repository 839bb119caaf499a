#include "sim/hall/diagnosis/outside.h"

#include <cmath>

#include "protocol/base/check.h"

namespace focalfleet::sim {
namespace {

constexpr const char* kAngles[] = {"alpha_deg", "beta_deg", "gamma_deg"};
constexpr const char* kFunctions[] = {"an offset", "alpha",         "beta",
                                      "gamma",     "alpha squared", "beta squared"};
constexpr double kHalfRange_V = 2.5;

}  // namespace

double PoseFunction(int function, const Orientation& reported) {
  switch (function) {
    case 0:
      return 1;
    case 1:
      return reported.alpha_rad;
    case 2:
      return reported.beta_rad;
    case 3:
      return reported.gamma_rad;
    case 4:
      return reported.alpha_rad * reported.alpha_rad;
    default:
      return reported.beta_rad * reported.beta_rad;
  }
}

double OutsideSlope(OutsideKind kind, const OutsideMoment& at) {
  const double filled = at.signal_V / kHalfRange_V;
  switch (kind) {
    case OutsideKind::kPose:
      break;
    case OutsideKind::kHears:
    case OutsideKind::kLag:
      return at.other_V;
    case OutsideKind::kBendsSquare:
      return at.signal_V * filled;
    case OutsideKind::kBendsCube:
      return at.signal_V * filled * filled;
    case OutsideKind::kDrifts:
      return at.share;
    case OutsideKind::kGainDrifts:
      return at.share * at.signal_V;
    case OutsideKind::kFeelsTemperature:
      return at.warm_K;
    case OutsideKind::kGainFeelsTemperature:
      return at.warm_K * at.signal_V;
  }
  FOCALFLEET_CHECK(false);
}

std::vector<OutsideEffect> OutsideEffects(std::size_t sensors, bool has_temperature) {
  std::vector<OutsideEffect> effects;
  for (int angle = 0; angle < 3; ++angle)
    for (int function = 0; function < static_cast<int>(std::size(kFunctions)); ++function) {
      // An offset of gamma is the field's phase, which is free.
      if (angle == 2 && function == 0) continue;
      effects.push_back({.angle = angle, .function = function});
    }
  const int count = static_cast<int>(sensors);
  for (int one = 0; one < count; ++one)
    for (int other = 0; other < count; ++other)
      if (one != other)
        effects.push_back(
            {.kind = OutsideKind::kHears, .sensor = one, .other = static_cast<std::size_t>(other)});
  using enum OutsideKind;
  for (int sensor = -1; sensor < count; ++sensor)
    for (const OutsideKind kind : {kBendsSquare, kBendsCube, kDrifts, kGainDrifts, kLag})
      effects.push_back({.kind = kind, .sensor = sensor});
  // A gain that all sensors share is the field's temperature coefficient.
  for (int sensor = 0; has_temperature && sensor < count; ++sensor)
    for (const OutsideKind kind : {kFeelsTemperature, kGainFeelsTemperature})
      effects.push_back({.kind = kind, .sensor = sensor});
  return effects;
}

std::string Text(const OutsideEffect& effect) {
  const std::string who =
      effect.sensor < 0 ? "all sensors" : "v" + std::to_string(effect.sensor + 1);
  const auto verb = [&](const char* of_one, const char* of_all, const char* what) {
    return who + " " + (effect.sensor < 0 ? of_all : of_one) + " " + what;
  };
  switch (effect.kind) {
    case OutsideKind::kPose:
      return std::string(kAngles[effect.angle]) + " is told wrongly, by " +
             kFunctions[effect.function] +
             (effect.function == effect.angle + 1 ? ": its scale" : "");
    case OutsideKind::kHears:
      return who + " hears v" + std::to_string(effect.other + 1);
    case OutsideKind::kBendsSquare:
      return verb("bends", "bend", "with the field squared");
    case OutsideKind::kBendsCube:
      return verb("bends", "bend", "with the field cubed");
    case OutsideKind::kDrifts:
      return verb("drifts", "drift", "from row to row");
    case OutsideKind::kGainDrifts:
      return verb("changes", "change", "in gain from row to row");
    case OutsideKind::kLag:
      return verb("remembers", "remember", "the row before");
    case OutsideKind::kFeelsTemperature:
      return verb("changes", "change", "in offset with temp_C");
    case OutsideKind::kGainFeelsTemperature:
      return verb("changes", "change", "in gain with temp_C");
  }
  return who;
}

}  // namespace focalfleet::sim
