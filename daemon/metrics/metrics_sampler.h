// The sampler is the part of the metrics that runs on the core's thread. After each step it counts
// what the step brought about, and once a second it hands out a new FleetMetrics. Nothing here
// waits: the object goes through an atomic pointer.
//
// Cost: a step costs a comparison and a look at its rows, a sample one pass over the units
// (tests/bench/metrics_bench.cc).
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "daemon/clock/clock.h"
#include "daemon/metrics/fleet_metrics.h"
#include "daemon/metrics/newest_value.h"
#include "daemon/metrics/planned_power.h"
#include "daemon/status/shell_facts.h"
#include "daemon/status/status_snapshot.h"

namespace focalfleet {

class MetricsSampler {
 public:
  /// All parts outlive the sampler.
  struct Parts {
    const Layout* layout = nullptr;
    std::function<ShellFacts()> facts;
    NewestValue<const PlannedPower>* power = nullptr;  // from the planner's thread
    NewestValue<const FleetMetrics>* out = nullptr;
    HostClock clock;
  };
  explicit MetricsSampler(Parts parts);

  /// Counts what a step has brought about. Call after each step, before its rows are moved away.
  void Note(const FleetView& view, const Effects& effects);

  /// The earliest instant of the next sample.
  [[nodiscard]] HostInstant wake_at() const { return next_; }
  /// Hands out the present values if they are due.
  void SampleIfDue(const FleetView& view);

 private:
  void NoteConfiguration(const FleetView& view);
  void CountUnits(const FleetView& view, FleetMetrics* out) const;
  void DescribeConfiguration(const FleetView& view, ConfigurationMetrics* out) const;
  void DescribeShell(const FleetView& view, FleetMetrics* out) const;

  Parts parts_;
  HostInstant next_{0};
  std::vector<std::uint32_t> bus_of_;     // by unit: index into the layout's buses
  std::vector<RailId> rails_;             // ascending
  std::vector<std::uint32_t> rail_of_;    // by unit: index into rails_
  std::vector<HostInstant> measured_at_;  // by unit; kNever: not since the start
  std::unique_ptr<const PlannedPower> power_;

  // The configuration that was seen last.
  std::optional<std::uint64_t> configuration_;
  bool over_ = true;
  std::uint64_t retries_before_ = 0;
  WallTime began_;
  WallTime ended_;

  std::array<std::uint64_t, 3> configurations_ended_{};  // done, stopped, failed
  std::array<std::uint64_t, kAlarmNameCount> alarms_by_name_{};
  Histogram position_error_m_;
  Histogram configuration_retries_;
  Histogram start_skew_s_;
  Histogram knowledge_age_s_;
};

}  // namespace focalfleet
