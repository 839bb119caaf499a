// The parts of the daemon that belong together, by what they are for. daemon.cc makes them, and
// ends them.
#pragma once

#include <memory>

#include "daemon/camera/camera_work.h"
#include "daemon/clock/wall_time.h"
#include "daemon/hall/fibre_carrier_work.h"
#include "daemon/journal/journal_thread.h"
#include "daemon/loop/event_loop.h"
#include "daemon/loop/heartbeat.h"
#include "daemon/loop/service_report.h"
#include "daemon/loop/watchdog.h"
#include "daemon/metrics/metrics_endpoint.h"
#include "daemon/metrics/metrics_sampler.h"
#include "daemon/process/bounded_end.h"
#include "daemon/process/dds_setup.h"
#include "daemon/process/http_door.h"
#include "daemon/process/sector_setup.h"
#include "daemon/systemd/notify_socket.h"
#include "daemon/verbs/audit_trail.h"
#include "daemon/verbs/request_handler.h"

namespace focalfleet {

/// The parts that report to the service manager.
struct Service {
  WallTime started = WallTime::Now();
  NotifySocket socket;
  Heartbeat store;
  Heartbeat status;
  Heartbeat planner;
  Heartbeat camera;
  std::unique_ptr<Watchdog> watchdog;  // none: the manager expects no sign of life
  std::unique_ptr<ServiceReport> report;
};

/// Where places of units come from. The thread ends before the workers that it uses.
struct Measuring {
  std::unique_ptr<CameraWorker> camera;          // none: there is no camera
  CameraPort* port = nullptr;                    // of the camera, which owns it
  std::unique_ptr<FibreCarrierWorker> carriers;  // none: no unit has sensors of its own
  std::unique_ptr<CameraThread> thread;          // none: neither camera nor sensors
  std::unique_ptr<CredentialWatch> credentials;  // none: no DDS Security. Renews camera and status
};

/// Where requests come in.
struct Doors {
  AuditTrail audit;
  std::unique_ptr<RequestHandler> handler;
  std::unique_ptr<StateThread> states;
  std::unique_ptr<DiagnosisJob> diagnosis;
  std::unique_ptr<HttpServer> http;  // none: [http] has no port
};

/// Parts that share the common start with others.
struct CommonStart {
  std::unique_ptr<SyncPulse> sync;     // none: no SYNC line
  std::unique_ptr<SectorSeat> sector;  // none: the daemon is no sector of a plane
};

struct StoreThreads {
  std::unique_ptr<journal::JournalThread> journal;  // none: [journal] has a limit of 0
  std::unique_ptr<StoreThread> writer;
  std::unique_ptr<ReaderThread> reader;
  std::unique_ptr<BoundedEnd> closing;  // at the end
};

/// Numbers for /metrics. The counters are kept also where there is no endpoint.
struct Metrics {
  WorkCounters work;
  NewestValue<const PlannedPower> power;
  NewestValue<const FleetMetrics> values;
  std::unique_ptr<MetricsSampler> sampler;    // none: [metrics] has no port
  std::unique_ptr<MetricsEndpoint> endpoint;  // none: the same, or not yet
};

}  // namespace focalfleet
