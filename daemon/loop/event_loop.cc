#include "daemon/loop/event_loop.h"

#include <pthread.h>
#include <signal.h>
#include <spdlog/spdlog.h>
#include <sys/epoll.h>
#include <sys/signalfd.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <string>
#include <utility>

#include "daemon/loop/event_log.h"
#include "daemon/verbs/model_upkeep.h"
#include "fleet/plan/job.h"

namespace focalfleet {
namespace {

// The data of an epoll event is the number of a bus line, or one of these constants.
constexpr std::uint64_t kRequests = std::uint64_t{1} << 32;
constexpr std::uint64_t kThreads = kRequests + 1;
constexpr std::uint64_t kTimer = kRequests + 2;
constexpr std::uint64_t kSignals = kRequests + 3;

sigset_t OurSignals() {
  sigset_t set;
  sigemptyset(&set);
  for (const int number : {SIGTERM, SIGINT, SIGHUP}) sigaddset(&set, number);
  return set;
}

}  // namespace

void EventLoop::BlockSignals() {
  const sigset_t set = OurSignals();
  ::pthread_sigmask(SIG_BLOCK, &set, nullptr);
  ::signal(SIGPIPE, SIG_IGN);
}

Result<std::unique_ptr<EventLoop>> EventLoop::Create(const Parts& parts) {
  std::unique_ptr<EventLoop> loop(new EventLoop(parts));
  FOCALFLEET_TRY(loop->Open());
  return loop;
}

EventLoop::~EventLoop() {
  for (const int fd : {epoll_, timer_, signals_})
    if (fd >= 0) ::close(fd);
}

Status EventLoop::Open() {
  const sigset_t set = OurSignals();
  epoll_ = ::epoll_create1(EPOLL_CLOEXEC);
  timer_ = ::timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC);
  signals_ = ::signalfd(-1, &set, SFD_NONBLOCK | SFD_CLOEXEC);
  if (epoll_ < 0 || timer_ < 0 || signals_ < 0)
    return Fail(ErrorCode::kUnavailable,
                std::string("no descriptors left: ") + std::strerror(errno));
  for (std::size_t line = 0; line < parts_.lines->size(); ++line)
    if (parts_.lines->fd(line) >= 0) FOCALFLEET_TRY(Watch(parts_.lines->fd(line), line));
  FOCALFLEET_TRY(Watch(parts_.handler->fd(), kRequests));
  FOCALFLEET_TRY(Watch(parts_.threads->fd(), kThreads));
  FOCALFLEET_TRY(Watch(timer_, kTimer));
  return Watch(signals_, kSignals);
}

Status EventLoop::Watch(int fd, std::uint64_t what) {
  epoll_event event{EPOLLIN, {.u64 = what}};
  if (::epoll_ctl(epoll_, EPOLL_CTL_ADD, fd, &event) == 0) return {};
  return Fail(ErrorCode::kUnavailable, std::string("cannot watch: ") + std::strerror(errno));
}

void EventLoop::Run() {
  effects_.wake_at = HostInstant{0};  // the first step is due at once
  while (!stopping_) {
    Wait();
    ServeSync();
    Gather();
    const bool due = StepIsDue();
    if (due) {
      Step();
      Perform();
    }
    parts_.lines->Flush(parts_.clock);
    PublishStatus();
    parts_.service->Serve(View(), due);
  }
  parts_.service->Ending();
  effects_.Clear();
  parts_.coordinator->End(now_, &effects_);
  LogChanges();
  parts_.alarms->Take(WallTime::Now(), &effects_.rows);
  if (!effects_.rows.empty()) parts_.store->Commit(effects_.batch, std::move(effects_.rows));
}

void EventLoop::Wait() {
  now_ = parts_.clock.Now();
  HostInstant wake = std::min({effects_.wake_at, parts_.lines->wake_at(now_, parts_.clock),
                               parts_.handler->wake_at(), parts_.service->wake_at()});
  if (parts_.scheduler != nullptr) wake = std::min(wake, parts_.scheduler->wake_at());
  if (parts_.metrics != nullptr) wake = std::min(wake, parts_.metrics->wake_at());
  if (parts_.sync != nullptr) wake = std::min(wake, parts_.sync->wake_at());
  if (wake <= now_) return;
  ArmTimer(wake);
  DispatchReady(-1);
}

