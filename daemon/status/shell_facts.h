// Facts about the daemon itself that the coordinator does not have: ports, store, DDS, load.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "daemon/clock/wall_time.h"
#include "daemon/ports/pollable_port.h"
#include "daemon/status/transmit_queue_counters.h"
#include "daemon/store/store.h"

namespace focalfleet {

struct ShellFacts {
  struct Bus {
    std::string port;     // interface or path
    std::string trouble;  // why the link is not up
    PortCounters counters;
    TransmitQueueCounters transmit_queue;
    std::size_t waiting = 0;  // frames that the port has not taken
  };
  struct Alarms {
    std::size_t open = 0;   // neither acknowledged nor muted
    std::size_t muted = 0;  // open, but muted
    std::string worst;      // severity of the worst that is open; empty: none is
  };
  std::string version;
  WallTime started;
  Alarms alarms;
  std::string page;  // address of the operators' page; empty: there is no HTTP door
  std::string store_path;
  bool store_failing = false;
  std::size_t batches_waiting = 0;
  StoreCounters store;
  bool dds_enabled = false;
  std::string dds_trouble;         // why DDS is absent (it is tried again); empty: present, or off
  std::uint64_t dds_troubles = 0;  // reported since the start
  std::uint64_t dds_samples = 0;
  std::uint64_t dds_bytes = 0;
  std::uint64_t steps = 0;
  double cpu_s = 0;        // user and system, of the whole process
  std::vector<Bus> buses;  // in the order of the layout's buses
};

}  // namespace focalfleet
