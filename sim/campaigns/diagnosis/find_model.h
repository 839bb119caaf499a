// The search for the extended model of a campaign: effects, steps, zeros of homings and motion of
// the image, whichever comes first explains best; and by which sensors, where some are suspect.
#pragma once

#include <string_view>

#include "sim/campaigns/diagnosis/diagnosis.h"
#include "sim/campaigns/diagnosis/fit.h"
#include "sim/campaigns/diagnosis/select.h"
#include "sim/campaigns/diagnosis/wrong_sensors.h"

namespace focalfleet::sim {

/// Whether the library shall not have the cause.
bool IsLeftOut(const DiagnoseOptions& options, std::string_view cause);

/// Of the residuals of rows that count, in 2-D, um.
double RmsOf(const Fit& fit);

/// The fit becomes the model's; what is no term of it (homings, image, sensors) is told as causes.
/// With `truth`: by the temperatures as they were told and, where sensors are suspect, by those
/// around them: whoever explains the moves better. Where neither does, a whole rail's sensors are
/// told as what they may be; a single unit may well be warmer. nullptr: no sensor is suspect.
Selection FindModel(const Templates& templates, const DiagnoseOptions& options,
                    const SelectionRule& rule, const TrueTemperatures* truth, Fit* fit,
                    Diagnosis* diagnosis);

}  // namespace focalfleet::sim
