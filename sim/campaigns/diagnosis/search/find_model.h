// The search for the extended model of a campaign tries effects, steps, zeros of homings and motion
// of the image. The search begins with whichever explains best. Where sensors are suspect it also
// tries which of them to believe.
#pragma once

#include <string_view>

#include "sim/campaigns/diagnosis/decide/diagnosis.h"
#include "sim/campaigns/diagnosis/model/fit.h"
#include "sim/campaigns/diagnosis/search/select.h"
#include "sim/campaigns/diagnosis/terms/wrong_sensors.h"

namespace focalfleet::sim {

/// Whether the options leave the cause out of the library.
bool IsLeftOut(const DiagnoseOptions& options, std::string_view cause);

/// Rms of the 2-D residuals of used rows, um.
double RmsOf(const Fit& fit);

/// Makes the fit that of the extended model, and adds causes for the parts that are no terms
/// (homings, image, sensors). With `truth` both temperatures are tried, as reported and, for
/// suspect sensors, as around them, and the ones that explain the moves better are kept. Where
/// neither does, the sensors of a whole rail are reported as a possibility. A single unit may well
/// be warmer. nullptr: no sensor is suspect.
Selection FindModel(const Templates& templates, const DiagnoseOptions& options,
                    const SelectionRule& rule, const TrueTemperatures* truth, Fit* fit,
                    Diagnosis* diagnosis);

}  // namespace focalfleet::sim
