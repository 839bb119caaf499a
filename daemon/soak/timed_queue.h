// TimedQueue stands for a thread that does jobs one after the other: each is done when its instant
// has come.
#pragma once

#include <algorithm>
#include <deque>
#include <functional>
#include <optional>
#include <utility>

#include "daemon/loop/job_queue.h"
#include "daemon/soak/virtual_time.h"
#include "protocol/base/instants.h"

namespace focalfleet::soak {

template <class Job, class Answer>
class TimedQueue final : public JobQueue<Job, Answer> {
 public:
  struct Options {
    std::function<Answer(const Job&)> work;
    std::function<DurationNs()> takes;  // the time of the next job
    std::function<bool()> has_room = [] { return true; };
  };
  explicit TimedQueue(Options options) : options_(std::move(options)) {}

  bool Submit(Job* job) override {
    constexpr std::size_t kJobs = 8;
    if (jobs_.size() >= kJobs || !options_.has_room()) return false;
    free_at_ = std::max(free_at_, HostInstant{ReadVirtualNs()}) + options_.takes();
    jobs_.push_back({std::move(*job), free_at_});
    return true;
  }
  std::optional<Answer> Take() override {
    if (jobs_.empty() || jobs_.front().due.ns > ReadVirtualNs()) return std::nullopt;
    const Job job = std::move(jobs_.front().job);
    jobs_.pop_front();
    return options_.work(job);
  }
  [[nodiscard]] HostInstant due() const { return jobs_.empty() ? kNever : jobs_.front().due; }

 private:
  struct Waiting {
    Job job;
    HostInstant due;
  };
  Options options_;
  std::deque<Waiting> jobs_;
  HostInstant free_at_{0};
};

}  // namespace focalfleet::soak
