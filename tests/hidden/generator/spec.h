// The spec of one campaign of the suite is drawn from (suite seed, index). The spec has the design,
// the plate, the effects and their visibility, the noise, and other errors.
//
// Kinds come in shuffled blocks of twenty. Each block has 4 without an effect, 9 with one, 4 with
// two to four, and 3 with one that no library holds. Single causes come in turns, so that a suite
// of any length covers all of them.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "protocol/base/result.h"
#include "tests/hidden/generator/design.h"
#include "tests/hidden/generator/effect.h"

namespace focalfleet::hidden {

/// Errors beside the effects. All zero in the clean class.
struct Nuisances {
  double outlier_share = 0;   // of rows: spots taken for another's, hot pixels
  double missing_share = 0;   // of places
  double missing_cells = 0;   // of covariate cells
  double tail_freedom = 0;    // Student's t instead of Gauss where > 0
  double unit_spread = 0;     // ln of the noise's size from unit to unit
  double picture_spread = 0;  // and from picture to picture
  double turbulence_um = 0;   // with memory from picture to picture
  double turbulence_memory = 0;
  double night_shift_um = 0;  // the camera was touched half-way
  int wrapped_units = 0;      // commands that lost a whole turn
  int swapped_pairs = 0;
  int stuck_units = 0;
};

/// Errors of units.csv. Standard deviations over units; 0: exact.
struct StaticErrors {
  double base_um = 0;
  double arm_um = 0;
  double zero_deg = 0;
};

struct Spec {
  std::uint64_t seed = 0;  // of this campaign
  Physics physics = Physics::kMechanisms;
  std::string kind;  // null, single, composite, unknown
  bool dirty = false;
  DesignOptions design;
  double centroid_um = 2;
  double actuation_um = 3;  // of one axis at the fibre
  StaticErrors static_errors;
  Nuisances nuisances;
  std::vector<std::string> causes;
  std::vector<double> lambda_wanted;
  bool sigma_column = true;
  bool pixel_columns = false;
  std::vector<std::string> dropped;  // columns
};

/// Choices that a caller may fix; empty and zero: drawn.
struct Wishes {
  Physics physics = Physics::kMechanisms;
  std::string kind;
  std::string cause;
  std::string design;
  std::string purity;  // clean, dirty
  double lambda = 0;
  std::size_t units = 0;
  std::size_t moves = 0;
};

/// The spec of the campaign.
/// Errors: a wish that names what does not exist.
Result<Spec> DrawSpec(std::uint64_t suite_seed, std::uint64_t index, const Wishes& wishes);

/// An effect of this cause: axis, owner, units with it, phases and shape; size 1.
Effect DrawEffect(const EffectKind& kind, const Campaign& campaign, Rng* rng);

}  // namespace focalfleet::hidden
