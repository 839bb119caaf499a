// The endpoint answers /metrics with the newest values that the core has handed out, and /healthz
// with whether the core still hands out values. Its threads are its own, so a scrape never holds up
// the core.
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <string>

#include "daemon/http/http_server.h"
#include "daemon/metrics/fleet_metrics.h"
#include "daemon/metrics/newest_value.h"
#include "daemon/metrics/work_counters.h"
#include "fleet/coordinate/inputs.h"

namespace focalfleet {

/// The note for the fleet about the server's trouble; empty: it serves again.
ShellNote NoteOfMetrics(const std::string& trouble);

class MetricsEndpoint {
 public:
  /// All parts outlive the endpoint.
  struct Parts {
    NewestValue<const FleetMetrics>* values = nullptr;
    const WorkCounters* work = nullptr;
    std::string store_path;
    std::function<WallTime()> now = &WallTime::Now;
  };
  /// `server` has address, port, names and `tell`; the pages are added here.
  MetricsEndpoint(Parts parts, HttpServer::Options server);

  [[nodiscard]] std::uint16_t port() const { return server_.port(); }

 private:
  std::shared_ptr<const FleetMetrics> Newest();
  HttpAnswer Metrics();
  HttpAnswer Health();
  HttpServer::Options WithPages(HttpServer::Options server);

  Parts parts_;
  std::mutex mutex_;  // of the server's threads alone
  std::shared_ptr<const FleetMetrics> newest_;
  HttpServer server_;
};

}  // namespace focalfleet
