// The question before what cannot be taken back, or concerns many units at once. A person at a
// terminal answers it; a script says --yes beforehand.
#pragma once

#include <optional>
#include <string>

#include "daemon/cli/context.h"

namespace focalfleet::cli {

/// Disabling more units than this, or setting a parameter of more, is asked about: so many are
/// named one by one, more are chosen by a range or a bus that may be a slip.
inline constexpr std::size_t kUnitsUnasked = 10;

/// None: go on. Otherwise the command ends with this refusal: a terminal said no, or there is no
/// terminal to ask and the text says to add --yes. `what` is a sentence of what will happen.
std::optional<Failure> Refused(const std::string& what, bool yes);

}  // namespace focalfleet::cli
