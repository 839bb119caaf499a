// The fleet as the control socket tells it. docs/cli.md has the members.
#pragma once

#include <string>
#include <vector>

#include "daemon/control/messages.h"
#include "daemon/loop/transmit_queue.h"
#include "daemon/ports/pollable_port.h"
#include "daemon/status/status_snapshot.h"
#include "daemon/store/store.h"

namespace focalfleet {

/// What the shell knows beside the coordinator.
struct ShellFacts {
  struct Bus {
    std::string port;     // interface or path
    std::string trouble;  // why the link is not up
    PortCounters counters;
    TransmitQueueCounters transmit_queue;
    std::size_t waiting = 0;  // frames that the port has not taken
  };
  std::string version;
  WallTime started;
  std::string store_path;
  bool store_failing = false;
  std::size_t batches_waiting = 0;
  StoreCounters store;
  bool dds_enabled = false;
  std::string dds_trouble;  // why it is not there (it is tried again); empty: it is, or is off
  std::uint64_t dds_samples = 0;
  std::uint64_t dds_bytes = 0;
  std::uint64_t steps = 0;
  double cpu_s = 0;        // user and system, of the whole process
  std::vector<Bus> buses;  // in the order of the layout's
};

/// The current or last configuration, with every unit that was not served.
Json ConfigurationJson(const FleetView& view);
/// What a waiting client is shown on the way. Cost: constant.
Json ProgressJson(const FleetView& view);
Json StatusJson(const FleetView& view, const ShellFacts& facts);
Json UnitJson(const FleetView& view, PositionerIndex i);
/// {"rows":[...]} of all units as text: as Json values it would take ten times as long.
std::string StateText(const FleetView& view);

Json HistoryJson(const std::vector<ConfigurationHistory>& configurations);
Json HistoryJson(const std::vector<MoveHistory>& moves);
Json HistoryJson(const std::vector<ParameterHistory>& parameters);
Json HistoryJson(const std::vector<TuningHistory>& tunings);
Json HistoryJson(const std::vector<AlarmHistory>& alarms);
Json HistoryJson(const std::vector<UnitHistory>& units);
Json HistoryJson(const std::vector<MeasurementHistory>& measurements);

}  // namespace focalfleet
