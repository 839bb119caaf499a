// DiagnosisPage is report.html of a diagnosis, for human readers. Its first sentence is the
// verdict. Then come the causes, each with its remedy, and the residuals over the plate and against
// the columns, before and after. Last come the gain on held-out moves, what could not be tested,
// and the moves to make next.
#pragma once

#include <string>

#include "daemon/campaign/diagnosis_files.h"

namespace focalfleet {

std::string DiagnosisPage(const sim::Campaign& campaign, const sim::Diagnosis& diagnosis,
                          const ReportNames& names);

}  // namespace focalfleet
