// The slow parts of an in-process fleet each answer after a delay of virtual time: the store with
// its commits, the planner with its plans, and a camera that sees every fibre and knows whose it
// is. Tests plant their faults here.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <span>
#include <vector>

#include "fleet/coordinator.h"
#include "fleet/layout.h"
#include "protocol/base/rng.h"
#include "sim/world/world.h"
#include "tests/support/memory_store.h"

namespace focalfleet::test {

/// The store commits batches in order, each after the delay, and outlives the coordinator.
class DelayedStore {
 public:
  explicit DelayedStore(DurationNs delay) : delay_(delay) {}

  void Put(HostInstant now, const Effects& effects);
  /// Commits the batches that are due, unless the store fails.
  void CommitDue(HostInstant now);
  /// Commits all batches, and then the last rows of a coordinator that ends.
  void CommitAll(const Effects& last);
  /// Discards the batches that are not durable, as a kill does.
  void Restart();

  /// The instant of the next commit; kNever while the store fails or nothing waits.
  [[nodiscard]] HostInstant due() const;
  [[nodiscard]] std::uint64_t committed_through() const { return committed_through_; }
  /// The rows refused since the last call.
  [[nodiscard]] std::vector<RefusedRow> TakeRefused();
  [[nodiscard]] MemoryStore& memory() { return memory_; }
  [[nodiscard]] const MemoryStore& memory() const { return memory_; }

  bool fails = false;
  /// Rows that the store refuses beside those that it always does.
  std::function<bool(const Row&)> refuse;

 private:
  struct Batch {
    HostInstant at;
    std::uint64_t number;
    std::vector<Row> rows;
  };
  DurationNs delay_;
  MemoryStore memory_;
  std::deque<Batch> waiting_;
  std::uint64_t committed_through_ = 0;
  std::vector<RefusedRow> refused_;
};

class DelayedPlanner {
 public:
  explicit DelayedPlanner(DurationNs delay) : delay_(delay) {}

  void Put(HostInstant now, const PlanJob& job) { waiting_.push_back({now + delay_, job}); }
  /// The answers that are due.
  [[nodiscard]] std::vector<PlanDone> TakeDue(HostInstant now, const Layout& layout,
                                              std::span<const UnitDrive> drives);
  void Restart() { waiting_.clear(); }
  [[nodiscard]] HostInstant due() const { return waiting_.empty() ? kNever : waiting_.front().at; }
  /// Every job fails.
  bool fails = false;
  /// The plan that the coordinator was given last.
  [[nodiscard]] const Plan& last_plan() const { return last_plan_; }

 private:
  struct Waiting {
    HostInstant at;
    PlanJob job;
  };
  DurationNs delay_;
  std::deque<Waiting> waiting_;
  Plan last_plan_;
};

class DelayedCamera {
 public:
  struct Options {
    DurationNs delay;
    double centroid_sigma_um = 0;
  };
  explicit DelayedCamera(const Options& options) : options_(options) {}

  void Put(HostInstant now, const ExposureJob& job) {
    waiting_.push_back({now + options_.delay, job});
  }
  /// The answers that are due.
  [[nodiscard]] std::vector<ExposureDone> TakeDue(HostInstant now, const Layout& layout,
                                                  std::span<const UnitDrive> drives,
                                                  const sim::World& world);
  void Restart() { waiting_.clear(); }
  [[nodiscard]] HostInstant due() const { return waiting_.empty() ? kNever : waiting_.front().at; }

  /// Changes the findings of an exposure before the coordinator receives them.
  std::function<void(ExposureDone*)> fault;
  /// Answers exposure jobs in place of the camera.
  std::function<ExposureDone(const ExposureJob&)> measurer;

 private:
  [[nodiscard]] ExposureDone Expose(const ExposureJob& job, const Layout& layout,
                                    std::span<const UnitDrive> drives, const sim::World& world);

  struct Waiting {
    HostInstant at;
    ExposureJob job;
  };
  Options options_;
  std::deque<Waiting> waiting_;
  Rng noise_{1};
};

}  // namespace focalfleet::test
