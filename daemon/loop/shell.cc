#include "daemon/loop/shell.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <string>
#include <utility>

#include "daemon/loop/event_log.h"
#include "daemon/verbs/model_upkeep.h"
#include "fleet/plan/job.h"

namespace focalfleet {

Shell::Shell(Parts parts) : parts_(std::move(parts)) {
  effects_.wake_at = HostInstant{0};  // the first step is due at once
}

HostInstant Shell::wake_at() {
  now_ = parts_.clock.Now();
  if (!not_done_plans_.empty() || !not_done_exposures_.empty()) return now_;
  HostInstant wake = std::min(
      {effects_.wake_at, parts_.lines->wake_at(now_, parts_.clock), parts_.handler->wake_at()});
  if (parts_.service != nullptr) wake = std::min(wake, parts_.service->wake_at());
  if (parts_.scheduler != nullptr) wake = std::min(wake, parts_.scheduler->wake_at());
  if (parts_.metrics != nullptr) wake = std::min(wake, parts_.metrics->wake_at());
  if (parts_.sync != nullptr) wake = std::min(wake, parts_.sync->wake_at());
  if (parts_.sector != nullptr) wake = std::min(wake, parts_.sector->wake_at());
  return wake;
}

void Shell::Turn() {
  ServeSync();
  Gather();
  parts_.passed(TurnPoint::kGathered);
  const bool due = StepIsDue();
  if (due) {
    Step();
    parts_.passed(TurnPoint::kStepped);
    Perform();
  }
  parts_.lines->Flush(parts_.clock);
  parts_.passed(TurnPoint::kFlushed);
  PublishStatus();
  parts_.passed(TurnPoint::kStatusGiven);
  if (parts_.service != nullptr) parts_.service->Serve(View(), due);
}

void Shell::End() {
  if (parts_.service != nullptr) parts_.service->Ending();
  effects_.Clear();
  parts_.coordinator->End(now_, &effects_);
  LogChanges();
  parts_.alarms->Take(parts_.clock.Wall(), &effects_.rows);
  if (!effects_.rows.empty()) parts_.store->Commit(effects_.batch, std::move(effects_.rows));
}

// The pulse comes before everything else of a turn, because units take the instant from its edge.
void Shell::ServeSync() {
  if (parts_.sync == nullptr) return;
  const std::string trouble = parts_.sync->Serve(parts_.clock.Now());
  if (!trouble.empty()) spdlog::error("SYNC {}", trouble);
}

void Shell::Gather() {
  // All that is there at `now_` is read in this turn. Otherwise units would count as silent while
  // their answers wait, where the host was held up on its way here.
  now_ = parts_.clock.Now();
  parts_.look();
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
  notes_.clear();
  if (parts_.troubles != nullptr) notes_ = parts_.troubles->TakeNotes();
  if (std::exchange(requests_ready_, false)) parts_.handler->Service(View(), &commands_);
  if (auto preview = parts_.handler->TakePreview()) SubmitPlan(std::move(*preview));
  while (const auto answer = parts_.reader->Take()) parts_.handler->Answered(*answer);
  parts_.handler->SubmitQuestions(
      [this](StoreQuestion* question) { return parts_.reader->Submit(question); });
  if (parts_.sector != nullptr)
    parts_.sector->Gather(now_, *parts_.coordinator, &commands_, &notes_);
}

bool Shell::StepIsDue() const {
  return !frames_.empty() || !links_.empty() || !commands_.empty() || !plans_.empty() ||
         !exposures_.empty() || !notes_.empty() || parts_.audit->waiting() ||
         parts_.store->committed_through() != store_.committed_through ||
         parts_.store->failing() != store_.failing || now_ >= effects_.wake_at;
}

void Shell::Step() {
  // This order matters: a batch that is committed in between is reported one step later.
  // The store's thread may change its failure at any time, so it is read once.
  const std::optional<Error> failure = parts_.store->failure();
  if (store_.failing != failure.has_value()) parts_.alarms->NoteStore(parts_.clock.Wall(), failure);
  // Other failures are logged by the writer, whose thread now waits for the disk.
  if (const bool hangs = parts_.store->hangs(); std::exchange(store_.hangs, hangs) != hangs)
    spdlog::log(hangs ? spdlog::level::err : spdlog::level::info, "the disk {}",
                hangs ? "does not answer: the store cannot be written, nothing new is started"
                      : "answers again");
  store_.failing = failure.has_value();
  store_.committed_through = parts_.store->committed_through();
  const std::vector<RefusedRow> refused = parts_.store->TakeRefused();
  effects_.Clear();
  const Inputs inputs{.now = now_,
                      .frames = frames_,
                      .links = links_,
                      .commands = commands_,
                      .plans = plans_,
                      .exposures = exposures_,
                      .notes = notes_,
                      .committed_through = store_.committed_through,
                      .store_failing = store_.failing,
                      .refused = refused};
  parts_.coordinator->Step(inputs, &effects_);
  parts_.stepped(inputs, effects_);
  ++steps_;
}

void Shell::Perform() {
  LogChanges();
  NoteEffects(View(), effects_, parts_.models->compensation());
  if (parts_.metrics != nullptr) parts_.metrics->Note(View(), effects_);
  const WallTime now = parts_.clock.Wall();
  parts_.alarms->Take(now, &effects_.rows);
  parts_.audit->Take(
      effects_.replies,
      {.configuration = parts_.coordinator->busy() ? parts_.coordinator->configuration().id : 0,
       .now = now,
       .full = !parts_.store->RoomForRows()},
      &effects_.rows);
  if (!effects_.rows.empty()) {
    // Entries of the audit alone belong to no batch of the coordinator: they go with its last one.
    last_batch_ = std::max(last_batch_, effects_.batch);
    parts_.store->Commit(last_batch_, std::move(effects_.rows));
  }
  parts_.passed(TurnPoint::kRowsGiven);
  for (const OutFrame& frame : effects_.frames) parts_.lines->Put(frame, now_);
  parts_.passed(TurnPoint::kFramesPut);
  if (effects_.sync_at && parts_.sync != nullptr) parts_.sync->Plan(*effects_.sync_at);
  if (parts_.sector != nullptr) parts_.sector->Take(&effects_);
  if (effects_.plan_job) SubmitPlan(std::move(*effects_.plan_job));
  if (effects_.exposure && parts_.camera != nullptr) {
    const auto drives = parts_.coordinator->drives();
    CameraWork work{std::move(*effects_.exposure), {drives.begin(), drives.end()}};
    if (!parts_.camera->Submit(&work))
      not_done_exposures_.push_back(
          {work.job.id, Fail(ErrorCode::kUnavailable, "the camera's thread has no room")});
  }
  parts_.passed(TurnPoint::kJobsGiven);
  for (const ReplyEffect& reply : effects_.replies) parts_.handler->Reply(View(), reply);
  parts_.passed(TurnPoint::kReplied);
  if (parts_.scheduler != nullptr) parts_.scheduler->Changed(effects_.changed);
}

// A configuration does not wait for a preview: the planner gives the preview up.
void Shell::SubmitPlan(PlanJob job) {
  const bool preview = job.purpose == PlanPurpose::kPreview;
  if (!preview && preview_given_up_ != nullptr) *preview_given_up_ = true;
  if (preview) preview_given_up_ = std::make_shared<std::atomic<bool>>(false);
  const auto drives = parts_.coordinator->drives();
  PlannerWork work{std::move(job),
                   {drives.begin(), drives.end()},
                   preview ? preview_given_up_ : nullptr,
                   parts_.coordinator->configuration().id};
  if (parts_.planner->Submit(&work)) return;
  PlanDone failed =
      PlanFailed(work.job, {ErrorCode::kUnavailable, "the planner's thread has no room"});
  if (preview) return parts_.handler->PreviewDone(View(), failed);
  not_done_plans_.push_back(std::move(failed));
}

void Shell::PublishStatus() {
  parts_.store->HandOver();
  parts_.handler->ShowProgress(View());
  StateRequests& states = parts_.handler->states();
  while (auto text = parts_.states->Take()) states.Written(std::move(*text));
  states.Serve(View(), [this](StateRows* rows) { return parts_.states->Submit(rows); });
  if (parts_.metrics != nullptr) parts_.metrics->SampleIfDue(View());
  if (parts_.scheduler == nullptr || !parts_.scheduler->due(now_)) return;
  StatusBatch status = parts_.scheduler->Take(View(), last_batch_, store_.failing);
  if (!parts_.store->Publish(&status)) parts_.scheduler->GiveBack(status, *parts_.layout);
}

void Shell::LogChanges() {
  for (const LinkEvent& link : links_)
    LogLink(link, parts_.lines->name(link.bus), parts_.lines->trouble(link.bus));
  for (const Row& row : effects_.rows) LogRow(row);
}

FleetView Shell::View() const {
  return {.layout = parts_.layout,
          .coordinator = parts_.coordinator,
          .now = now_,
          .at = parts_.clock.Wall(),
          .compensation = std::as_const(*parts_.models).compensation()};
}

}  // namespace focalfleet
