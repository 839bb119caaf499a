// An effect is one physical way in which a unit, a rail, a bus, the plate or the camera departs
// from ideal kinematics. Its code is a small stateful operator that runs along a unit's moves. The
// operator adds its error to the pose (angles, arms) or to the place of the fibre. Each effect has
// its own file, and the registry (registry.h) lists them all.
//
// An effect offers templates: the same physics on one axis, with one kind of memory. The shape
// parameters of a template (a gap, a time constant, a threshold) are at grid values. A template is
// linear in its amplitudes, so that (sim(+e) - sim(-e)) / 2e is its signature at any e. A template
// has one amplitude, or a few where the phase or the direction is free (sine and cosine).
//
// Angles are in degrees, places in mm; amplitudes are in `amplitude_unit`.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "sim/campaigns/effects/track.h"
#include "sim/campaigns/effects/traits.h"

namespace focalfleet::sim {

/// The errors that an effect makes in every move of one unit.
struct PoseErrors {
  std::vector<double> angle_deg[2];
  std::vector<double> arm_mm[2];
  std::vector<double> x_mm;
  std::vector<double> y_mm;
  void Reset(std::size_t moves);
  /// All channels, always in the same order.
  std::array<std::vector<double>*, 6> channels();
  [[nodiscard]] std::array<const std::vector<double>*, 6> channels() const;
};

enum class EffectAxis { kTheta, kPhi, kBoth, kNone };
/// The part that has the effect, unless the data show otherwise.
enum class Owner { kUnit, kRail, kBus, kPlate, kCamera };

/// The fate of an error between the moves that make it.
enum class Memory {
  kHold,   // stays until the axis moves again
  kNow,    // is there after the move that made it, and gone after the next exposure
  kChain,  // adds up, open loop, until the unit is homed
};

inline constexpr std::size_t kColumnsMax = 8;

struct Effect;

/// A column's value and its rank, 0..1, among the rows of the campaign that it was taken from.
struct RankKnot {
  double value = 0;
  double rank = 0;
};

/// The errors that a template's columns make at every row of one campaign, where no formula gives
/// them.
struct ErrorTable {
  std::vector<PoseErrors> columns;  // each of all rows
};

struct Template {
  const Effect* effect = nullptr;
  EffectAxis axis = EffectAxis::kNone;
  std::size_t columns = 1;
  Memory memory = Memory::kHold;
  int form = 0;      // of the effect's own forms
  double shape = 0;  // of the effect's own shape parameter
  // Shape by unit_id, where each unit has its own. Other units do not have the effect.
  std::map<std::uint32_t, double> shape_of_unit;
  double choices = 1;    // number of shapes that it, or each unit's, was chosen from
  bool between = false;  // refined between the listed shapes
  std::string label;     // the shape in words
  // The column that an empirical term (empirical.h) depends on, and the knots of its curve,
  // ascending. Without knots the term uses the campaign's own ranks.
  std::string covariate;
  std::vector<RankKnot> knots;
  const ErrorTable* table = nullptr;  // for ApplyTable
};

using Templates = std::vector<Template>;

/// The ways in which the true shape of an effect may differ from the library's: factors of the
/// effect's own error, each without the part that is the error itself.
enum class Distortion : std::uint8_t {
  kOwn,        // another amplitude in each unit
  kBend,       // by another power: more or less than in proportion where the error is large
  kDrive,      // by the amplitude of the drive
  kDirection,  // by the direction of the axis' last move
  kCosine,     // by the axis' angle
  kSine,
};
inline constexpr Distortion kOfAnyEffect[] = {Distortion::kOwn, Distortion::kBend,
                                              Distortion::kDrive};
/// The way of an effect in proportion to a count of teeth or steps: no other shape is possible.
inline constexpr Distortion kOfCounts[] = {Distortion::kOwn};
/// The ways of effects that moves make: friction, play and load differ with direction and angle.
/// The bend is last, for effects whose shape says already how they grow.
inline constexpr Distortion kOfMoves[] = {Distortion::kOwn,       Distortion::kDrive,
                                          Distortion::kDirection, Distortion::kCosine,
                                          Distortion::kSine,      Distortion::kBend};

struct Effect {
  std::string_view cause;  // id of docs/diagnosis.md
  std::string_view amplitude_unit;
  double prior_size;  // the usual size of an amplitude
  Owner owner;
  std::vector<std::string_view> needs;  // covariates
  std::string_view paragraph;           // for the operator
  void (*list)(const CampaignFacts&, Templates*);
  void (*apply)(const UnitTrack&, const Template&, std::span<const double> amplitude, PoseErrors*);
  // Whether this form depends on the unit's own poses alone, and moves nothing but the unit: it
  // reads no column, not even a computed one. nullptr: no form does.
  bool (*of_poses_alone)(const Template&) = nullptr;
  // Adds shapes beside the listed ones, of one column, on each axis that `list` has. They are too
  // many to score each (quick_look.h). nullptr: the effect has no more.
  void (*glance)(Templates*) = nullptr;
  // Adds shapes of this period along the commanded angle. nullptr: the effect has no period.
  void (*of_period)(double period_deg, Templates*) = nullptr;
  // Shapes between the listed ones exist, too: the best of the list is a place to begin at.
  bool continuous_shape = false;
  bool one_is_enough = false;  // one of `needs` is enough, as each belongs to one axis
  // Each unit may have a shape of its own, as it has its own teeth. Pre: a unit is the owner.
  bool own_shape = false;
  // The form whose units' shapes are found from the moves before the search. -1: none.
  int form_of_found_shapes = -1;
  // Amplitudes that physics allows. 0 and 0: up to a hundred times the usual size either way.
  double amplitude_low = 0;
  double amplitude_high = 0;
  double amplitude_least = 0;  // a smaller amplitude, either way, is another effect
  // The shape is an amplitude too: a play of two degrees loses two degrees, and both agree within a
  // factor of five. Shape 0 stands for any that is below all moves.
  bool amplitude_is_shape = false;
  // How much the effect of a real part differs from this shape, as a share of its amplitude (one
  // sigma). Sizes found in another author's plant scatter so much about the planted ones. In 54 of
  // its campaigns intervals of 95 % cover 26 of 29 amplitudes, 24 with half of it or none, 27 with
  // twice as much.
  double discrepancy = 0.08;
  // The ways in which it differs (diagnosis/model/discrepancy.h).
  std::span<const Distortion> distortions = kOfAnyEffect;
  // Whether the moves can distinguish this shape. nullptr: any moves can.
  bool (*shows)(const Template&, const CampaignFacts&) = nullptr;
  // Causes whose trace this one may pass for where one of `needs` is missing from the campaign.
  std::vector<std::string_view> passes_for = {};
  Traits traits = {};
};

/// The `of_poses_alone` of an effect whose forms are all so.
inline bool EachForm(const Template& /*form*/) { return true; }
/// Whether the form depends on the unit's own poses alone (Effect::of_poses_alone).
bool IsOfPosesAlone(const Template& form);

/// Whether these moves can distinguish the effect's own shape.
bool Shows(const CampaignFacts& facts, const Template& form);

/// The range of a template's amplitude: by physics, or a hundred times its usual size.
struct AmplitudeRange {
  double low = 0;
  double high = 0;
};
AmplitudeRange RangeOfAmplitude(const Effect& effect);
/// Whether the template can have an amplitude within some sigmas of this one. Pre: one column.
bool CanBe(const Template& form, double amplitude, double sigmas);

/// Adds the template's errors at these amplitudes, by the loop that was closed or open
/// (closed_loop.h). Shape: amplitude (columns).
void AddErrors(const UnitTrack& track, const Template& form, std::span<const double> amplitude,
               PoseErrors* errors);

/// Sets `errors` to those of one column at the given amplitude, with the other amplitudes at 0.
void ApplyColumn(const UnitTrack& track, const Template& form, std::size_t column, double amplitude,
                 PoseErrors* errors);

/// The `apply` of an effect whose columns are form.table. Pre: the track is of the table's
/// campaign.
void ApplyTable(const UnitTrack& track, const Template& form, std::span<const double> amplitude,
                PoseErrors* errors);

std::string_view Name(EffectAxis axis);
std::string_view Name(Owner owner);
std::string_view Name(Memory memory);
/// Index of the axis whose angle the template changes. Pre: kTheta or kPhi.
std::size_t AxisIndex(const Template& form);
/// The axes that the template changes. Pre: not kNone.
std::span<const std::size_t> AxesOf(const Template& form);

// ---- For the files of effects.

/// A grid makes one copy of `prototype` for each axis, memory and shape.
struct Grid {
  std::vector<EffectAxis> axes = {EffectAxis::kTheta, EffectAxis::kPhi};
  std::vector<Memory> memories = {Memory::kHold};
  std::vector<double> shapes = {0};
  std::string_view shape_name = "";  // "travel of %s deg" without the number: "travel, deg"
  int form = 0;
  std::size_t columns = 1;
};
void ListGrid(const Grid& grid, Templates* out);
/// The same template at another shape, with the shape in its label. Pre: the label ends in the
/// shape.
Template WithShape(const Template& form, double shape);
/// The same template with a shape for each unit. Pre: the label ends in the shape.
Template WithShapes(const Template& form, std::map<std::uint32_t, double> shape_of_unit);
/// The shape that this unit has; nullopt where the unit does not have the effect.
std::optional<double> ShapeOf(const Template& form, std::uint32_t unit_id);

/// Adds `made(i)` of each move of the axis to angle_deg[axis], remembered as `memory` says.
template <class Made>
void AddRemembered(const UnitTrack& track, std::size_t moving_axis, Memory memory, Made&& made,
                   std::vector<double>* angle_deg) {
  double state = 0;
  for (std::size_t i = 0; i < track.moves; ++i) {
    if (track.restarts[i]) state = 0;
    if (track.step_deg[moving_axis][i] != 0) {
      const double value = made(i);
      state = memory == Memory::kChain ? state + value : value;
    } else if (memory == Memory::kNow && !track.IsBeginning(i)) {
      state = 0;
    }
    (*angle_deg)[i] += state;
  }
}

/// Direction of the move, as a factor. Pre: the axis moves.
inline double Direction(double step_deg) { return step_deg > 0 ? 1.0 : -1.0; }

}  // namespace focalfleet::sim
