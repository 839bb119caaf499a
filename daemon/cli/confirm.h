// The question before what cannot be taken back, or concerns many units at once. A person at a
// terminal answers it, or gives --yes beforehand. A script is never asked.
#pragma once

#include <optional>
#include <string>

#include "daemon/cli/context.h"

namespace focalfleet::cli {

/// Disabling more units than this, or setting a parameter of more, is asked about: so many are
/// named one by one, more are chosen by a range or a bus that may be a slip.
inline constexpr std::size_t kUnitsUnasked = 10;

/// None: go on. Otherwise the command ends with this refusal, as somebody at the terminal said no.
/// `what` is a sentence of what will happen.
std::optional<Failure> Refused(const std::string& what, bool yes);

}  // namespace focalfleet::cli
