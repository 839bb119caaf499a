#include "daemon/process/status_output.h"

#include <utility>

#include "daemon/usage/build_version.h"

namespace focalfleet {
namespace {

void OpenPublisher(const DaemonConfig& config, StatusOutput* out) {
  const DaemonConfig::Dds& dds = config.dds;
  DdsTroubles* const troubles = out->troubles.get();
  out->publisher = std::make_unique<RenewingStatusPublisher>(RenewingStatusPublisher::Options{
      .join = {
          .join = [options = StatusOptionsOf(config)] { return StatusPublisher::Create(options); },
          .tell =
              [troubles](const std::string& trouble) {
                troubles->Report(AlarmName::kDdsMissing, "status", trouble);
              }},
      .renews = !dds.security.empty()});
}

}  // namespace

bool StatusOutput::Report(const AuditHead& head) const {
  if (thread == nullptr) return true;
  StatusBatch batch{.audit_head = AuditHeadValue{WallTime::Now(), Text(head)}};
  return thread->Publish(&batch);
}

void OpenStatusOutput(const DaemonConfig& config, const Layout& layout, WallTime started,
                      const HostClock& clock, StatusOutput* out) {
  if (config.dds.enabled || config.camera.dds) WarnOfDdsEnvironment(config.dds);
  if (config.dds.enabled) OpenPublisher(config, out);
  if (config.http.port != 0)
    out->page = std::make_unique<PlateFeed>(
        PlateFeed::Options{.layout = &layout, .viewers_max = config.http.viewers_max});
  if (out->publisher == nullptr && out->page == nullptr) return;
  out->scheduler = std::make_unique<StatusScheduler>(
      layout.size(),
      StatusScheduler::Options{
          .rate_hz = config.dds.rate_hz, .version = BuildVersion(), .started = started},
      clock);
}

Status StartStatusThread(std::function<void()> room, std::function<void()> alive,
                         StatusOutput* out) {
  if (out->scheduler == nullptr) return {};
  RenewingStatusPublisher* const publisher = out->publisher.get();
  PlateFeed* const page = out->page.get();
  StatusThread::Sinks sinks;
  sinks.publish = [publisher, page, night = &out->night](const StatusBatch& status) {
    if (page != nullptr) page->Take(status);
    if (page != nullptr) night->Take(status);
    return publisher != nullptr && publisher->Publish(status);
  };
  sinks.alarm = [publisher, page](const AlarmValue& alarm) {
    if (page != nullptr) page->NoteAlarm();
    if (publisher != nullptr) publisher->Publish(alarm);
  };
  sinks.room = std::move(room);
  sinks.alive = std::move(alive);
  FOCALFLEET_TRY_ASSIGN(out->thread, StatusThread::Create(std::move(sinks)));
  return {};
}

}  // namespace focalfleet
