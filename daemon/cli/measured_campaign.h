// What the commands on a measured campaign have in common: its folder, the models that they are
// given, and the threads that they run on.
#pragma once

#include <string>

#include "daemon/campaign/diagnosis_files.h"
#include "daemon/campaign/model_file.h"
#include "daemon/cli/context.h"
#include "protocol/base/result.h"
#include "sim/campaigns/campaign/campaign.h"
#include "sim/campaigns/diagnosis/model.h"

namespace focalfleet::cli {

struct MeasuredCampaign {
  sim::Campaign campaign;
  ReportNames names;
};

/// moves.csv and units.csv of the folder. Tells which columns of them were passed over, and
/// whether rows had to be sorted. Errors: a
/// file that cannot be read, or is no such table.
Result<MeasuredCampaign> ReadMeasuredCampaign(const Context& context, const std::string& folder);

/// Errors: as above, of a model.toml for the campaign's units.
Result<ModelFile> ReadModelFor(const sim::Campaign& campaign, const std::string& file);

/// 0: as many as the machine has.
sim::ParallelFor OnThreads(int threads);

}  // namespace focalfleet::cli
