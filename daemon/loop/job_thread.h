// A thread for jobs that take longer than a bus may wait (a plan, an exposure), done one after the
// other. A job carries all that it needs as values; the answer comes back through a queue.
#pragma once

#include <atomic>
#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <thread>
#include <utility>

#include "daemon/loop/event_signal.h"
#include "daemon/loop/job_queue.h"
#include "daemon/loop/spsc_queue.h"
#include "daemon/loop/thread_name.h"

namespace focalfleet {

template <class Job, class Answer>
class JobThread final : public JobQueue<Job, Answer> {
 public:
  /// `ending` turns true when the answer of the running job is no longer wanted.
  using Work = std::function<Answer(const Job&, const std::atomic<bool>& ending)>;
  struct Options {
    const char* name = "jobs";  // of the thread; lives as long as the thread
    /// Called on the thread between jobs, and after each Wake. A job calls it by itself.
    std::function<void()> alive = [] {};
  };

  /// The thread runs. `done` is raised with each answer; it outlives the thread.
  /// Errors: kUnavailable: no descriptors left.
  static Result<std::unique_ptr<JobThread>> Create(Work work, const EventSignal* done,
                                                   Options options) {
    FOCALFLEET_TRY_ASSIGN(EventSignal wake, EventSignal::Create());
    return std::unique_ptr<JobThread>(
        new JobThread(std::move(work), done, std::move(wake), std::move(options)));
  }
  static Result<std::unique_ptr<JobThread>> Create(Work work, const EventSignal* done) {
    return Create(std::move(work), done, Options{});
  }
  /// Waits for the running job.
  ~JobThread() override {
    ending_ = true;
    wake_.Raise();
    thread_.join();
  }

  /// The job is taken over. False: too many jobs wait (the coordinator has one at a time), and
  /// `job` is untouched.
  [[nodiscard]] bool Submit(Job* job) override {
    if (answers_.size() + jobs_.size() >= kJobs || !jobs_.Push(job)) return false;
    wake_.Raise();
    return true;
  }
  std::optional<Answer> Take() override { return answers_.Pop(); }
  /// A thread that sleeps takes a turn.
  void Wake() const { wake_.Raise(); }

 private:
  static constexpr std::size_t kJobs = 8;

  JobThread(Work work, const EventSignal* done, EventSignal wake, Options options)
      : work_(std::move(work)),
        options_(std::move(options)),
        done_(done),
        wake_(std::move(wake)),
        jobs_(kJobs),
        // A job is accepted only where its answer has room, so Push below never fails.
        answers_(2 * kJobs),
        thread_([this] { Run(); }) {}

  void Run() {
    NameThisThread(options_.name);
    while (!ending_) {
      options_.alive();
      auto job = jobs_.Pop();
      if (!job) {
        wake_.Wait(std::nullopt);
        continue;
      }
      Answer answer = work_(*job, ending_);
      [[maybe_unused]] const bool had_room = answers_.Push(&answer);
      done_->Raise();
    }
  }

  Work work_;
  Options options_;
  const EventSignal* done_;
  EventSignal wake_;
  SpscQueue<Job> jobs_;
  SpscQueue<Answer> answers_;
  std::atomic<bool> ending_{false};
  std::thread thread_;
};

}  // namespace focalfleet
