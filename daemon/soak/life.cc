#include "daemon/soak/life.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <utility>

#include "daemon/soak/virtual_time.h"
#include "daemon/store/retention.h"
#include "daemon/store/store_reader.h"
#include "daemon/verbs/model_upkeep.h"
#include "fleet/plan/job.h"

namespace focalfleet::soak {
namespace {

constexpr const char* kStorePath = "store.sqlite";
/// Looks of a search after which it counts as one without end, of 1 ms or so each. A plan takes one
/// to two looks a unit, and up to 2200 in all where its targets are hard to come by. The daemon
/// gives it 10 s; half of these looks would give up plans that it finds, twice of them cost time.
int PlanLooksMax(std::size_t units, bool limited) {
  const int most = std::max(3000, static_cast<int>(units) * 4);
  return limited ? 10 * most : most;  // units look for a start again and again
}

StoreOptions OptionsOf(const MemoryDisk& disk) {
  return {.busy_wait = std::chrono::milliseconds(0), .vfs = disk.name(), .vfs_has_files = true};
}

}  // namespace

Life::Life(const Surroundings& around) : around_(around), clock_(VirtualClock()) {}

Result<std::unique_ptr<Life>> Life::Start(const Surroundings& around) {
  std::unique_ptr<Life> life(new Life(around));
  FOCALFLEET_TRY(life->Open());
  return life;
}

Status Life::Open() {
  const Layout& layout = around_.plant->layout();
  FOCALFLEET_TRY_ASSIGN(store_, Store::Open(kStorePath, OptionsOf(*around_.disk)));
  FOCALFLEET_TRY_ASSIGN(StoredFleet stored, store_->Load());
  FOCALFLEET_TRY_ASSIGN(auto prune, PruningOf(store_.get(),
                                              {.keep_days = around_.keep_days,
                                               .monotonic_ns = &ReadVirtualNs,
                                               .wall = &ReadVirtualWall},
                                              around_.log));
  alarms_ = AlarmRegister(stored);
  models_ = std::make_unique<ModelRegistry>(&layout, &ReadVirtualWall);
  auto hall = std::make_unique<LineHall>(
      LineHall::Hooks{.urgent = &RequestHandler::IsStop, .out = around_.out});
  hall_ = hall.get();
  handler_ = std::make_unique<RequestHandler>(
      std::move(hall),
      RequestHandler::Options{.facts = [this] { return Facts(); },
                              .log = around_.log,
                              .store_path = kStorePath,
                              .store = OptionsOf(*around_.disk),
                              .models = models_.get(),
                              .alarms = &alarms_,
                              .audit = &audit_,
                              .room_for_rows = [this] { return writer_->RoomForRows(); }});
  const auto restored = [&]() -> Status {
    FOCALFLEET_TRY_ASSIGN(const auto reader,
                          StoreReader::Open(kStorePath, OptionsOf(*around_.disk)));
    return RestoreModel(reader.get(), models_.get());
  }();
  if (!restored) around_.log("no model is in force: " + restored.error().text);
  std::vector<std::unique_ptr<PollablePort>> ports;
  for (std::size_t bus = 0; bus < layout.buses().size(); ++bus)
    ports.push_back(std::make_unique<PlantPort>(around_.plant, bus, around_.port));
  const auto buses = layout.buses();
  lines_ =
      std::make_unique<BusLines>(std::vector<BusId>(buses.begin(), buses.end()), std::move(ports));
  scheduler_ = std::make_unique<StatusScheduler>(
      layout.size(),
      StatusScheduler::Options{.rate_hz = 5, .version = "soak", .started = clock_.Wall()}, clock_);
  CoordinatorConfig config;
  config.has_camera = around_.camera != nullptr;
  around_.starts(stored, config);
  coordinator_ =
      std::make_unique<Coordinator>(&layout, around_.plant->drives(), config, std::move(stored));
  writer_ = std::make_unique<StoreWriter>(MakeSinks(std::move(prune)));
  MakeQueues();
  MakeShell();
  return {};
}

StoreWriter::Sinks Life::MakeSinks(std::function<bool()> prune) {
  StoreWriter::Sinks sinks;
  sinks.commit = [this](std::span<const Row> rows, WallTime at, std::size_t* refused) {
    around_.commits(rows);
    Status done = store_->Commit(rows, at, refused);
    around_.committed(rows, done.has_value());
    return done;
  };
  sinks.publish = [this](StatusBatch* status) {
    if (!around_.publisher_has_room()) return false;
    around_.published(*status);
    return true;
  };
  sinks.alarm = [this](const AlarmValue& alarm) { around_.log(alarm.row.text); };
  sinks.log_error = around_.log;
  sinks.log_info = around_.log;
  sinks.monotonic_ns = &ReadVirtualNs;
  sinks.wall = &ReadVirtualWall;
  sinks.upkeep = std::move(prune);
  sinks.progressed = [this] { progressed_ = true; };
  sinks.offered = [this] {
    if (writer_due_ == kNever) writer_due_ = clock_.Now() + around_.commit_takes();
  };
  return sinks;
}

void Life::MakeQueues() {
  const Layout* layout = &around_.plant->layout();
  planner_ = std::make_unique<TimedQueue<PlannerWork, PlanDone>>(
      TimedQueue<PlannerWork, PlanDone>::Options{
          .work =
              [this, layout](const PlannerWork& work) {
                if (around_.planner_fails())
                  return PlanFailed(work.job, {ErrorCode::kUnavailable, "the planner failed"});
                // A search that finds no end is given up after so many looks, not after a time.
                int looks = 0;
                const int most = PlanLooksMax(layout->size(), around_.plan_limits.any());
                PlanJob job = work.job;
                job.options.power = around_.plan_limits;
                return RunPlanJob(job, *layout, work.drives,
                                  [&looks, most] { return ++looks > most; });
              },
          .takes = around_.plan_takes,
          .has_room = around_.planner_has_room});
  reader_ = std::make_unique<TimedQueue<StoreQuestion, StoreAnswer>>(
      TimedQueue<StoreQuestion, StoreAnswer>::Options{
          .work =
              [this, questions = StoreQuestions(kStorePath, OptionsOf(*around_.disk))](
                  const StoreQuestion& question) mutable {
                static const std::atomic<bool> ending{false};
                if (around_.reader_fails())
                  return StoreAnswer{
                      question.number,
                      EncodeError(question.request, {ErrorCode::kUnavailable, "no answer"})};
                return questions(question, ending);
              },
          .takes = [] { return Milliseconds(3); }});
  states_ = std::make_unique<TimedQueue<StateRows, std::string>>(
      TimedQueue<StateRows, std::string>::Options{
          .work = [](const StateRows& rows) { return StateText(*rows); },
          .takes = [] { return Milliseconds(5); }});
  if (around_.camera != nullptr) camera_ = around_.camera();
}

void Life::MakeShell() {
  shell_ = std::make_unique<Shell>(Shell::Parts{.layout = &around_.plant->layout(),
                                                .coordinator = coordinator_.get(),
                                                .lines = lines_.get(),
                                                .handler = handler_.get(),
                                                .models = models_.get(),
                                                .alarms = &alarms_,
                                                .audit = &audit_,
                                                .planner = planner_.get(),
                                                .camera = camera_.get(),
                                                .store = writer_.get(),
                                                .reader = reader_.get(),
                                                .states = states_.get(),
                                                .scheduler = scheduler_.get(),
                                                .clock = clock_,
                                                .passed = around_.passed,
                                                .stepped = around_.stepped});
}

HostInstant Life::wake_at() {
  if (hall_->waits() || progressed_ || around_.plant->hears()) return clock_.Now();
  return std::min({shell_->wake_at(), writer_due_, planner_->due(), reader_->due(), states_->due(),
                   camera_ == nullptr ? kNever : camera_->due()});
}

void Life::Turn() {
  if (writer_due_ <= clock_.Now()) {
    writer_due_ = kNever;
    const StoreWriter::Rest rest = writer_->Turn(false);
    if (rest.wait) {
      const auto wait = std::chrono::nanoseconds(*rest.wait).count();
      writer_due_ = clock_.Now() + (wait == 0 ? around_.commit_takes() : DurationNs{wait});
    }
  }
  progressed_ = false;
  for (std::size_t line = 0; line < lines_->size(); ++line) lines_->MarkReady(line);
  if (hall_->waits()) shell_->MarkRequests();
  shell_->Turn();
}

bool Life::End() {
  shell_->End();
  constexpr int kTurnsMax = 10'000;
  for (int turn = 0; turn < kTurnsMax; ++turn) {
    writer_->HandOver();
    if (writer_->Turn(true).ended) break;
  }
  const bool stored = !writer_->failing() && writer_->waiting() == 0;
  handler_->Close();
  store_.reset();
  return stored;
}

ShellFacts Life::Facts() const {
  ShellFacts facts;
  facts.version = "soak";
  facts.started = clock_.Wall();
  facts.store_failing = writer_->failing();
  facts.batches_waiting = writer_->waiting();
  facts.steps = shell_->steps();
  facts.buses = lines_->Facts();
  return facts;
}

}  // namespace focalfleet::soak
