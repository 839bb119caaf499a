// The routes of a diagnosis. They are the page's own, since neither the core nor the control socket
// has a part in it. A verb of the table of rights admits their callers.
//
//   GET  /diagnosis         its state (diagnosis_job.h)       status
//   POST /diagnosis         {name, moves_csv, units_csv}      diagnose
//   POST /diagnosis-cancel                                    diagnose
//   GET  /diagnosis-report  report.json                       status
//   GET  /diagnosis-model   model.toml                        status
//   GET  /diagnosis-page    report.html, to be kept as a file status
#pragma once

#include "daemon/http/router.h"
#include "daemon/page/diagnosis_job.h"

namespace focalfleet {

/// `job` outlives the router.
void AddDiagnosisRoutes(DiagnosisJob* job, HttpRouter* router);

}  // namespace focalfleet
