// The routes of a diagnosis. They are the page's own, since neither the core nor the control socket
// has a part in it. A verb of the table of rights admits their callers.
//
//   GET  /diagnosis         its state (diagnosis_job.h)       status
//   POST /diagnosis         {name, moves_csv, units_csv}      diagnose
//                           {name, recorded: {first, last}}: these configurations of the store
//   GET  /recordings        what the store has to diagnose    history
//   POST /diagnosis-cancel                                    diagnose
//   GET  /diagnosis-report  report.json                       status
//   GET  /diagnosis-model   model.toml                        status
//   GET  /diagnosis-page    report.html, to be kept as a file status
#pragma once

#include <string>

#include "daemon/http/router.h"
#include "daemon/page/diagnosis_job.h"
#include "fleet/layout.h"

namespace focalfleet {

/// The store from which campaigns are taken (daemon/campaign/recorded_campaign.h). Each request
/// opens it anew, so that nobody waits for the daemon's own reader.
struct Recordings {
  std::string store;
  const Layout* layout = nullptr;
};

/// `job` and the layout outlive the router.
void AddDiagnosisRoutes(DiagnosisJob* job, const Recordings& recordings, HttpRouter* router);

}  // namespace focalfleet
