// ServiceReport tells the service manager how the daemon stands: ready after the first turn of the
// loop, a line for people where it changed, ending and reloading, and the sign of life of the
// watchdog. Without a manager it does nothing. Core thread only.
#pragma once

#include <string>

#include "daemon/loop/watchdog.h"
#include "daemon/status/status_snapshot.h"
#include "daemon/systemd/notify_socket.h"
#include "protocol/base/instants.h"

namespace focalfleet {

class ServiceReport {
 public:
  /// Both parts outlive the report. `watchdog` is null where none is wanted. The line for people is
  /// made at most once in `status_period`, a host time.
  ServiceReport(const NotifySocket* socket, Watchdog* watchdog, DurationNs status_period)
      : socket_(socket), watchdog_(watchdog), status_period_(status_period) {}

  /// The end of a turn. `changed`: the coordinator took a step in it. The first turn reports the
  /// daemon as ready; the control socket takes commands by then.
  void Serve(const FleetView& view, bool changed);
  /// The instant at which Serve has something to do; kNever: after the next step at the earliest.
  [[nodiscard]] HostInstant wake_at() const;

  /// Surround what SIGHUP asks for.
  void BeginReload();
  void EndReload();
  /// The loop takes no commands any more.
  void Ending();

 private:
  const NotifySocket* socket_;
  Watchdog* watchdog_;
  DurationNs status_period_;
  bool ready_ = false;  // the manager knows
  bool changed_ = true;
  HostInstant status_at_;
  std::string status_;  // as it was sent
};

/// The line for people: units that are ready, the configuration under way, trouble.
std::string ServiceStatusLine(const FleetView& view, const std::string& trouble);

}  // namespace focalfleet
