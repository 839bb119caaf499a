// The fleet's status on its way out: to DDS, and to the operators' page. Both get the same batches,
// on one thread.
#pragma once

#include <functional>
#include <memory>

#include "daemon/clock/clock.h"
#include "daemon/loop/status_thread.h"
#include "daemon/page/kept_plans.h"
#include "daemon/page/night_curves.h"
#include "daemon/page/plate_feed.h"
#include "daemon/process/bounded_end.h"
#include "daemon/process/config.h"
#include "daemon/process/dds_setup.h"
#include "daemon/status/dds_troubles.h"
#include "daemon/status/renewing_status_publisher.h"
#include "daemon/status/status_scheduler.h"
#include "daemon/store/audit_chain.h"

namespace focalfleet {

struct StatusOutput {
  std::unique_ptr<DdsTroubles> troubles;
  std::unique_ptr<RenewingStatusPublisher> publisher;  // none: DDS is off
  KeptPlans plans;                                     // empty where there is no HTTP door
  NightCurves night;                                   // likewise
  std::unique_ptr<PlateFeed> page;                     // none: there is no HTTP door
  std::unique_ptr<StatusScheduler> scheduler;          // none: neither publisher nor page
  std::unique_ptr<StatusThread> thread;  // none: the same. Ends before publisher and page
  std::unique_ptr<BoundedEnd> ending;

  /// Publishes the head of the audit. On the store's thread. False: the status thread is behind.
  [[nodiscard]] bool Report(const AuditHead& head) const;
};

/// All parts but the thread and the end. `layout` outlives them. Pre: `out` has its troubles, and
/// stays where it is.
void OpenStatusOutput(const DaemonConfig& config, const Layout& layout, WallTime started,
                      const HostClock& clock, StatusOutput* out);

/// The thread runs where there is something to publish to. `room` and `alive` are those of
/// StatusThread::Sinks. Errors: kUnavailable: no descriptors left.
Status StartStatusThread(std::function<void()> room, std::function<void()> alive,
                         StatusOutput* out);

}  // namespace focalfleet
