// JobQueue is what the core needs of a part that does jobs one after the other: it gives a job and
// takes answers. A JobThread does them on a thread of its own; a simulation answers at an instant
// that it draws.
#pragma once

#include <optional>

namespace focalfleet {

template <class Job, class Answer>
class JobQueue {
 public:
  JobQueue() = default;
  JobQueue(const JobQueue&) = delete;
  JobQueue& operator=(const JobQueue&) = delete;
  virtual ~JobQueue() = default;

  /// The job is taken over. False: too many jobs wait, and `job` is untouched.
  [[nodiscard]] virtual bool Submit(Job* job) = 0;
  /// The next answer; none: no job is done.
  virtual std::optional<Answer> Take() = 0;
};

}  // namespace focalfleet
