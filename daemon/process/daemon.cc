#include "daemon/process/daemon.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <memory>
#include <utility>

#include "daemon/clock/process_time.h"
#include "daemon/loop/event_loop.h"
#include "daemon/metrics/metrics_endpoint.h"
#include "daemon/metrics/metrics_sampler.h"
#include "daemon/page/plan_motion.h"
#include "daemon/process/bounded_end.h"
#include "daemon/process/camera_setup.h"
#include "daemon/process/caught_jobs.h"
#include "daemon/process/control_door.h"
#include "daemon/process/counted_commit.h"
#include "daemon/process/daemon_parts.h"
#include "daemon/process/dds_setup.h"
#include "daemon/process/fleet_setup.h"
#include "daemon/process/http_door.h"
#include "daemon/process/journal_setup.h"
#include "daemon/process/log.h"
#include "daemon/process/plane_daemon.h"
#include "daemon/process/sector_setup.h"
#include "daemon/process/slow_end.h"
#include "daemon/process/status_output.h"
#include "daemon/process/store_upkeep.h"
#include "daemon/store/store.h"
#include "daemon/store/store_reader.h"
#include "daemon/systemd/notify_socket.h"
#include "daemon/usage/build_version.h"
#include "daemon/verbs/alarm_register.h"
#include "daemon/verbs/model_registry.h"
#include "daemon/verbs/model_upkeep.h"
#include "daemon/verbs/request_handler.h"

namespace focalfleet {
namespace {

/// Limit of the time from the last turn of the loop until planner, camera and buses have ended.
/// Parts that take longer are left behind. A planner checks every 0.1 s or more often whether it is
/// wanted, a camera every 20 ms. A driver that restarts a controller takes up to a second. Half of
/// the limit would leave such a driver behind without need. With twice as much, the end of a daemon
/// with a dead camera would take longer than the 2 s that docs/cli.md promises.
constexpr std::chrono::milliseconds kEndWithin{1000};
/// The same for the store's file, into which its log is written back: some 9 MB of 5000 units. With
/// half of it a slow disk would leave the log beside the file, which loses nothing. With twice as
/// much a disk that hangs would hold the end up for longer.
constexpr std::chrono::milliseconds kStoreEndWithin{10'000};
/// The same for DDS, which takes 0.1 s. Half would be short on a busy host, twice as much over 2 s.
constexpr std::chrono::milliseconds kStatusEndWithin{500};

double SecondsSince(std::chrono::steady_clock::time_point begun) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
}

class Daemon {
 public:
  explicit Daemon(const DaemonConfig& config) : config_(config), clock_(config.clock.speed) {}

  Status Start();
  /// The loop ran until SIGTERM or SIGINT, and all parts have ended or are left behind. Errors:
  /// rows could not be stored.
  Status Run();
  /// A part hangs and still uses this object, which must not be destroyed then.
  [[nodiscard]] bool left() const { return left_; }

 private:
  Status End();
  Status StartThreads();
  std::function<void()> Answering(Heartbeat* heartbeat);
  void OpenService();
  StoreThread::Sinks StoreSinks();
  Status OpenRequestHandler();
  Status RestoreLastModel();
  void OpenMetrics();
  void ServeMetrics();
  PlanDone Plan(const PlannerWork& work, const std::atomic<bool>& ending,
                const std::function<void()>& alive);
  void KeepForPages(const PlannerWork& work, const struct Plan& plan);
  Status OpenCamera();
  ShellFacts Facts() const;

