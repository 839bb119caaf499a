// DiagnosisPage is report.html of a diagnosis, for human readers. First comes the verdict as an
// operator would say it. Then come the causes, each with its remedy and how far its name is to be
// trusted. Pictures follow (diagnosis_figures.h): where on the plate, against what, of which order.
// Last come the gain on held-out moves, what could not be tested, and the moves to make next.
#pragma once

#include <string>

#include "daemon/campaign/diagnosis_files.h"

namespace focalfleet {

std::string DiagnosisPage(const sim::Campaign& campaign, const sim::Diagnosis& diagnosis,
                          const ReportNames& names);

}  // namespace focalfleet
