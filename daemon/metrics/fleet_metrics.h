// All that /metrics shows of the core, at one moment, as plain values. The core's thread makes such
// an object once a second and never touches it again. Other threads make text of it.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "daemon/clock/wall_time.h"
#include "daemon/dds/status_values.h"
#include "daemon/metrics/histogram.h"
#include "fleet/alarm_name.h"
#include "fleet/coordinator.h"

namespace focalfleet {

struct BusMetrics {
  BusId bus;
  std::uint32_t units = 0;
  std::uint32_t answering = 0;
  LinkState link = LinkState::kUp;
  double load = 0;  // 0..1
  std::uint64_t frames_sent = 0;
  std::uint64_t frames_received = 0;
  std::uint64_t retransmits = 0;
  std::uint64_t errors = 0;
  std::uint64_t waiting = 0;  // frames in the transmit queue
  double clock_bound_s = 0;   // widest of its units; 0: no clock is known
};

struct RailMetrics {
  RailId rail;
  std::uint32_t units = 0;
  std::uint32_t answering = 0;
  double power_predicted_W = 0;  // highest, by the newest plan
};

/// The frames and start signals that went wrong, of all buses.
struct TrafficMetrics {
  std::uint64_t malformed = 0;
  std::uint64_t rejected = 0;
  std::uint64_t lost = 0;
  std::uint64_t discarded = 0;  // by a full transmit queue, or with a link that went down
  std::uint64_t reconnects = 0;
  std::uint64_t late_starts = 0;
};

/// The configuration under way, or the last one.
struct ConfigurationMetrics {
  ConfigurationState state = ConfigurationState::kDone;
  bool busy = false;
  OutcomeCounts counts;
  double makespan_predicted_s = 0;
  double makespan_s = 0;
  double upload_s = 0;
  double start_skew_s = 0;
  double start_skew_allowed_s = 0;
  double energy_J = 0;
  double worst_error_um = 0;  // of the units with a target, as last measured; 0: none was
  WallTime began{0};          // 0: none since the daemon's start
  WallTime ended{0};          // 0: none since the daemon's start
};

struct FleetMetrics {
  WallTime at;
  std::string version;
  WallTime started;
  std::uint32_t units = 0;
  std::uint32_t enabled = 0;
  std::array<std::uint32_t, kUnitPhaseCount> by_phase{};
  std::array<std::uint32_t, kWitnessCount> by_witness{};
  std::vector<BusMetrics> buses;
  std::vector<RailMetrics> rails;
  double rail_limit_W = 0;       // of each rail; 0: none
  double power_predicted_W = 0;  // highest of all rails together, by the newest plan
  double limit_W = 0;            // of all rails together; 0: none
  TrafficMetrics traffic;
  ConfigurationMetrics configuration;
  std::array<std::uint64_t, 3> configurations_ended{};  // done, stopped, failed
  HistogramReading position_error_m;
  HistogramReading configuration_retries;
  HistogramReading start_skew_s;
  HistogramReading knowledge_age_s;
  std::array<std::uint64_t, kAlarmNameCount> alarms_by_name{};
  double clock_rate_error = 0;  // the farthest from 0 of all units
  bool store_failing = false;
  std::uint64_t store_waiting = 0;  // batches
  bool dds_enabled = false;
  bool dds_failing = false;
  std::uint64_t dds_troubles = 0;
  std::uint64_t dds_samples = 0;
  std::uint64_t dds_bytes = 0;
  std::uint64_t steps = 0;
};

}  // namespace focalfleet
