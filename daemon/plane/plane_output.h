// The outputs of a plane's coordinator beside its control socket. A thread reads what the sectors
// publish into the table (plane_table.h). Once a second the fleet and the configuration of the
// whole plane are published in the partition `plane`, with the coordinator's alarms, and the page
// /metrics is made anew. DDS may be missing: nothing here holds up the coordinator.
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "daemon/http/http_server.h"
#include "daemon/plane/plane_page.h"
#include "daemon/plane/plane_requests.h"
#include "daemon/plane/plane_table.h"
#include "daemon/status/renewing_status_publisher.h"

namespace focalfleet {

class PlaneOutput {
 public:
  struct Options {
    const PlaneLayout* plane = nullptr;  // outlives this
    DdsOptions dds;
    WallTime started;
    std::optional<HttpServer::Options> metrics;  // none: no /metrics
    PlanePage* page = nullptr;                   // outlives this; null: there is no page
    /// Receives each new reason why DDS does not do its part, and an empty text when it does again.
    std::function<void(const char* part, const std::string& trouble)> tell =
        [](const char*, const std::string&) {};
  };
  explicit PlaneOutput(Options options);
  PlaneOutput(const PlaneOutput&) = delete;
  PlaneOutput& operator=(const PlaneOutput&) = delete;
  ~PlaneOutput();

  /// `look` sees the table while it does not change. Cost: that of `look`, which holds up the
  /// reader alone.
  void Read(const std::function<void(const PlaneTable&)>& look) const;
  /// Publishes what is due. Pre: `plane` has a table.
  void Publish(const PlaneInstant& plane);
  void Publish(const AlarmValue& alarm);
  /// Participants with new credentials take the place of the old ones, which end at `end`. Any
  /// thread may call.
  void Renew(WallTime end);
  [[nodiscard]] bool due(SteadyTime now) const { return now >= next_; }

 private:
  class Reader;
  HttpAnswer Metrics();
  HttpAnswer Health();

  Options options_;
  std::unique_ptr<RenewingStatusPublisher> publisher_;
  SteadyTime next_;
  std::mutex page_mutex_;
  std::string page_;
  SteadyTime page_at_;
  std::unique_ptr<HttpServer> server_;
  std::unique_ptr<Reader> reader_;
};

}  // namespace focalfleet
