#include "daemon/metrics/metrics_endpoint.h"

#include <cstdint>
#include <utility>

#include "daemon/metrics/metrics_text.h"
#include "daemon/metrics/process_facts.h"

namespace focalfleet {
namespace {

/// The core hands out values each second. Ten times that is no delay of a busy host any more, and
/// less than the 15 s in which Prometheus usually comes.
constexpr std::int64_t kStaleAfter_ns = 10'000'000'000;

HttpAnswer NoValuesYet() { return {.status = 503, .body = "the daemon has just started\n"}; }

}  // namespace

ShellNote NoteOfMetrics(const std::string& trouble) {
  if (trouble.empty())
    return {AlarmName::kMetricsBack, "metrics are served again", AlarmName::kMetricsMissing};
  return {AlarmName::kMetricsMissing,
          "no metrics, the fleet works on and it is tried again: " + trouble};
}

MetricsEndpoint::MetricsEndpoint(Parts parts, HttpServer::Options server)
    : parts_(std::move(parts)), server_(WithPages(std::move(server))) {}

HttpServer::Options MetricsEndpoint::WithPages(HttpServer::Options server) {
  server.pages = {{"/metrics", [this] { return Metrics(); }},
                  {"/healthz", [this] { return Health(); }}};
  return server;
}

std::shared_ptr<const FleetMetrics> MetricsEndpoint::Newest() {
  const std::lock_guard lock(mutex_);
  if (auto newer = parts_.values->Take()) newest_ = std::move(newer);
  return newest_;
}

HttpAnswer MetricsEndpoint::Metrics() {
  const auto values = Newest();
  if (values == nullptr) return NoValuesYet();
  return {.content_type = "text/plain; version=0.0.4; charset=utf-8",
          .body = MetricsText(*values, *parts_.work, ReadProcessFacts(),
                              StoreBytes(parts_.store_path))};
}

HttpAnswer MetricsEndpoint::Health() {
  const auto values = Newest();
  if (values == nullptr) return NoValuesYet();
  const std::int64_t age_ns = parts_.now().ns - values->at.ns;
  if (age_ns <= kStaleAfter_ns) return {.body = "ok\n"};
  return {.status = 503,
          .body = "the core has handed out nothing for " + std::to_string(age_ns / 1'000'000'000) +
                  " s\n"};
}

}  // namespace focalfleet
