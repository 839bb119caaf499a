// model.toml read back: fitted geometry and effects, for a campaign's units. Units that the model
// does not know keep the table's geometry and have no effects.
#pragma once

#include <string>
#include <string_view>

#include "protocol/base/result.h"
#include "sim/diagnosis/model.h"

namespace focalfleet {

/// Errors: kInvalid with file and line where the text is no TOML; a key that is missing or wrong,
/// an effect that the library does not have, amplitudes that are not as many as its units.
Result<sim::CampaignModel> ReadModel(std::string_view text, const std::string& file,
                                     const sim::Campaign& campaign);

}  // namespace focalfleet
