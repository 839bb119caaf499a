// The two tables of a campaign (docs/files.md) are moves.csv and units.csv. This header turns their
// text into values and back.
//
// sim/ has no tables and fleet/ has no campaigns, so the conversion stands here. The layer fleet
// parses the units' table (fleet/files/layout_file.h); here it only becomes the plain values that
// sim/ takes.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"
#include "sim/campaigns/campaign/campaign.h"

namespace focalfleet {

/// The text of both tables, with the names that error messages use for them.
struct CampaignTables {
  std::string_view moves;
  std::string_view units;
  std::string moves_file = "moves.csv";
  std::string units_file = "units.csv";
  std::string name = "campaign";
};

/// Notes on the tables that are no errors.
struct TableNotes {
  // Columns that are not read, as messages name them. Where words stand among the numbers of a
  // column, the line of the first word is given too.
  std::vector<std::string> ignored_of_moves;
  std::vector<std::string> ignored_of_units;
  std::size_t rows_out_of_order = 0;  // of moves.csv, behind a later move of their unit
};

/// The campaign in both tables. A unit that has moves must stand in units.csv; a unit without moves
/// is left out. Rows may stand in any order (move_order.h). An unknown column of moves.csv is a
/// covariate where it holds numbers or flags alone. `notes` may be null.
/// Errors: kInvalid with file:line: column: reason, of all rows.
Result<sim::Campaign> ReadCampaign(const CampaignTables& tables, TableNotes* notes = nullptr);

/// moves.csv with every column; reading it back gives an equal campaign.
std::string WriteMoves(const sim::Campaign& campaign);
std::string WriteCampaignUnits(const sim::Campaign& campaign);

}  // namespace focalfleet
