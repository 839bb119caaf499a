#include "sim/campaigns/effects/effect.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "sim/campaigns/effects/closed_loop.h"

namespace focalfleet::sim {

void PoseErrors::Reset(std::size_t moves) {
  for (std::vector<double>* channel : channels()) channel->assign(moves, 0);
}

std::array<std::vector<double>*, 6> PoseErrors::channels() {
  return {&angle_deg[kTheta], &angle_deg[kPhi], &arm_mm[kTheta], &arm_mm[kPhi], &x_mm, &y_mm};
}

std::array<const std::vector<double>*, 6> PoseErrors::channels() const {
  return {&angle_deg[kTheta], &angle_deg[kPhi], &arm_mm[kTheta], &arm_mm[kPhi], &x_mm, &y_mm};
}

void ApplyTable(const UnitTrack& track, const Template& form, std::span<const double> amplitude,
                PoseErrors* errors) {
  const auto to = errors->channels();
  for (std::size_t c = 0; c < form.columns; ++c) {
    if (amplitude[c] == 0) continue;
    const auto from = form.table->columns[c].channels();
    for (std::size_t k = 0; k < to.size(); ++k)
      for (std::size_t i = 0; i < track.moves; ++i)
        (*to[k])[i] += amplitude[c] * (*from[k])[track.first_row + i];
  }
}

std::string_view Name(EffectAxis axis) {
  switch (axis) {
    case EffectAxis::kTheta:
      return "theta";
    case EffectAxis::kPhi:
      return "phi";
    case EffectAxis::kBoth:
      return "both";
    case EffectAxis::kNone:
      break;
  }
  return "none";
}

std::string_view Name(Owner owner) {
  switch (owner) {
    case Owner::kRail:
      return "rail";
    case Owner::kBus:
      return "bus";
    case Owner::kPlate:
      return "plate";
    case Owner::kCamera:
      return "camera";
    case Owner::kUnit:
      break;
  }
  return "unit";
}

std::string_view Name(Memory memory) {
  switch (memory) {
    case Memory::kNow:
      return "for one exposure";
    case Memory::kChain:
      return "adding up";
    case Memory::kHold:
      break;
  }
  return "until the next move";
}

AmplitudeRange RangeOfAmplitude(const Effect& effect) {
  constexpr double kTimes = 100;
  if (effect.amplitude_low < effect.amplitude_high)
    return {effect.amplitude_low, effect.amplitude_high};
  return {-kTimes * effect.prior_size, kTimes * effect.prior_size};
}

bool CanBe(const Template& form, double amplitude, double sigmas) {
  constexpr double kFactor = 5;
  auto [low, high] = RangeOfAmplitude(*form.effect);
  double least = form.effect->amplitude_least;
  if (form.effect->amplitude_is_shape && form.shape > 0) {
    least = form.shape / kFactor;
    high = std::min(high, kFactor * form.shape), low = std::max(low, -kFactor * form.shape);
  }
  return amplitude >= low - sigmas && amplitude <= high + sigmas &&
         std::abs(amplitude) >= least - sigmas;
}

void AddErrors(const UnitTrack& track, const Template& form, std::span<const double> amplitude,
               PoseErrors* errors) {
  // Tables are of what a row shows, whichever loop it had.
  if (track.beginnings == nullptr || form.table != nullptr)
    return form.effect->apply(track, form, amplitude, errors);
  PoseErrors along;
  along.Reset(track.beginnings->track.moves);
  form.effect->apply(track.beginnings->track, form, amplitude, &along);
  AddDifferences(track, along, errors);
}

void ApplyColumn(const UnitTrack& track, const Template& form, std::size_t column, double amplitude,
                 PoseErrors* errors) {
  double amplitudes[kColumnsMax] = {};
  amplitudes[column] = amplitude;
  errors->Reset(track.moves);
  AddErrors(track, form, std::span(amplitudes).first(form.columns), errors);
}

std::size_t AxisIndex(const Template& form) {
  return form.axis == EffectAxis::kPhi ? kPhi : kTheta;
}

std::span<const std::size_t> AxesOf(const Template& form) {
  static constexpr std::size_t kAxes[] = {kTheta, kPhi};
  if (form.axis == EffectAxis::kBoth) return kAxes;
  return std::span(kAxes).subspan(AxisIndex(form), 1);
}

bool IsOfPosesAlone(const Template& form) {
  return form.effect->of_poses_alone != nullptr && form.effect->of_poses_alone(form);
}

bool Shows(const CampaignFacts& facts, const Template& form) {
  return form.effect->shows == nullptr || form.effect->shows(form, facts);
}

void ListGrid(const Grid& grid, Templates* out) {
  for (const EffectAxis axis : grid.axes)
    for (const Memory memory : grid.memories)
      for (const double shape : grid.shapes) {
        Template made{.axis = axis,
                      .columns = grid.columns,
                      .memory = memory,
                      .form = grid.form,
                      .shape = shape};
        made.label = Name(memory);
        if (!grid.shape_name.empty()) {
          char text[96];
          std::snprintf(text, sizeof text, "; %.*s %.4g", static_cast<int>(grid.shape_name.size()),
                        grid.shape_name.data(), shape);
          made.label += text;
        }
        out->push_back(std::move(made));
      }
}

Template WithShape(const Template& form, double shape) {
  Template other = form;
  other.shape = shape;
  char text[32];
  std::snprintf(text, sizeof text, " %.4g", shape);
  other.label = form.label.substr(0, form.label.rfind(' ')) + text;
  return other;
}

Template WithShapes(const Template& form, std::map<std::uint32_t, double> shape_of_unit) {
  Template other = form;
  other.shape = 0;
  other.shape_of_unit = std::move(shape_of_unit);
  other.label = form.label.substr(0, form.label.rfind(' ')) + " of each unit's own";
  return other;
}

std::optional<double> ShapeOf(const Template& form, std::uint32_t unit_id) {
  if (form.shape_of_unit.empty()) return form.shape;
  const auto own = form.shape_of_unit.find(unit_id);
  if (own == form.shape_of_unit.end()) return std::nullopt;
  return own->second;
}

}  // namespace focalfleet::sim
