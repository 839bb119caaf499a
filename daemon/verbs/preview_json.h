// The answer to a dry run: what an `apply` of the same file would begin with.
#pragma once

#include <cstdint>
#include <span>

#include "daemon/control/messages.h"
#include "fleet/coordinate/inputs.h"
#include "fleet/coordinate/preview.h"

namespace focalfleet {

/// Targets that are served, those that are not with the reason, and time and power of the plan.
/// Pre: `done.plan` is a plan.
Json PreviewJson(const Layout& layout, const PlanDone& done, std::uint32_t targeted,
                 std::span<const Preview::Refused> refused);

}  // namespace focalfleet
