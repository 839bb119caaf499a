// The two tables of a campaign (docs/files.md): moves.csv and units.csv, text to values and back.
// sim/ knows no tables and fleet/ no campaigns, so that the door between them stands here. The
// units' table is fleet's (fleet/files/layout_file.h); here it is only turned into the plain
// values that sim/ takes.
#pragma once

#include <string>
#include <string_view>

#include "protocol/base/result.h"
#include "sim/campaign/campaign.h"

namespace focalfleet {

/// One table each, with the names that error messages call them.
struct CampaignTables {
  std::string_view moves;
  std::string_view units;
  std::string moves_file = "moves.csv";
  std::string units_file = "units.csv";
  std::string name = "campaign";
};

/// Errors: kInvalid with file:line: column: reason. A unit that has moves must stand in units.csv;
/// one that has none is left out. Rows of units may alternate.
Result<sim::Campaign> ReadCampaign(const CampaignTables& tables);

/// Every column; reads back equal.
std::string WriteMoves(const sim::Campaign& campaign);
std::string WriteCampaignUnits(const sim::Campaign& campaign);

}  // namespace focalfleet
