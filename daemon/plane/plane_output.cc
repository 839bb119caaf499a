#include "daemon/plane/plane_output.h"

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <stop_token>
#include <thread>
#include <utility>

#include "daemon/loop/thread_name.h"
#include "daemon/metrics/process_facts.h"
#include "daemon/plane/plane_metrics.h"
#include "daemon/usage/build_version.h"

namespace focalfleet {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

constexpr milliseconds kPeriod(1000);
constexpr milliseconds kPageStaleAfter(10'000);

FleetStatusValue FleetOf(const PlaneInstant& plane, WallTime started) {
  const PlaneTable::Counts counts = plane.table->Count(plane.steady);
  return {.at = plane.at,
          .started = started,
          .version = BuildVersion(),
          .units = static_cast<std::uint32_t>(plane.plane->layout().size()),
          .enabled = counts.enabled,
          .units_by_phase = counts.by_phase,
          .units_by_witness = counts.by_witness,
          .configuration = plane.coordinator->view().configuration,
          .bus_load_max = counts.bus_load_max,
          .busy = plane.coordinator->busy(),
          .store_failing = counts.store_failing};
}

ConfigurationProgressValue ProgressOf(const PlaneInstant& plane) {
  const PlaneView& of_plane = plane.coordinator->view();
  ConfigurationView view;
  view.id = of_plane.configuration;
  view.kind = of_plane.kind;
  view.source = of_plane.source;
  view.state = of_plane.state;
  view.round = of_plane.rounds;
  view.counts = of_plane.counts;
  view.makespan_predicted_s = of_plane.makespan_predicted_s;
  view.waiting_for = of_plane.waiting_for;
  view.measured = of_plane.measured;
  view.not_measured = of_plane.not_measured;
  return {.at = plane.at, .view = view};
}

}  // namespace

/// The table, and the thread that fills it.
class PlaneOutput::Reader {
 public:
  Reader(const PlaneLayout* plane, DdsOptions dds, PlanePage* page,
         std::function<void(const std::string&)> tell)
      : dds_(std::move(dds)), page_(page), tell_(std::move(tell)), table_(plane) {
    thread_ = std::jthread([this](const std::stop_token& stop) { Run(stop); });
  }
  void Read(const std::function<void(const PlaneTable&)>& look) const {
    const std::lock_guard lock(mutex_);
    look(table_);
  }

  /// The next look reads with a new participant, which gets all that is published again.
  void Renew() { renew_ = true; }

 private:
  void Run(const std::stop_token& stop) {
    NameThisThread("plane-status");
    std::mutex mutex;
    std::condition_variable_any ended;
    while (!stop.stop_requested()) {
      const Status status = Follow(stop);
      if (status) continue;
      if (status.error().text != trouble_) tell_(trouble_ = status.error().text);
      std::unique_lock lock(mutex);
      ended.wait_for(lock, stop, milliseconds(5000), [] { return false; });
    }
  }
  Status Follow(const std::stop_token& stop) {
    FOCALFLEET_TRY_ASSIGN(
        const auto reader,
        StatusReader::Create({.dds = dds_, .units = true, .partitions = {SectorPartition({})}}));
    if (!trouble_.empty()) tell_("");
    trouble_.clear();
    StatusUpdate update;
    while (!stop.stop_requested() && !renew_.exchange(false)) {
      FOCALFLEET_TRY_ASSIGN(const bool any, reader->Wait(milliseconds(200)));
      if (!any) continue;
      FOCALFLEET_TRY(reader->Take(&update));
      {
        const std::lock_guard lock(mutex_);
        table_.Absorb(update, steady_clock::now());
      }
      if (page_ != nullptr) page_->Take(update);
      // Status comes in many packets; what has gathered meanwhile is taken at once.
      std::this_thread::sleep_for(milliseconds(20));
    }
    return {};
  }

  const DdsOptions dds_;
  PlanePage* const page_;
  const std::function<void(const std::string&)> tell_;
  std::string trouble_;  // of the thread
  std::atomic<bool> renew_{false};
  mutable std::mutex mutex_;
  PlaneTable table_;
  std::jthread thread_;
};

PlaneOutput::PlaneOutput(Options options) : options_(std::move(options)) {
  DdsOptions dds = options_.dds;
  dds.partition = kPlanePartition;
  publisher_ = std::make_unique<RenewingStatusPublisher>(RenewingStatusPublisher::Options{
      .join = {.join = [dds] { return StatusPublisher::Create(dds); },
               .tell = [this](const std::string& trouble) { options_.tell("status", trouble); }},
      .renews = !options_.dds.security.empty()});
  reader_ = std::make_unique<Reader>(
      options_.plane, options_.dds, options_.page,
      [this](const std::string& trouble) { options_.tell("status of the sectors", trouble); });
  if (!options_.metrics) return;
  options_.metrics->pages = {{"/metrics", [this] { return Metrics(); }},
                             {"/healthz", [this] { return Health(); }}};
  server_ = std::make_unique<HttpServer>(*options_.metrics);
}

PlaneOutput::~PlaneOutput() { server_.reset(); }

void PlaneOutput::Read(const std::function<void(const PlaneTable&)>& look) const {
  reader_->Read(look);
}

void PlaneOutput::Publish(const PlaneInstant& plane) {
  next_ = plane.steady + kPeriod;
  StatusBatch batch;
  batch.fleet = FleetOf(plane, options_.started);
  batch.configuration = ProgressOf(plane);
  static_cast<void>(publisher_->Publish(batch));
  if (options_.page != nullptr) options_.page->Take(plane, *batch.fleet, *batch.configuration);
  if (server_ == nullptr) return;
  std::string page = PlaneMetricsText(plane, ReadProcessFacts());
  const std::lock_guard lock(page_mutex_);
  page_ = std::move(page);
  page_at_ = plane.steady;
}

void PlaneOutput::Publish(const AlarmValue& alarm) {
  publisher_->Publish(alarm);
  if (options_.page != nullptr) options_.page->NoteAlarm();
}

void PlaneOutput::Renew(WallTime end) {
  publisher_->Renew(end);
  reader_->Renew();
}

HttpAnswer PlaneOutput::Metrics() {
  const std::lock_guard lock(page_mutex_);
  if (page_.empty()) return {.status = 503, .body = "the daemon has just started\n"};
  return {.content_type = "text/plain; version=0.0.4; charset=utf-8", .body = page_};
}

HttpAnswer PlaneOutput::Health() {
  const std::lock_guard lock(page_mutex_);
  if (page_.empty()) return {.status = 503, .body = "the daemon has just started\n"};
  if (steady_clock::now() - page_at_ <= kPageStaleAfter) return {.body = "ok\n"};
  return {.status = 503, .body = "the coordinator has handed out nothing for 10 s\n"};
}

}  // namespace focalfleet