  DaemonConfig config_;
  HostClock clock_;
  std::unique_ptr<Layout> layout_;
  std::unique_ptr<Store> store_;
  std::unique_ptr<EventSignal> signal_;
  Service service_;
  StatusOutput status_;
  Measuring measuring_;
  Metrics metrics_;
  std::unique_ptr<Coordinator> coordinator_;
  std::unique_ptr<BusLines> lines_;
  StoreThreads stored_;
  std::unique_ptr<PlannerThread> planner_;
  std::unique_ptr<ModelRegistry> models_;
  AlarmRegister alarms_;
  Doors doors_;
  CommonStart start_;
  std::unique_ptr<EventLoop> loop_;
  std::unique_ptr<BoundedEnd> ending_;
  bool left_ = false;
};

Status Daemon::Start() {
  FOCALFLEET_TRY_ASSIGN(EventSignal signal, EventSignal::Create());
  signal_ = std::make_unique<EventSignal>(std::move(signal));
  status_.troubles = std::make_unique<DdsTroubles>([this] { signal_->Raise(); });
  FOCALFLEET_TRY_ASSIGN(Layout layout, LoadOwnLayout(config_));
  layout_ = std::make_unique<Layout>(std::move(layout));
  FOCALFLEET_TRY_ASSIGN(store_, Store::Open(config_.store.path));
  FOCALFLEET_TRY_ASSIGN(StoredFleet stored, store_->Load());
  alarms_ = AlarmRegister(stored);
  FOCALFLEET_TRY(OpenRequestHandler());
  FOCALFLEET_TRY_ASSIGN(auto ports, OpenPorts(config_, *layout_, clock_));
  FOCALFLEET_TRY_ASSIGN(auto sync, OpenSync(config_.sync));
  if (sync != nullptr)
    start_.sync = std::make_unique<SyncPulse>(
        std::move(sync), SyncPulse::Options{.late_most = config_.timing.sync_lead});
  const auto buses = layout_->buses();
  lines_ =
      std::make_unique<BusLines>(std::vector<BusId>(buses.begin(), buses.end()), std::move(ports));
  FOCALFLEET_TRY(OpenCamera());
  FOCALFLEET_TRY_ASSIGN(measuring_.carriers, OpenFibreCarriers(config_.hall, *layout_));
  OpenStatusOutput(config_, *layout_, service_.started, clock_, &status_);
  if (status_.publisher != nullptr || config_.camera.dds)
    measuring_.credentials =
        WatchCredentials(config_.dds, status_.troubles.get(), [this](WallTime end) {
          if (status_.publisher != nullptr) status_.publisher->Renew(end);
          if (measuring_.port != nullptr) measuring_.port->Renew(end);
        });
  OpenMetrics();
  std::vector<UnitDrive> drives(layout_->size(), config_.drive);
  FOCALFLEET_TRY_ASSIGN(
      stored_.journal, OpenJournal(config_, *layout_, drives, stored,
                                   [this](auto note) { status_.troubles->Note(std::move(note)); }));
  coordinator_ = std::make_unique<Coordinator>(layout_.get(), std::move(drives), config_.timing,
                                               std::move(stored));
  return StartThreads();
}

Status Daemon::OpenRequestHandler() {
  FOCALFLEET_TRY_ASSIGN(LineServer server, OpenControl(config_.control));
  doors_.audit = AuditTrail(ReadBootId());
  models_ = std::make_unique<ModelRegistry>(layout_.get());
  doors_.handler = std::make_unique<RequestHandler>(
      std::make_unique<LineServer>(std::move(server)),
      RequestHandler::Options{.progress_period = clock_.Real(Milliseconds(200)),
                              .second = clock_.Real(Seconds(1)),
                              .facts = [this] { return Facts(); },
                              .log = [](const std::string& text) { spdlog::info("{}", text); },
                              .store_path = config_.store.path,
                              .models = models_.get(),
                              .alarms = &alarms_,
                              .audit = &doors_.audit,
                              .room_for_rows = [this] { return stored_.writer->RoomForRows(); },
                              .own_pid = static_cast<std::uint32_t>(::getpid())});
  if (const Status restored = RestoreLastModel(); !restored)
    spdlog::error("no model is in force: {}", restored.error().text);
  return {};
}

Status Daemon::RestoreLastModel() {
  FOCALFLEET_TRY_ASSIGN(const auto reader, StoreReader::Open(config_.store.path));
  return RestoreModel(reader.get(), models_.get());
}

void Daemon::OpenMetrics() {
  if (config_.metrics.port == 0) return;
  metrics_.sampler =
      std::make_unique<MetricsSampler>(MetricsSampler::Parts{.layout = layout_.get(),
                                                             .facts = [this] { return Facts(); },
                                                             .power = &metrics_.power,
                                                             .out = &metrics_.values,
                                                             .clock = clock_});
}

void Daemon::ServeMetrics() {
  const DaemonConfig::Metrics& metrics = config_.metrics;
  if (metrics.port == 0) return;
  std::vector<std::string> names = metrics.names;
  names.push_back(metrics.address);
  metrics_.endpoint = std::make_unique<MetricsEndpoint>(
      MetricsEndpoint::Parts{
          .values = &metrics_.values, .work = &metrics_.work, .store_path = config_.store.path},
      HttpServer::Options{.address = metrics.address,
                          .port = metrics.port,
                          .names = std::move(names),
                          .tell = [this](const std::string& trouble) {
                            status_.troubles->Note(NoteOfMetrics(trouble));
                          }});
}

Status Daemon::OpenCamera() {
  if (!config_.camera.present()) return {};
  FOCALFLEET_TRY_ASSIGN(CameraSite site, LoadCameraSite(config_.camera));
  FOCALFLEET_TRY_ASSIGN(auto port, OpenCameraPort(config_, site.sensor, status_.troubles.get()));
  measuring_.port = port.get();
  measuring_.camera = std::make_unique<CameraWorker>(
      std::move(port),
      CameraWorker::Options{
          .layout = layout_.get(),
          .site = std::move(site),
          .patience = std::chrono::milliseconds(config_.camera.patience.ns / 1'000'000),
          .speed = config_.clock.speed,
          .log = [](const std::string& text) { spdlog::warn("{}", text); },
          .alive = Answering(&service_.camera)});
  return {};
}

StoreThread::Sinks Daemon::StoreSinks() {
  StoreThread::Sinks sinks;
  sinks.commit = [this](std::span<const Row> rows, WallTime at, std::size_t* refused) {
    return CommitCounted(rows, at, refused, store_.get(), &metrics_.work);
  };
  sinks.publish = [this](StatusBatch* status) {
    return status_.thread == nullptr || status_.thread->Publish(status);
  };
  sinks.alarm = [this](const AlarmValue& alarm) {
    if (status_.thread != nullptr) status_.thread->Publish(alarm);
  };
  sinks.log_error = [](const std::string& text) { spdlog::error("{}", text); };
  sinks.log_info = [](const std::string& text) { spdlog::info("{}", text); };
  sinks.alive = Answering(&service_.store);
  return sinks;
}

/// A thread that answers wakes the core, which waits for the answer.
std::function<void()> Daemon::Answering(Heartbeat* heartbeat) {
  return [this, heartbeat] {
    if (heartbeat->Answer()) signal_->Raise();
  };
}

Status Daemon::StartThreads() {
  FOCALFLEET_TRY(
      StartStatusThread([this] { stored_.writer->Wake(); }, Answering(&service_.status), &status_));
  StoreThread::Sinks sinks = StoreSinks();
  FOCALFLEET_TRY_ASSIGN(sinks.upkeep,
                        UpkeepOf(store_.get(), config_.store.keep_days,
                                 [this](const AuditHead& head) { return status_.Report(head); }));
  FOCALFLEET_TRY_ASSIGN(stored_.writer, StoreThread::Create(std::move(sinks), signal_.get()));
  FOCALFLEET_TRY_ASSIGN(
      planner_, PlannerThread::Create(
                    [this, alive = Answering(&service_.planner)](const PlannerWork& work,
                                                                 const std::atomic<bool>& ending) {
                      return Plan(work, ending, alive);
                    },
                    signal_.get(), {.name = "planner", .alive = Answering(&service_.planner)}));
  // The watchdog does not wait for the reader: a long question must not restart the daemon.
  FOCALFLEET_TRY_ASSIGN(stored_.reader, ReaderThread::Create(StoreQuestions(config_.store.path),
                                                             signal_.get(), {.name = "reader"}));
  FOCALFLEET_TRY_ASSIGN(doors_.states,
                        StateThread::Create(&StateCaught, signal_.get(), {.name = "state"}));
  if (measuring_.camera != nullptr || measuring_.carriers != nullptr) {
    FOCALFLEET_TRY_ASSIGN(
        measuring_.thread,
        CameraThread::Create(
            [this](const CameraWork& work, const std::atomic<bool>& ending) {
              return MeasureCaught(work, {measuring_.carriers.get(), measuring_.camera.get()},
                                   ending, &metrics_.work);
            },
            signal_.get(), {.name = "camera", .alive = Answering(&service_.camera)}));
  }
  FOCALFLEET_TRY_ASSIGN(start_.sector,
                        OpenSector(config_, *layout_, status_.troubles.get(), signal_.get()));
  OpenService();
  FOCALFLEET_TRY_ASSIGN(loop_,
                        EventLoop::Create({.shell = {.layout = layout_.get(),
                                                     .coordinator = coordinator_.get(),
                                                     .lines = lines_.get(),
                                                     .handler = doors_.handler.get(),
                                                     .models = models_.get(),
                                                     .alarms = &alarms_,
                                                     .audit = &doors_.audit,
                                                     .planner = planner_.get(),
                                                     .camera = measuring_.thread.get(),
                                                     .store = &stored_.writer->writer(),
                                                     .reader = stored_.reader.get(),
                                                     .states = doors_.states.get(),
                                                     .scheduler = status_.scheduler.get(),
                                                     .metrics = metrics_.sampler.get(),
                                                     .sync = start_.sync.get(),
                                                     .sector = start_.sector.get(),
                                                     .troubles = status_.troubles.get(),
                                                     .service = service_.report.get(),
                                                     .clock = clock_,
                                                     .stepped = Journalling(stored_.journal.get())},
                                           .threads = signal_.get(),
                                           .hang_up = &ReopenLog}));
  ServeMetrics();
  if (status_.page != nullptr) status_.plans.KeepIn(config_.store.path + ".plans");
  doors_.diagnosis = std::make_unique<DiagnosisJob>(DiagnosisJob::Options{
      .programs = StudyPrograms(), .folder = config_.store.path + ".diagnosis"});
  FOCALFLEET_TRY_ASSIGN(doors_.http, OpenHttp(config_.http, config_.control.socket,
                                              {.layout = layout_.get(),
                                               .feed = status_.page.get(),
                                               .plans = &status_.plans,
                                               .night = &status_.night,
                                               .diagnosis = doors_.diagnosis.get(),
                                               .store = config_.store.path}));
  return {};
}

PlanDone Daemon::Plan(const PlannerWork& work, const std::atomic<bool>& ending,
                      const std::function<void()>& alive) {
  const auto begun = std::chrono::steady_clock::now();
  PlanDone done = PlanCaught(work, *layout_, ending, alive);
  metrics_.work.planner_s.Observe(SecondsSince(begun));
  if (metrics_.sampler != nullptr && done.plan && !done.plan->moves.empty())
    metrics_.power.Put(
        std::make_unique<const PlannedPower>(PowerOf(*done.plan, work.job, *layout_, work.drives)));
  if (status_.page != nullptr && done.plan && !done.plan->moves.empty())
    KeepForPages(work, *done.plan);
  return done;
}

/// Pages get the plan from here, and the core has no part in it.
void Daemon::KeepForPages(const PlannerWork& work, const struct Plan& plan) {
  std::string motion = EncodeMotion(plan, *layout_, work.drives);
  PlanPower power = PowerOverTime(plan, work.job, *layout_, work.drives);
  if (work.job.purpose == PlanPurpose::kPreview) {
    status_.night.TakePreview(work.job.job, std::move(power));
    return status_.plans.PutPreview(work.job.job, std::move(motion));
  }
  status_.plans.Put(work.configuration, std::move(motion));
  power.configuration = work.configuration;
  power.at = WallTime::Now();
  status_.night.Take(std::move(power));
}

void Daemon::OpenService() {
  const Environment environment = [](const char* name) { return std::getenv(name); };
  service_.socket = NotifySocket::FromEnvironment(environment);
  const auto interval = WatchdogInterval(environment);
  if (interval && service_.socket.present()) {
    std::vector<Watchdog::Thread> threads = {
        // A store that waits for the disk is no thread that hangs: the daemon says so, and goes on.
        {"store", &service_.store,
         [this, answer = Answering(&service_.store)] {
           stored_.writer->Wake();
           if (stored_.writer->writer().in_disk()) answer();
         }},
        {"planner", &service_.planner, [this] { planner_->Wake(); }}};
    if (status_.thread != nullptr)
      threads.push_back({"status", &service_.status, [this] { status_.thread->Wake(); }});
    if (measuring_.thread != nullptr)
      threads.push_back({"camera", &service_.camera, [this] { measuring_.thread->Wake(); }});
    // Rounds begin four times an interval, and a thread has half of one to answer. Two signs of
    // life are then never further apart than three quarters of what the manager allows, and a
    // thread is named before the daemon is killed.
    service_.watchdog = std::make_unique<Watchdog>(
        std::move(threads),
        Watchdog::Options{.period = clock_.Real({interval->ns / 4}),
                          .limit = clock_.Real({interval->ns / 2}),
                          .feed = [this] { static_cast<void>(service_.socket.Send("WATCHDOG=1")); },
                          .log_error = [](const std::string& text) { spdlog::error("{}", text); },
                          .log_info = [](const std::string& text) { spdlog::info("{}", text); }});
  }
  service_.report = std::make_unique<ServiceReport>(&service_.socket, service_.watchdog.get(),
                                                    clock_.Real(Seconds(1)));
}

Status Daemon::Run() {
  spdlog::info("focalfleetd {} is ready: {} units on {} buses, store {}, control {}", Version(),
               layout_->size(), layout_->buses().size(), config_.store.path,
               config_.control.socket);
  loop_->Run();
  if (coordinator_->busy())
    spdlog::warn(
        "configuration {} was under way: units that move finish by themselves and are asked at the "
        "next start",
        coordinator_->configuration().id);
  return End();
}

/// The order of the end: nothing more goes to the buses, then the last rows are stored, then
/// clients learn of the end. The reader closes before the writer, which then leaves one file. Parts
/// that may hang end meanwhile, or are left behind, as is a store whose disk does not answer.
Status Daemon::End() {
  const SlowEnd slow_end(&service_.socket,
                         {.progress = [this] { return stored_.writer->committed_through(); }});
  ending_ = std::make_unique<BoundedEnd>(
      std::vector<BoundedEnd::Part>{{"the buses", [this] { lines_.reset(); }},
                                    {"the planner", [this] { planner_.reset(); }},
                                    {"the camera", [this] { measuring_.thread.reset(); }},
                                    {"the metrics", [this] { metrics_.endpoint.reset(); }},
                                    {"the journal", [this] { stored_.journal.reset(); }},
                                    {"HTTP", [this] { doors_.http.reset(); }},
                                    // A question that runs is cut short.
                                    {"the reader", [this] { stored_.reader.reset(); }}});
  const Status stored = stored_.writer->Finish();
  doors_.handler->Close();
  // A store's thread that is left behind still uses the status.
  const bool is_stored = stored_.writer->ended();
  status_.ending = std::make_unique<BoundedEnd>(
      is_stored ? std::vector<BoundedEnd::Part>{{"the status",
                                                 [this] {
                                                   measuring_.credentials.reset();
                                                   status_.thread.reset();
                                                   status_.publisher.reset();
                                                 }}}
                : std::vector<BoundedEnd::Part>{});
  std::vector<std::string> left = ending_->Wait(kEndWithin);
  if (is_stored)
    stored_.closing = std::make_unique<BoundedEnd>(
        std::vector<BoundedEnd::Part>{{"the store", [this] { store_.reset(); }}});
  doors_.handler.reset();
  for (std::string& part : status_.ending->Wait(kStatusEndWithin)) left.push_back(std::move(part));
  if (is_stored)
    for (std::string& part : stored_.closing->Wait(kStoreEndWithin))
      left.push_back(std::move(part));
  left_ = !left.empty() || !is_stored;
  if (!left.empty())
    spdlog::warn("{} did not end in time and {} left behind", fmt::join(left, ", "),
                 left.size() == 1 ? "is" : "are");
  if (stored)
    spdlog::info("ended, all is stored");
  else
    spdlog::error("ended with rows that could not be stored: {}", stored.error().text);
  return stored;
}

ShellFacts Daemon::Facts() const {
  ShellFacts facts;
  facts.version = Version();
  facts.started = service_.started;
  const AlarmRegister::Counts alarms = alarms_.Count(WallTime::Now());
  facts.alarms = {alarms.open, alarms.muted, alarms.worst ? Name(*alarms.worst) : ""};
  facts.page = PageAddress(config_.http);
  facts.store_path = config_.store.path;
  facts.store_failing = stored_.writer->failing();
  facts.batches_waiting = stored_.writer->waiting();
  facts.store.transactions = metrics_.work.transactions;
  facts.store.rows = metrics_.work.rows;
  facts.dds_enabled = status_.publisher != nullptr;
  facts.dds_trouble = status_.troubles->Summary();
  facts.dds_troubles = status_.troubles->reported();
  if (status_.publisher != nullptr) {
    facts.dds_samples = status_.publisher->samples();
    facts.dds_bytes = status_.publisher->bytes();
  }
  facts.steps = loop_->steps();
  facts.cpu_s = ProcessCpuSeconds();
  facts.buses = lines_->Facts();
  return facts;
}

}  // namespace

const char* Version() { return BuildVersion(); }

DaemonEnd RunDaemon(const DaemonConfig& config) {
  EventLoop::BlockSignals();
  if (Status open = OpenLog(config.log, JournalOfThisProcess()); !open) return {std::move(open)};
  if (config.plane.coordinates()) return {RunPlane(config)};
  auto daemon = std::make_unique<Daemon>(config);
  Status ended = daemon->Start();
  if (ended) ended = daemon->Run();
  const bool left = daemon->left();
  if (left) static_cast<void>(daemon.release());  // a part that hangs still uses it
  return {std::move(ended), left};
}

}  // namespace focalfleet
