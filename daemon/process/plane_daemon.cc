#include "daemon/process/plane_daemon.h"

#include <poll.h>
#include <signal.h>
#include <spdlog/spdlog.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <iterator>
#include <memory>
#include <optional>
#include <random>
#include <utility>

#include "daemon/camera/camera_work.h"
#include "daemon/clock/clock.h"
#include "daemon/clock/process_time.h"
#include "daemon/control/id_ranges.h"
#include "daemon/loop/event_loop.h"
#include "daemon/loop/job_thread.h"
#include "daemon/plane/plane_link.h"
#include "daemon/plane/plane_output.h"
#include "daemon/plane/plane_page.h"
#include "daemon/plane/plane_record_file.h"
#include "daemon/plane/plane_requests.h"
#include "daemon/process/camera_setup.h"
#include "daemon/process/control_door.h"
#include "daemon/process/dds_setup.h"
#include "daemon/process/fleet_setup.h"
#include "daemon/process/http_door.h"
#include "daemon/process/sector_setup.h"
#include "daemon/systemd/notify_socket.h"
#include "fleet/coordinate/stall_detection.h"
#include "fleet/plan/job.h"

namespace focalfleet {
namespace {

struct KeepJob {
  PlaneRecord record;
  std::uint64_t number = 0;
};
struct KeptRecord {
  std::uint64_t number = 0;
  Status status;
};
using Planner = JobThread<PlaneJob, PlanePlanDone>;
struct PreviewWork {
  PlanJob job;
  std::vector<UnitDrive> drives;
  std::shared_ptr<std::atomic<bool>> given_up;
};
using Previewer = JobThread<PreviewWork, PlanDone>;
using Camera = JobThread<CameraWork, ExposureDone>;
using Keeper = JobThread<KeepJob, KeptRecord>;

std::uint64_t RandomNumber() {
  std::random_device chance;
  return (std::uint64_t{chance()} << 31 | chance()) + 1;
}

std::optional<HttpServer::Options> MetricsServerOf(const DaemonConfig::Metrics& metrics) {
  if (metrics.port == 0) return std::nullopt;
  HttpServer::Options server{.address = metrics.address, .port = metrics.port};
  server.names = metrics.names;
  server.names.push_back(metrics.address);
  server.tell = [](const std::string& trouble) {
    if (trouble.empty())
      spdlog::info("metrics are served again");
    else
      spdlog::warn("no metrics, it is tried again: {}", trouble);
  };
  return server;
}

class PlaneDaemon {
 public:
  explicit PlaneDaemon(const DaemonConfig& config) : config_(config), clock_(config.clock.speed) {}

  Status Start();
  void Run();

 private:
  void Turn();
  void Wait();
  void Perform(PlaneEffects* effects);
  void TakeKept();
  Status OpenCamera();
  void Expose(PlaneExposure exposure);
  Status OpenPage();
  [[nodiscard]] PlanDone Preview(const PreviewWork& work, const std::atomic<bool>& ending);
  void PreviewIfAsked();
  [[nodiscard]] PlaneInstant Instant() {
    return {.plane = plane_.get(),
            .coordinator = coordinator_.get(),
            .now = now_,
            .at = WallTime::Now(),
            .link = link_->counters(),
            .alarms = &alarms_,
            .has_camera = camera_.thread != nullptr,
            .page = PageAddress(config_.http),
            .options = pages_.options,
            .steady = std::chrono::steady_clock::now()};
  }

