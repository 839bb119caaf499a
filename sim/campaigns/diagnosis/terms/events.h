// A step is a fixed error of an axis that begins at one move and lasts until the next homing. Steps
// of a size that physics gives come first. They are whole motor turns lost against the motion
// (step_loss), or a whole command lost or done twice (lost_command). A move that stops short has
// touched a neighbour, where that neighbour stopped short in the same move (collision_contact). The
// cause of other steps is unknown.
#pragma once

#include <string_view>
#include <vector>

#include "sim/campaigns/diagnosis/decide/diagnosis.h"
#include "sim/campaigns/diagnosis/model/fit.h"
#include "sim/campaigns/effects/other_causes.h"

namespace focalfleet::sim {

/// The amplitude's unit of a cause that is made of steps.
inline constexpr std::string_view kEvents = "events";

/// Adds the steps that are clear in the residuals to the model. Returns its number of steps.
std::size_t AddEvents(double family_wise, Fit* fit);

/// Whether a neighbour was stopped in the same move, and one of the two not after whole turns.
bool IsOfContact(const Fit& fit, const EventTerm& event);

/// The causes that explain the model's steps.
std::vector<CauseFound> EventCauses(const Fit& fit);

/// The model's steps that no cause explains.
std::vector<UnknownFound> UnexplainedSteps(const Fit& fit);

}  // namespace focalfleet::sim
