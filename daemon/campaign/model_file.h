// ReadModelFile reads model.toml back: fitted geometry and effects, for a campaign's units. Units
// that the model does not contain keep the table's geometry and have no effects.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"
#include "sim/campaigns/diagnosis/model/model.h"
#include "sim/campaigns/diagnosis/use/left_by.h"

namespace focalfleet {

/// A model, with what its file states beside it.
struct ModelFile {
  sim::CampaignModel model;
  std::string campaign;  // that it was found in; empty: not stated
  std::string campaign_sha256;
  std::string verdict;
  double rms_before_um = 0;  // on moves that no fit has used; NaN: not stated
  double rms_after_um = 0;
  std::size_t units_known = 0;                       // units of the campaign that the model
                                                     // contains
  std::vector<std::vector<std::string>> candidates;  // the rivals of each term; empty: none
  /// The state in which the campaign left each unit; empty: the campaign did not measure it. Shape:
  /// (units).
  std::vector<std::optional<sim::UnitLeft>> left;
};

/// The model in `text` for the units of a campaign.
/// Errors: kInvalid with file and line: the text is no TOML, or a key is missing or wrong. An
/// effect that the library does not have, or not in that axis, form, memory and number of columns,
/// is kInvalid too. Two more cases are kInvalid: amplitudes of a wrong number or beyond the range
/// of their effect, and arms or bases of another unit.
Result<ModelFile> ReadModelFile(std::string_view text, const std::string& file,
                                const std::vector<sim::CampaignUnit>& units);

}  // namespace focalfleet
