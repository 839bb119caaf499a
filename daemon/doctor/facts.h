// The facts that the checks judge, as plain values. read_facts.h reads them from this machine and
// from the daemon; tests make up those of other machines.
#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "daemon/control/messages.h"
#include "daemon/doctor/dds_file.h"
#include "daemon/doctor/identity.h"
#include "daemon/ports/can_netlink.h"
#include "daemon/process/config.h"
#include "daemon/store/store_health.h"

namespace focalfleet::doctor {

/// An interface of bus.interfaces.
struct BusInterface {
  std::string name;
  Result<CanLink> link;
};

/// A file system, by a folder on it.
struct DiskFacts {
  std::string folder;
  std::string trouble;  // why it cannot be looked at; empty: the other members hold
  std::uint64_t free_bytes = 0;
  std::optional<std::uint64_t> free_inodes;  // none: the file system has no fixed number
};

struct NetworkInterface {
  std::string name;
  std::set<std::string> addresses;
  bool up = false;
  bool multicast = false;
};

/// The process that listens at the control socket.
struct DaemonProcess {
  Identity user;
  std::optional<std::uint64_t> open_files_max;
  std::optional<bool> may_configure_network;  // CAP_NET_ADMIN
};

struct DaemonFacts {
  std::string socket;
  int connect_error = 0;  // errno; 0: somebody listens
  std::string silence;    // why there is no answer; empty: `status` is one
  Json status;
  std::optional<DaemonProcess> process;
};

struct HostFacts {
  int af_can_error = 0;  // errno of a socket of that family; 0: the kernel has it
  bool clock_synchronised = false;
  double clock_error_s = 0;                         // the most that the kernel believes
  std::uint64_t open_files_max = 0;                 // of this shell
  std::optional<std::uint64_t> receive_buffer_max;  // net.core.rmem_max, in bytes
  std::set<std::uint16_t> udp_ports;                // in use
  std::vector<NetworkInterface> interfaces;
};

struct Facts {
  std::string program_version;
  std::string config_path;
  Result<DaemonConfig> config;
  Result<std::size_t> buses;  // of fleet.units
  HostFacts host;
  std::vector<BusInterface> interfaces;       // of port = "socketcan"
  std::vector<FileFacts> bus_sockets_folder;  // of port = "unix"; one or none
  FileFacts store_folder;
  std::optional<FileFacts> camera_folder;
  std::optional<FileFacts> gpio_chip;
  std::vector<DiskFacts> disks;
  std::optional<Result<StoreHealth>> store;  // none: there is no store yet
  Result<DdsNeeds> dds;
  DaemonFacts daemon;
  Identity operator_user;  // this process
  Identity daemon_user;    // as IdentityOfDaemon
};

}  // namespace focalfleet::doctor
