// Transmission error of gears that do not run true, as a function of the arm's angle.
#include <algorithm>
#include <cmath>

#include "tests/hidden/generator/along_track.h"

namespace focalfleet::hidden {

namespace {

// A gear turns about a point beside its centre. Seen from there its rim runs by the sine rule, so
// that the angle is an arcsine of a sine, not a sine. `ratio`: turns of this gear per turn of the
// output.
double OffCentre(double offset_share, double ratio, double output_rad, double phase_rad) {
  const double reach = std::clamp(offset_share, -0.95, 0.95);
  return std::asin(reach * std::sin(ratio * output_rad + phase_rad)) / ratio / kDegree;
}

void Eccentricity(const Scene&, const Effect& effect, std::size_t unit, Track* track) {
  const double share = effect.Amount(unit);
  AddOfAngle(
      effect, [&](double at) { return OffCentre(share, 1, at, effect.phase_rad[unit]); }, track);
}

void PinionRunout(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const double share = effect.Amount(unit);
  const double ratio = HasSpur(scene, unit, effect.axis) ? kSpur : kStage;
  AddOfAngle(
      effect, [&](double at) { return OffCentre(share, ratio, at, effect.phase_rad[unit]); },
      track);
}

void StageRipple(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const double share = effect.Amount(unit);
  const double base = HasSpur(scene, unit, effect.axis) ? kSpur : 1;
  const double stages = 1 + std::floor(2.999 * effect.shape[0]);  // 1, 2 or 3 stages up
  const double ratio = base * std::pow(kStage, stages);
  AddOfAngle(
      effect,
      // Sizes at the arm are alike from stage to stage, so that a stage's own runout grows with the
      // ratio.
      [&](double at) {
        return OffCentre(std::min(0.9, share * ratio), ratio, at, effect.phase_rad[unit]);
      },
      track);
}

// Pitch errors are tooth by tooth: a rounded triangle at the mesh order. Its depth changes once a
// turn as an eccentric carrier presses the teeth together.
void ToothMesh(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const double depth_deg = effect.Amount(unit);
  const double order = HasSpur(scene, unit, effect.axis) ? 45 : 46;
  const double modulation = 0.3 * effect.shape[0];
  AddOfAngle(
      effect,
      [&](double at) {
        const double wave = order * at + effect.phase_rad[unit];
        const double tooth = std::asin(0.85 * std::sin(wave)) / std::asin(0.85);
        return depth_deg * tooth * (1 + modulation * std::cos(at - effect.phase_rad[unit]));
      },
      track);
}

// A bad tooth of the pinion lifts the mesh whenever it passes.
void ToothDamage(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const double height_deg = effect.Amount(unit);
  const double ratio = HasSpur(scene, unit, effect.axis) ? kSpur : 1;
  const double width_rad = (10 + 14 * effect.shape[0]) * kDegree;
  AddOfAngle(
      effect,
      [&](double at) {
        const double off = ratio * at - effect.phase_rad[unit];
        return height_deg * std::exp((std::cos(off) - 1) / (width_rad * width_rad));
      },
      track);
}

// The arm presses on its stop's cushion before the end of its range.
void HardStop(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const double softness = effect.Amount(unit);
  const Unit& self = scene.campaign->units[unit];
  const double before_deg = 4 + 16 * effect.shape[0];
  const std::size_t a = effect.axis;
  const bool upper = effect.shape[1] < 0.5;
  const double contact_deg = upper ? self.max_deg[a] - before_deg : self.min_deg[a] + before_deg;
  AddOfAngle(
      effect,
      [&](double at) {
        const double into = upper ? at / kDegree - contact_deg : contact_deg - at / kDegree;
        if (into <= 0) return 0.0;
        const double back = softness * into * into / (into + 0.7);
        return upper ? -back : back;
      },
      track);
}

}  // namespace

std::vector<EffectKind> GearEffects() {
  const std::vector<Owner> mechanical = {Owner::kUnit, Owner::kPlate};
  return {
      {"eccentricity",
       Stage::kGear,
       AxisUse::kEither,
       1.5e-3,
       "offset per radius",
       60,
       false,
       mechanical,
       {},
       2,
       false,
       Eccentricity},
      {"pinion_runout",
       Stage::kGear,
       AxisUse::kEither,
       2e-3,
       "offset per radius",
       60,
       false,
       mechanical,
       {},
       2,
       false,
       PinionRunout},
      {"stage_ripple",
       Stage::kGear,
       AxisUse::kEither,
       3e-4,
       "rad at the arm",
       60,
       false,
       mechanical,
       {},
       2,
       false,
       StageRipple},
      {"tooth_mesh",
       Stage::kGear,
       AxisUse::kEither,
       0.02,
       "deg",
       60,
       false,
       mechanical,
       {},
       2,
       false,
       ToothMesh},
      {"tooth_damage",
       Stage::kGear,
       AxisUse::kEither,
       0.08,
       "deg",
       40,
       true,
       mechanical,
       {},
       2,
       false,
       ToothDamage},
      {"hard_stop",
       Stage::kGear,
       AxisUse::kEither,
       0.01,
       "share of the way into the cushion",
       60,
       false,
       mechanical,
       {},
       1,
       false,
       HardStop},
  };
}

}  // namespace focalfleet::hidden