  DaemonConfig config_;
  HostClock clock_;
  std::unique_ptr<PlaneLayout> plane_;
  std::unique_ptr<PlaneRecordFile> record_;
  std::unique_ptr<EventSignal> signal_;
  std::unique_ptr<PlaneCoordinator> coordinator_;
  PlaneAlarms alarms_;
  struct {
    PlanOptions options;                          // of previews
    std::shared_ptr<std::atomic<bool>> given_up;  // of the preview under way; null: none was
    std::unique_ptr<PlanePage> page;              // none: there is no HTTP door
    std::unique_ptr<Previewer> previewer;
    std::unique_ptr<HttpServer> http;  // none: the same. Ends before the page
  } pages_;                            // the output's reader uses the page
  std::unique_ptr<PlaneOutput> output_;
  std::unique_ptr<PlaneRequests> requests_;
  std::unique_ptr<PlaneLink> link_;
  std::unique_ptr<Planner> planner_;
  std::unique_ptr<Keeper> keeper_;
  struct {
    std::unique_ptr<CameraWorker> worker;  // none: there is no camera
    CameraPort* port = nullptr;            // of the worker, which owns it
    std::unique_ptr<Camera> thread;        // none: there is no camera
    std::vector<ExposureDone> not_done;    // answers without an exposure
  } camera_;
  struct Keeping {
    KeepJob job;
    std::uint64_t kept = 0;  // the number of the last record that is durable
    HostInstant again_at = kNever;
  };
  Keeping keeping_;
  std::unique_ptr<DdsTroubles> troubles_;
  std::unique_ptr<CredentialWatch> credentials_;
  HostInstant now_;
  HostInstant wake_at_{0};
  NotifySocket service_;
  int signals_ = -1;
  bool ending_ = false;
};

Status PlaneDaemon::Start() {
  FOCALFLEET_TRY_ASSIGN(PlaneLayout plane, LoadPlane(config_));
  plane_ = std::make_unique<PlaneLayout>(std::move(plane));
  FOCALFLEET_TRY_ASSIGN(
      record_, PlaneRecordFile::Open(config_.store.path, plane_->layout(), RandomNumber()));
  FOCALFLEET_TRY_ASSIGN(LineServer server, OpenControl(config_.control));
  requests_ = std::make_unique<PlaneRequests>(
      std::make_unique<LineServer>(std::move(server)),
      PlaneRequests::Options{.progress_period = clock_.Real(Milliseconds(200)),
                             .own_pid = static_cast<std::uint32_t>(::getpid()),
                             .log = [](const std::string& text) { spdlog::info("{}", text); },
                             .read = [this](const auto& look) { output_->Read(look); }});
  FOCALFLEET_TRY_ASSIGN(EventSignal signal, EventSignal::Create());
  signal_ = std::make_unique<EventSignal>(std::move(signal));
  FOCALFLEET_TRY_ASSIGN(keeper_, Keeper::Create(
                                     [record = record_.get()](const KeepJob& job, const auto&) {
                                       return KeptRecord{job.number, record->Keep(job.record)};
                                     },
                                     signal_.get(), {.name = "record"}));
  FOCALFLEET_TRY_ASSIGN(
      planner_, Planner::Create(
                    [plane = plane_.get()](const PlaneJob& job, const std::atomic<bool>& ending) {
                      const double before_s = ThreadCpuSeconds();
                      PlanePlanDone done =
                          RunPlaneJob(job, *plane, [&ending] { return ending.load(); });
                      spdlog::info("a plan of {} units took {:.2f} s of CPU time", job.units.size(),
                                   ThreadCpuSeconds() - before_s);
                      return done;
                    },
                    signal_.get(), {.name = "planner"}));
  sigset_t set;
  sigemptyset(&set);
  for (const int number : {SIGTERM, SIGINT}) sigaddset(&set, number);
  signals_ = ::signalfd(-1, &set, SFD_NONBLOCK | SFD_CLOEXEC);
  if (signals_ < 0) return Fail(ErrorCode::kUnavailable, "no descriptors left");
  const PlaneRecordFile::Content& content = record_->content();
  coordinator_ = std::make_unique<PlaneCoordinator>(plane_.get(), PlaneTimesAt(config_.clock.speed),
                                                    content.coordinator, content.record);
  WarnOfDdsEnvironment(config_.dds);
  troubles_ = std::make_unique<DdsTroubles>([signal_raw = signal_.get()] { signal_raw->Raise(); });
  link_ = std::make_unique<PlaneLink>(
      PlaneLink::Options{.dds = DdsOptionsOf(config_.dds),
                         .sector = {},
                         .arrived = [signal_raw = signal_.get()] { signal_raw->Raise(); },
                         .tell =
                             [this](const std::string& trouble) {
                               troubles_->Report(AlarmName::kDdsMissing, "the plane", trouble);
                             }});
  FOCALFLEET_TRY(OpenCamera());
  FOCALFLEET_TRY(OpenPage());
  output_ = std::make_unique<PlaneOutput>(
      PlaneOutput::Options{.plane = plane_.get(),
                           .dds = DdsOptionsOf(config_.dds),
                           .started = WallTime::Now(),
                           .metrics = MetricsServerOf(config_.metrics),
                           .page = pages_.page.get(),
                           .tell = [this](const char* part, const std::string& trouble) {
                             troubles_->Report(AlarmName::kDdsMissing, part, trouble);
                           }});
  // The link takes new credentials by itself.
  credentials_ = WatchCredentials(config_.dds, troubles_.get(), [this](WallTime end) {
    output_->Renew(end);
    if (camera_.port != nullptr) camera_.port->Renew(end);
  });
  spdlog::info("coordinator of a plane of {} units in {} sectors", plane_->layout().size(),
               plane_->sectors());
  return {};
}

Status PlaneDaemon::OpenCamera() {
  if (!config_.camera.present()) return {};
  FOCALFLEET_TRY_ASSIGN(CameraSite site, LoadCameraSite(config_.camera));
  FOCALFLEET_TRY_ASSIGN(auto port, OpenCameraPort(config_, site.sensor, troubles_.get()));
  camera_.port = port.get();
  camera_.worker = std::make_unique<CameraWorker>(
      std::move(port),
      CameraWorker::Options{
          .layout = &plane_->layout(),
          .site = std::move(site),
          .patience = std::chrono::milliseconds(config_.camera.patience.ns / 1'000'000),
          .speed = config_.clock.speed,
          .log = [](const std::string& text) { spdlog::warn("{}", text); }});
  FOCALFLEET_TRY_ASSIGN(
      camera_.thread,
      Camera::Create(
          [worker = camera_.worker.get()](const CameraWork& work, const std::atomic<bool>& ending) {
            return worker->Do(work, ending);
          },
          signal_.get(), {.name = "camera"}));
  return {};
}

Status PlaneDaemon::OpenPage() {
  const PlaneTimes times = PlaneTimesAt(config_.clock.speed);
  pages_.options.lead_apart = true;
  pages_.options.start_skew_s += times.clock_allowance.seconds();
  pages_.options.notice_s =
      StallDetectionOf(config_.timing).notice.seconds() + times.border_notice.seconds();
  if (config_.http.port != 0)
    pages_.page = std::make_unique<PlanePage>(plane_.get(), config_.http.viewers_max);
  FOCALFLEET_TRY_ASSIGN(
      pages_.previewer,
      Previewer::Create([this](const PreviewWork& work,
                               const std::atomic<bool>& ending) { return Preview(work, ending); },
                        signal_.get(), {.name = "preview"}));
  if (pages_.page == nullptr) return {};
  FOCALFLEET_TRY_ASSIGN(pages_.http,
                        OpenHttp(config_.http, config_.control.socket, pages_.page->parts()));
  return {};
}

PlanDone PlaneDaemon::Preview(const PreviewWork& work, const std::atomic<bool>& ending) {
  PlanDone done = RunPlanJob(work.job, plane_->layout(), work.drives,
                             [&] { return ending.load() || work.given_up->load(); });
  if (pages_.page != nullptr && done.plan)
    pages_.page->KeepPreview(work.job, *done.plan, work.drives);
  return done;
}

/// A configuration does not wait for a preview: that is given up.
void PlaneDaemon::PreviewIfAsked() {
  while (const auto done = pages_.previewer->Take()) requests_->PreviewDone(Instant(), *done);
  std::optional<PlanePreview> asked = requests_->TakePreview();
  if (!asked) return;
  pages_.given_up = std::make_shared<std::atomic<bool>>(false);
  PreviewWork work{std::move(asked->preview.job), std::move(asked->drives), pages_.given_up};
  if (pages_.previewer->Submit(&work)) return;
  requests_->PreviewDone(
      Instant(), PlanFailed(work.job, {ErrorCode::kFull, "the planner has no room; ask again"}));
}

void PlaneDaemon::Expose(PlaneExposure exposure) {
  const std::uint64_t id = exposure.job.id;
  CameraWork work{std::move(exposure.job), std::move(exposure.drives)};
  if (camera_.thread != nullptr && camera_.thread->Submit(&work)) return;
  camera_.not_done.push_back(
      {id, Fail(ErrorCode::kUnavailable, camera_.thread == nullptr
                                             ? "the plane's coordinator has no camera"
                                             : "the camera's thread has no room")});
  signal_->Raise();
}

void PlaneDaemon::Run() {
  service_ = NotifySocket::FromEnvironment(&std::getenv);
  static_cast<void>(service_.Send("READY=1"));
  while (!ending_) {
    Turn();
    Wait();
  }
  static_cast<void>(service_.Send("STOPPING=1"));
  requests_->Close();
  pages_.http.reset();
  pages_.previewer.reset();
  credentials_.reset();
  camera_.thread.reset();
  output_.reset();
  link_.reset();
}

void PlaneDaemon::TakeKept() {
  while (const auto kept = keeper_->Take()) {
    if (kept->status) {
      keeping_.kept = kept->number;
      continue;
    }
    spdlog::error("the record of the plane cannot be written, it is tried again: {}",
                  kept->status.error().text);
    keeping_.again_at = now_ + clock_.Real(Seconds(1));
  }
  if (now_ < keeping_.again_at) return;
  KeepJob again = keeping_.job;
  if (keeper_->Submit(&again)) keeping_.again_at = kNever;
}

void PlaneDaemon::Turn() {
  now_ = clock_.Now();
  signal_->Clear();
  TakeKept();
  std::vector<PlanePlanDone> plans;
  while (auto plan = planner_->Take()) plans.push_back(std::move(*plan));
  std::vector<ExposureDone> exposures = std::exchange(camera_.not_done, {});
  while (auto done = camera_.thread != nullptr ? camera_.thread->Take() : std::nullopt)
    exposures.push_back(std::move(*done));
  const PlaneMail mail = link_->Take();
  std::vector<PlaneCommand> commands;
  requests_->Service(Instant(), &commands);
  PreviewIfAsked();
  PlaneEffects effects;
  coordinator_->Step({.now = now_,
                      .reports = mail.reports,
                      .commands = commands,
                      .plans = plans,
                      .exposures = exposures,
                      .kept = keeping_.kept},
                     &effects);
  Perform(&effects);
  requests_->ShowProgress(Instant());
  PlaneInstant shown = Instant();
  if (output_->due(shown.steady))
    output_->Read([&](const PlaneTable& table) {
      shown.table = &table;
      output_->Publish(shown);
    });
  wake_at_ = std::min({effects.wake_at, requests_->wake_at(), keeping_.again_at});
}

void PlaneDaemon::Perform(PlaneEffects* effects) {
  for (const std::string& line : effects->log) spdlog::info("{}", line);
  std::vector<ShellNote> notes = troubles_->TakeNotes();
  std::ranges::move(effects->notes, std::back_inserter(notes));
  for (const AlarmValue& alarm : alarms_.Take(notes, WallTime::Now())) output_->Publish(alarm);
  for (const PlaneOrder& order : effects->orders) link_->Send(order);
  if (effects->record) {
    keeping_.job = {std::move(*effects->record), effects->record_number};
    KeepJob job = keeping_.job;
    if (!keeper_->Submit(&job)) keeping_.again_at = now_;
  }
  if (effects->job) {
    if (pages_.given_up != nullptr) *pages_.given_up = true;
    PlaneJob job = std::move(*effects->job);
    if (!planner_->Submit(&job)) spdlog::error("the planner's thread has no room");
  }
  if (effects->exposure) Expose(std::move(*effects->exposure));
  for (const ReplyEffect& reply : effects->replies) requests_->Reply(Instant(), reply);
}

void PlaneDaemon::Wait() {
  const std::int64_t left_ns =
      wake_at_ == kNever ? 1'000'000'000 : clock_.ToMonotonic(wake_at_) - ReadMonotonicNs();
  const std::int64_t ms = std::clamp<std::int64_t>((left_ns + 999'999) / 1'000'000, 0, 1000);
  std::array<pollfd, 3> fds{
      {{requests_->fd(), POLLIN, 0}, {signal_->fd(), POLLIN, 0}, {signals_, POLLIN, 0}}};
  ::poll(fds.data(), fds.size(), static_cast<int>(ms));
  signalfd_siginfo info{};
  if (::read(signals_, &info, sizeof info) == sizeof info) {
    spdlog::info("ending; what moves finishes, and the sectors hold what they have");
    ending_ = true;
  }
}

}  // namespace

Result<PlaneLayout> LoadPlane(const DaemonConfig& config) {
  FOCALFLEET_TRY_ASSIGN(Layout layout, LoadLayout(config.fleet));
  std::vector<std::vector<BusId>> sectors;
  for (const std::string& text : config.plane.sectors) {
    const auto numbers = ParseRanges(text);
    if (!numbers)
      return Fail(ErrorCode::kInvalid, config.plane.sectors_at + ": " + numbers.error().text);
    std::vector<BusId>& buses = sectors.emplace_back();
    for (const std::uint32_t number : *numbers) buses.push_back({number});
  }
  auto plane = PlaneLayout::Create(std::move(layout), std::move(sectors));
  if (!plane) return Fail(plane.error().code, config.plane.sectors_at + ": " + plane.error().text);
  return plane;
}

Status RunPlane(const DaemonConfig& config) {
  EventLoop::BlockSignals();
  PlaneDaemon daemon(config);
  FOCALFLEET_TRY(daemon.Start());
  daemon.Run();
  return {};
}

}  // namespace focalfleet
