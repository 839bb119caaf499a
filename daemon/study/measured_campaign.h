// The commands on a measured campaign share these functions: they read its folder and the given
// models, and run the work on threads.
#pragma once

#include <string>

#include "daemon/campaign/diagnosis_files.h"
#include "daemon/campaign/model_file.h"
#include "daemon/cli/context.h"
#include "protocol/base/result.h"
#include "sim/campaigns/campaign/campaign.h"
#include "sim/campaigns/diagnosis/model/model.h"

namespace focalfleet::cli {

struct MeasuredCampaign {
  sim::Campaign campaign;
  ReportNames names;
};

/// The moves.csv and units.csv of the folder. Reports which columns were ignored, and whether rows
/// had to be sorted.
/// Errors: a file that cannot be read, or is no such table.
Result<MeasuredCampaign> ReadMeasuredCampaign(const Context& context, const std::string& folder);

/// The model for the campaign's units in a model.toml.
/// Errors: as those of its file, as above.
Result<ModelFile> ReadModelFor(const sim::Campaign& campaign, const std::string& file);

/// A loop over `threads` threads; 0: all cores of the machine.
sim::ParallelFor OnThreads(int threads);

}  // namespace focalfleet::cli
