// A campaign as it would be after more moves: the rows that were measured, then those of the moves
// to come. Each new row has the conditions that its move asks for, and all else as it was last.
// Experiments are chosen by what the model's effects do in such rows (next_moves.h).
#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "sim/campaigns/campaign/campaign.h"

namespace focalfleet::sim {

/// The conditions that a move asks for.
struct MoveConditions {
  double drive_amplitude = 1;
  double delay_s = 3;
  double elevation_deg = std::numeric_limits<double>::quiet_NaN();  // NaN: as it is
  bool home_first = false;
};

/// A move of the whole plate, by its units' own angles.
struct PlateMove {
  MoveConditions conditions;
  // Theta and phi. Shape: (units). nullopt: the unit stays where it is.
  std::vector<std::optional<std::array<double, 2>>> to_deg;
};

/// A move as a stance: all units have the same pose, as translated copies of each other. No unit
/// comes near another on the way.
struct ProposedMove {
  double theta_fp_deg = 0;  // where the elbow points, in the plate's frame
  double phi_fp_deg = 90;   // 0 stretches the arm out, 180 folds it back
  std::size_t every = 1;    // one in `every` units of a rail moves; the others stay where they are
  MoveConditions conditions;
  std::string separates = {};  // the causes that the move separates
};

/// Each unit's angles nearest to the stances, 3 degrees clear of its ends.
std::vector<PlateMove> SpreadOver(const std::vector<CampaignUnit>& units,
                                  const std::vector<ProposedMove>& moves);

/// The campaign with new rows for those units that have rows. Drive, delay and homings become
/// columns where they were none; an unknown value is taken as nominal. Places of the new rows are
/// 0.
/// Shape: first_row[u + 1] - moves.size() .. first_row[u + 1] are unit u's new rows.
Campaign Ahead(const Campaign& made, const std::vector<PlateMove>& moves);

}  // namespace focalfleet::sim