void EventLoop::DispatchReady(int timeout_ms) {
  std::array<epoll_event, 128> events;
  const int count =
      ::epoll_wait(epoll_, events.data(), static_cast<int>(events.size()), timeout_ms);
  for (int i = 0; i < count; ++i) Dispatch(events[static_cast<std::size_t>(i)].data.u64);
}

// The pulse comes before everything else of a turn, because units take the instant from its edge.
void EventLoop::ServeSync() {
  if (parts_.sync == nullptr) return;
  const std::string trouble = parts_.sync->Serve(parts_.clock.Now());
  if (!trouble.empty()) spdlog::error("SYNC {}", trouble);
}

void EventLoop::ArmTimer(HostInstant at) {
  const std::int64_t ns = at == kNever ? 0 : parts_.clock.ToMonotonic(at);  // 0 disarms
  if (ns == timer_set_ns_) return;
  timer_set_ns_ = ns;
  itimerspec when{};
  when.it_value = {.tv_sec = ns / 1'000'000'000, .tv_nsec = ns % 1'000'000'000};
  ::timerfd_settime(timer_, TFD_TIMER_ABSTIME, &when, nullptr);
}

void EventLoop::Dispatch(std::uint64_t what) {
  if (what < kRequests) {
    parts_.lines->MarkReady(what);
  } else if (what == kRequests) {
    requests_ready_ = true;
  } else if (what == kThreads) {
    parts_.threads->Clear();
  } else if (what == kSignals) {
    ReadSignals();
  } else if (what == kTimer) {
    std::uint64_t expirations = 0;
    [[maybe_unused]] const ssize_t got = ::read(timer_, &expirations, sizeof expirations);
    timer_set_ns_ = 0;
  }
}

void EventLoop::ReadSignals() {
  signalfd_siginfo info{};
  while (::read(signals_, &info, sizeof info) == sizeof info) {
    if (info.ssi_signo == SIGHUP) {
      // The configuration is not read anew while units may move.
      parts_.service->BeginReload();
      parts_.hang_up();
      parts_.service->EndReload();
      continue;
    }
    spdlog::info("{} received, ending", info.ssi_signo == SIGTERM ? "SIGTERM" : "SIGINT");
    stopping_ = true;
  }
}

void EventLoop::Gather() {
  // All that is there at `now_` is read in this turn. Otherwise units would count as silent while
  // their answers wait, where the host was held up on its way here.
  now_ = parts_.clock.Now();
  DispatchReady(0);
  frames_.clear();
  links_.clear();
  commands_.clear();
  plans_ = std::exchange(not_done_plans_, {});
  exposures_ = std::exchange(not_done_exposures_, {});
  parts_.lines->Receive(now_, &frames_, &links_);
  while (auto plan = parts_.planner->Take()) {
    if (plan->purpose == PlanPurpose::kPreview)
      parts_.handler->PreviewDone(View(), *plan);
    else
      plans_.push_back(std::move(*plan));
  }
  while (auto done = parts_.camera != nullptr ? parts_.camera->Take() : std::nullopt)
    exposures_.push_back(std::move(*done));
  if (parts_.troubles != nullptr) notes_ = parts_.troubles->TakeNotes();
  if (std::exchange(requests_ready_, false)) parts_.handler->Service(View(), &commands_);
  if (auto preview = parts_.handler->TakePreview()) SubmitPlan(std::move(*preview));
  while (const auto answer = parts_.reader->Take()) parts_.handler->Answered(*answer);
  parts_.handler->SubmitQuestions(
      [this](StoreQuestion* question) { return parts_.reader->Submit(question); });
}

bool EventLoop::StepIsDue() const {
  return !frames_.empty() || !links_.empty() || !commands_.empty() || !plans_.empty() ||
         !exposures_.empty() || !notes_.empty() || parts_.audit->waiting() ||
         parts_.store->committed_through() != store_.committed_through ||
         parts_.store->failing() != store_.failing || now_ >= effects_.wake_at;
}

