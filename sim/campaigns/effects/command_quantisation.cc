// Command quantisation: commands are rounded.
#include <array>
#include <cmath>

#include "sim/campaigns/effects/registry.h"

namespace focalfleet::sim {
namespace {

enum class Step { kDegrees, kMotorTurns, kBits };
enum class Rounding {
  kNearest,
  kCutMove,
  kDown,
  kTowardsZero,
  kCutMean,  // moves are cut to a step that they do not show: half a step is lost in each, on
             // average
};
/// A template's form is its index in the table, and model files store it.
struct RoundingForm {
  Step step;
  Rounding rounding;
  std::string_view name;
};
constexpr std::array kForms = {
    RoundingForm{Step::kDegrees, Rounding::kNearest, "step, deg,"},
    RoundingForm{Step::kDegrees, Rounding::kCutMove, "moves are cut; step, deg,"},
    RoundingForm{Step::kMotorTurns, Rounding::kNearest, "steps a motor turn:"},
    RoundingForm{Step::kBits, Rounding::kNearest, "bits a turn:"},
    RoundingForm{Step::kBits, Rounding::kCutMove, "moves are cut; bits a turn:"},
    RoundingForm{Step::kDegrees, Rounding::kDown, "rounded down; step, deg,"},
    RoundingForm{Step::kBits, Rounding::kDown, "rounded down; bits a turn:"},
    RoundingForm{Step::kDegrees, Rounding::kCutMean, "moves are cut; on average; step, deg,"},
    RoundingForm{Step::kDegrees, Rounding::kTowardsZero, "cut towards zero; step, deg,"},
};

std::vector<double> ShapesOf(const RoundingForm& form) {
  const Step step = form.step;
  // An amplitude of 0.5 to 1.5 reaches from each of these to the next.
  // A step of more than 0.1 deg would show: what is cut off scatters by a step / sqrt(12), 0.03 deg
  // then, as much as 3 um of a camera do at 6 mm. A list up to half or double of 0.064 changes no
  // candidate in 92 campaigns of another author. With the half, one of three planted steps of
  // 0.038 deg is ramp_travel for sure, with the double none.
  if (form.rounding == Rounding::kCutMean) return {0.001, 0.002, 0.004, 0.008, 0.016, 0.032, 0.064};
  if (step == Step::kMotorTurns) return {1, 4, 24, 96};
  if (step == Step::kBits) return {9, 10, 11, 12, 13, 14};
  return {0.01, 0.02, 0.025, 0.04, 0.05, 0.08, 0.1, 0.2, 0.25, 0.4, 0.5, 0.8, 1, 1.6, 2};
}

bool IsCut(const RoundingForm& form) {
  return form.rounding == Rounding::kCutMove || form.rounding == Rounding::kCutMean;
}

// The whole steps that the controller takes of so many.
double WholeSteps(Rounding rounding, double steps) {
  if (rounding == Rounding::kDown) return std::floor(steps);
  return rounding == Rounding::kTowardsZero ? std::trunc(steps) : std::round(steps);
}

double Step_deg(const RoundingForm& form, double shape, double gear) {
  if (form.step == Step::kMotorTurns) return 360 / (shape * gear);
  return form.step == Step::kBits ? 360 / std::exp2(shape) : shape;
}

void ListCommandQuantisation(const CampaignFacts&, Templates* out) {
  for (std::size_t k = 0; k < kForms.size(); ++k)
    ListGrid(
        {.shapes = ShapesOf(kForms[k]), .shape_name = kForms[k].name, .form = static_cast<int>(k)},
        out);
}

// Templates for any whole number of hundredths, and for bits beyond the usual.
void Glance(Templates* out) {
  constexpr int kHundredthsMax = 200;
  std::vector<double> hundredths, bits;
  for (int k = 1; k <= kHundredthsMax; ++k) hundredths.push_back(k / 100.0);
  for (const double k : {7, 8, 15, 16, 17}) bits.push_back(k);
  for (std::size_t k = 0; k < kForms.size(); ++k) {
    if (IsCut(kForms[k]) || kForms[k].step == Step::kMotorTurns) continue;
    ListGrid({.shapes = kForms[k].step == Step::kBits ? bits : hundredths,
              .shape_name = kForms[k].name,
              .form = static_cast<int>(k)},
             out);
  }
}

// The template of a step of any size.
void OfPeriod(double period_deg, Templates* out) {
  for (std::size_t k = 0; k < kForms.size(); ++k)
    if (kForms[k].step == Step::kDegrees && !IsCut(kForms[k]))
      ListGrid({.shapes = {period_deg}, .shape_name = kForms[k].name, .form = static_cast<int>(k)},
               out);
}

void ApplyCommandQuantisation(const UnitTrack& track, const Template& form,
                              std::span<const double> amplitude, PoseErrors* errors) {
  const std::size_t axis = AxisIndex(form);
  const RoundingForm& kind = kForms[static_cast<std::size_t>(form.form)];
  const std::optional<double> shape = ShapeOf(form, track.unit->id);
  if (!shape || !(*shape > 0)) return;
  const double step_deg = Step_deg(kind, *shape, track.unit->gear[axis]);
  double behind_deg = 0;
  for (std::size_t i = 0; i < track.moves; ++i) {
    if (track.restarts[i]) behind_deg = 0;
    const double q = track.cmd_deg[axis][i];
    const double move = track.step_deg[axis][i];
    behind_deg += kind.rounding == Rounding::kCutMean && move != 0
                      ? -Direction(move) * std::min(step_deg / 2, std::abs(move))
                      : std::trunc(move / step_deg) * step_deg - move;
    const double error =
        IsCut(kind) ? behind_deg : WholeSteps(kind.rounding, q / step_deg) * step_deg - q;
    errors->angle_deg[axis][i] += amplitude[0] * error;
  }
}

}  // namespace

Effect MakeCommandQuantisation() {
  return {.cause = "command_quantisation",
          .amplitude_unit = "steps",
          .prior_size = 1,
          .owner = Owner::kUnit,
          .needs = {},
          .paragraph =
              "The command is rounded, rounded down or cut to a step of the controller, so "
              "that the error is a saw-tooth of the command. It adds up if each move is rounded "
              "by itself.",
          .list = ListCommandQuantisation,
          .apply = ApplyCommandQuantisation,
          .glance = Glance,
          .of_period = OfPeriod,
          .own_shape = true,
          .amplitude_low = 0,
          .amplitude_high = 1.5,
          .amplitude_least = 0.5,
          .distortions = kOfMoves};
}

}  // namespace focalfleet::sim
