// Mode threshold: some moves run in another mode: short ones, or those that the campaign's column
// says it of.
#include <cmath>
#include <vector>

#include "sim/campaigns/effects/registry.h"

namespace focalfleet::sim {
namespace {

// Forms from here on: the travel in a mode of kDriveModes, by its index.
constexpr int kOfMode = 2;

void ListModeThreshold(const CampaignFacts& facts, Templates* out) {
  const std::vector<double> lengths_deg = {1, 2, 3, 5, 10, 20, 40};
  ListGrid({.memories = {Memory::kHold, Memory::kNow},
            .shapes = lengths_deg,
            .shape_name = "below, deg,"},
           out);
  // Memory kChain: the travel that a move lacks in the other mode adds up.
  ListGrid({.memories = {Memory::kHold, Memory::kNow, Memory::kChain},
            .shapes = lengths_deg,
            .shape_name = "along the motion; below, deg,",
            .form = 1},
           out);
  const FilledColumn* mode = facts.Find(kMode);
  if (mode == nullptr || !mode->varies()) return;
  for (std::size_t k = 0; k < kDriveModes.size(); ++k) {
    const std::size_t begin = out->size();
    ListGrid({.memories = {Memory::kHold, Memory::kNow, Memory::kChain},
              .form = kOfMode + static_cast<int>(k)},
             out);
    for (std::size_t t = begin; t < out->size(); ++t)
      (*out)[t].label += "; along the motion in mode " + std::string(kDriveModes[k]);
  }
}

bool ReadsNoMode(const Template& form) { return form.form < kOfMode; }

// Shows what the mode's column says. An error of nearly all moves is another cause's, and so is one
// of hardly any.
bool ShowsMode(const Template& form, const CampaignFacts& facts) {
  constexpr double kRare = 0.1;  // of the rows. Half and twice of it: more or fewer of such shapes
  double rows = 0;
  const FilledColumn& mode = *facts.Find(kMode);
  for (const double value : mode.values) rows += value == form.form - kOfMode ? 1 : 0;
  const double share = rows / static_cast<double>(mode.values.size());
  return share > kRare && share < 1 - kRare;
}

// An error that adds up in nearly all moves belongs to another cause: most moves have to be longer
// than the threshold.
bool ShowsModeThreshold(const Template& form, const CampaignFacts& facts) {
  constexpr double kLonger = 0.7;  // of the axis' moves
  if (!ReadsNoMode(form)) return ShowsMode(form, facts);
  if (form.memory != Memory::kChain) return true;
  double moves = 0, longer = 0;
  for (const double step : facts.step_deg[AxisIndex(form)]) {
    moves += step != 0 ? 1 : 0;
    longer += std::abs(step) >= form.shape ? 1 : 0;
  }
  return longer >= kLonger * moves;
}

void ApplyModeThreshold(const UnitTrack& track, const Template& form,
                        std::span<const double> amplitude, PoseErrors* errors) {
  const std::size_t axis = AxisIndex(form);
  const std::span<const double> step = track.step_deg[axis];
  const bool by_column = !ReadsNoMode(form);
  if (by_column && !track.facts->Has(kMode)) return;  // a model of another campaign
  const std::span<const double> mode = by_column ? track.Column(kMode) : step;
  AddRemembered(
      track, axis, form.memory,
      [&](std::size_t i) {
        const bool differs =
            by_column ? mode[i] == form.form - kOfMode : std::abs(step[i]) < form.shape;
        return differs ? amplitude[0] * (form.form == 0 ? 1.0 : Direction(step[i])) : 0.0;
      },
      &errors->angle_deg[axis]);
}

}  // namespace

Effect MakeModeThreshold() {
  return {.cause = "mode_threshold",
          .amplitude_unit = "deg",
          .prior_size = 0.02,
          .owner = Owner::kUnit,
          .needs = {},
          .paragraph =
              "Moves below a length run in another mode of the firmware (creep instead of "
              "cruise), which ends a little elsewhere: the error steps at that length.",
          .list = ListModeThreshold,
          .apply = ApplyModeThreshold,
          .of_poses_alone = ReadsNoMode,
          .continuous_shape = true,
          .distortions = kOfMoves,
          .shows = ShowsModeThreshold};
}

}  // namespace focalfleet::sim