void EventLoop::Step() {
  // This order matters: a batch that is committed in between is reported one step later.
  // The store's thread may change its failure at any time, so it is read once.
  const std::optional<Error> failure = parts_.store->failure();
  if (store_.failing != failure.has_value()) parts_.alarms->NoteStore(WallTime::Now(), failure);
  store_.failing = failure.has_value();
  store_.committed_through = parts_.store->committed_through();
  const std::vector<RefusedRow> refused = parts_.store->TakeRefused();
  effects_.Clear();
  parts_.coordinator->Step({.now = now_,
                            .frames = frames_,
                            .links = links_,
                            .commands = commands_,
                            .plans = plans_,
                            .exposures = exposures_,
                            .notes = notes_,
                            .committed_through = store_.committed_through,
                            .store_failing = store_.failing,
                            .refused = refused},
                           &effects_);
  ++steps_;
}

void EventLoop::Perform() {
  LogChanges();
  NoteEffects(View(), effects_, parts_.models->compensation());
  if (parts_.metrics != nullptr) parts_.metrics->Note(View(), effects_);
  const WallTime now = WallTime::Now();
  parts_.alarms->Take(now, &effects_.rows);
  parts_.audit->Take(effects_.replies,
                     parts_.coordinator->busy() ? parts_.coordinator->configuration().id : 0, now,
                     &effects_.rows);
  if (!effects_.rows.empty()) {
    // Entries of the audit alone belong to no batch of the coordinator: they go with its last one.
    last_batch_ = std::max(last_batch_, effects_.batch);
    parts_.store->Commit(last_batch_, std::move(effects_.rows));
  }
  for (const OutFrame& frame : effects_.frames) parts_.lines->Put(frame, now_);
  if (effects_.sync_at && parts_.sync != nullptr) parts_.sync->Plan(*effects_.sync_at);
  if (effects_.plan_job) SubmitPlan(std::move(*effects_.plan_job));
  if (effects_.exposure && parts_.camera != nullptr) {
    const auto drives = parts_.coordinator->drives();
    CameraWork work{std::move(*effects_.exposure), {drives.begin(), drives.end()}};
    if (!parts_.camera->Submit(&work)) {
      not_done_exposures_.push_back(
          {work.job.id, Fail(ErrorCode::kUnavailable, "the camera's thread has no room")});
      parts_.threads->Raise();
    }
  }
  for (const ReplyEffect& reply : effects_.replies) parts_.handler->Reply(View(), reply);
  if (parts_.scheduler != nullptr) parts_.scheduler->Changed(effects_.changed);
}

// A configuration does not wait for a preview: the planner gives the preview up.
void EventLoop::SubmitPlan(PlanJob job) {
  const bool preview = job.purpose == PlanPurpose::kPreview;
  if (!preview && preview_given_up_ != nullptr) *preview_given_up_ = true;
  if (preview) preview_given_up_ = std::make_shared<std::atomic<bool>>(false);
  const auto drives = parts_.coordinator->drives();
  PlannerWork work{
      std::move(job), {drives.begin(), drives.end()}, preview ? preview_given_up_ : nullptr};
  if (parts_.planner->Submit(&work)) return;
  if (preview) return parts_.handler->RefusePreview();
  not_done_plans_.push_back(
      PlanFailed(work.job, {ErrorCode::kUnavailable, "the planner's thread has no room"}));
  parts_.threads->Raise();
}

void EventLoop::PublishStatus() {
  parts_.store->HandOver();
  parts_.handler->ShowProgress(View());
  if (parts_.metrics != nullptr) parts_.metrics->SampleIfDue(View());
  if (parts_.scheduler == nullptr || !parts_.scheduler->due(now_)) return;
  StatusBatch status = parts_.scheduler->Take(View(), last_batch_, store_.failing);
  if (!parts_.store->Publish(&status)) parts_.scheduler->GiveBack(status, *parts_.layout);
}

void EventLoop::LogChanges() {
  for (const LinkEvent& link : links_)
    LogLink(link, parts_.lines->name(link.bus), parts_.lines->trouble(link.bus));
  for (const Row& row : effects_.rows) LogRow(row);
}

FleetView EventLoop::View() const {
  return {.layout = parts_.layout,
          .coordinator = parts_.coordinator,
          .now = now_,
          .at = WallTime::Now(),
          .compensation = std::as_const(*parts_.models).compensation()};
}

}  // namespace focalfleet
