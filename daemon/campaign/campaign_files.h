// The two tables of a campaign (docs/files.md): moves.csv and units.csv, text to values and back.
// sim/ knows no tables and fleet/ no campaigns, so that the door between them stands here. The
// units' table is fleet's (fleet/files/layout_file.h); here it is only turned into the plain
// values that sim/ takes.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"
#include "sim/campaigns/campaign/campaign.h"

namespace focalfleet {

/// One table each, with the names that error messages call them.
struct CampaignTables {
  std::string_view moves;
  std::string_view units;
  std::string moves_file = "moves.csv";
  std::string units_file = "units.csv";
  std::string name = "campaign";
};

/// Notes on the tables, which are no errors.
struct TableNotes {
  // Columns that nobody reads, as messages call them; where words stand among the numbers of one,
  // with the line of the first.
  std::vector<std::string> ignored_of_moves;
  std::vector<std::string> ignored_of_units;
  std::size_t rows_out_of_order = 0;  // of moves.csv, behind a later move of their unit
};

/// A unit that has moves must stand in units.csv; one that has none is left out. Rows may stand in
/// any order (move_order.h). A column of moves.csv that nobody knows is a covariate where it holds
/// numbers or flags alone. `notes`: if wanted. Errors: kInvalid with file:line: column: reason, of
/// all rows.
Result<sim::Campaign> ReadCampaign(const CampaignTables& tables, TableNotes* notes = nullptr);

/// Every column; reads back equal.
std::string WriteMoves(const sim::Campaign& campaign);
std::string WriteCampaignUnits(const sim::Campaign& campaign);

}  // namespace focalfleet
