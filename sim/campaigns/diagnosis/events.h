// Steps: an axis that from one move on stands by a fixed angle elsewhere, until it is homed. What
// physics has a size for comes first: whole motor turns lost against the motion (step_loss), a
// whole command lost or done twice (lost_command). What stops short by any angle has touched a
// neighbour where one did so in the same move (collision_contact); else nobody knows.
#pragma once

#include <string_view>
#include <vector>

#include "sim/campaigns/diagnosis/diagnosis.h"
#include "sim/campaigns/diagnosis/fit.h"

namespace focalfleet::sim {

inline constexpr std::string_view kStepLoss = "step_loss", kLostCommand = "lost_command",
                                  kContact = "collision_contact";

/// The amplitude's unit of a cause that is made of steps.
inline constexpr std::string_view kEvents = "events";

/// Adds the steps that stand out from the residuals to the model. Returns how many.
std::size_t AddEvents(Fit* fit);

/// Whether a neighbour was stopped in the same move, one of the two not after whole turns.
bool IsOfContact(const Fit& fit, const EventTerm& event);

/// The model's steps by their causes.
std::vector<CauseFound> EventCauses(const Fit& fit);

/// The steps that nobody has a cause for.
std::vector<UnknownFound> UnexplainedSteps(const Fit& fit);

}  // namespace focalfleet::sim
