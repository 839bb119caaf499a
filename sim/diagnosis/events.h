// Steps: an axis that from one move on stands by a fixed angle elsewhere, until it is homed. Only
// steps that physics has a size for are taken: whole motor turns lost against the motion
// (step_loss), a whole command lost or done twice (lost_command).
#pragma once

#include <string_view>
#include <vector>

#include "sim/diagnosis/diagnosis.h"
#include "sim/diagnosis/fit.h"

namespace focalfleet::sim {

inline constexpr std::string_view kStepLoss = "step_loss", kLostCommand = "lost_command";

/// Adds the steps that stand out from the residuals to the model. Returns how many.
std::size_t AddEvents(Fit* fit);

/// step_loss and lost_command as causes, of the model's events.
std::vector<CauseFound> EventCauses(const Fit& fit);

}  // namespace focalfleet::sim
