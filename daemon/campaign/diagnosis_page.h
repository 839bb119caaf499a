// report.html of a diagnosis, for people: the verdict in its first sentence, then the causes with
// what to do about them, residuals over the plate and against the columns before and after, the
// gain on held-out moves, what could not be tested, and the moves to make next.
#pragma once

#include <string>

#include "daemon/campaign/diagnosis_files.h"

namespace focalfleet {

std::string DiagnosisPage(const sim::Campaign& campaign, const sim::Diagnosis& diagnosis,
                          const ReportNames& names);

}  // namespace focalfleet
