// model.toml read back: fitted geometry and effects, for a campaign's units. Units that the model
// does not know keep the table's geometry and have no effects.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"
#include "sim/campaigns/diagnosis/left_by.h"
#include "sim/campaigns/diagnosis/model.h"

namespace focalfleet {

/// A model with what its file says beside it.
struct ModelFile {
  sim::CampaignModel model;
  std::string campaign;  // that it was found in; empty: it does not say
  std::string campaign_sha256;
  std::string verdict;
  double rms_before_um = 0;  // on moves that no fit has seen; NaN: it does not say
  double rms_after_um = 0;
  std::size_t units_known = 0;                       // of those that it was read for
  std::vector<std::vector<std::string>> candidates;  // of each term, its rivals; empty: none
  /// How the campaign left each unit; none: it did not measure it. Shape: (units).
  std::vector<std::optional<sim::UnitLeft>> left;
};

/// Errors: kInvalid with file and line where the text is no TOML; a key that is missing or wrong,
/// an effect that the library does not have, or not in that axis, form, memory and number of
/// columns, amplitudes that are not as many as its units or beyond what their effect can have, arms
/// or bases that are those of another unit.
Result<ModelFile> ReadModelFile(std::string_view text, const std::string& file,
                                const std::vector<sim::CampaignUnit>& units);

}  // namespace focalfleet
