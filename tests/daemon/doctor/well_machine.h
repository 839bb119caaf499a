// Facts of a machine on which nothing is wrong, for tests that make one thing wrong each.
#pragma once

#include <sys/stat.h>

#include <algorithm>
#include <string>
#include <vector>

#include "daemon/doctor/check.h"
#include "daemon/doctor/examine.h"
#include "daemon/doctor/facts.h"

namespace focalfleet::doctor::test {

inline constexpr const char* kConfig = R"([fleet]
units = "units.csv"
[store]
path = "/var/lib/focalfleet/focalfleet.db"
[control]
socket = "/run/focalfleet/control.sock"
[bus]
port = "socketcan"
interfaces = ["can0", "can1"]
[sync]
chip = "/dev/gpiochip0"
[camera]
directory = "/srv/camera"
fiducials = "fiducials.csv"
)";

inline FileFacts Folder(const std::string& path, std::uint32_t uid, std::uint32_t gid,
                        std::uint32_t mode) {
  return {.path = path,
          .trouble = "",
          .uid = uid,
          .gid = gid,
          .mode = S_IFDIR | mode,
          .owner = "user" + std::to_string(uid),
          .group = "group" + std::to_string(gid)};
}

inline CanLink WellLink() {
  CanLink link;
  link.can = link.up = link.echoes = true;
  link.kind = "can";
  link.bit_rate_bps = 1'000'000;
  link.mtu = 16;
  link.queue_frames = 10;
  link.state = ControllerState::kActive;
  link.restart_ms = 100;
  return link;
}

inline Json WellStatus() {
  return {{"version", "1.2.3"},
          {"enabled", 200},
          {"phases", {{"ready", 200}, {"absent", 0}, {"fault", 0}}},
          {"alarms", {{"open", 0}, {"worst", nullptr}}},
          {"dds", {{"enabled", true}, {"trouble", ""}}},
          {"buses",
           {{{"bus_id", 0}, {"link", "up"}, {"rejected", 0}, {"malformed", 0}},
            {{"bus_id", 1}, {"link", "up"}, {"rejected", 0}, {"malformed", 0}}}}};
}

inline Facts WellMachine() {
  const Identity daemon{.uid = 990, .groups = {990, 991}, .name = "focalfleet"};
  FileFacts chip{.path = "/dev/gpiochip0",
                 .trouble = "",
                 .uid = 0,
                 .gid = 991,
                 .mode = S_IFCHR | 0660,
                 .owner = "root",
                 .group = "gpio"};
  StoreHealth store;
  store.version = store.version_expected = 7;
  store.bytes = 134'000'000;
  store.motions = 2'000'000;
  store.configurations = 400;
  store.since = WallTime{1'700'000'000'000'000'000};
  return {.program_version = "1.2.3",
          .config_path = "/etc/focalfleet/focalfleet.toml",
          .config = ParseConfig(kConfig, "/etc/focalfleet/focalfleet.toml"),
          .buses = 2,
          .host = {.af_can_error = 0,
                   .clock_synchronised = true,
                   .clock_error_s = 0.004,
                   .open_files_max = 1024,
                   .receive_buffer_max = 8'388'608,
                   .udp_ports = {53, 7410, 7411},
                   .interfaces = {{"lo", {"127.0.0.1"}, true, false},
                                  {"eth0", {"10.0.0.5"}, true, true}}},
          .interfaces = {{"can0", WellLink()}, {"can1", WellLink()}},
          .bus_sockets_folder = {},
          .store_folder = Folder("/var/lib/focalfleet", 990, 990, 0750),
          .camera_folder = Folder("/srv/camera", 0, 991, 0775),
          .gpio_chip = chip,
          .disks = {{"/var/lib/focalfleet", "", 100'000'000'000, 1'000'000},
                    {"/srv/camera", "", 100'000'000'000, std::nullopt}},
          .store = Result<StoreHealth>(store),
          .dds = DdsNeeds{.interfaces = {{"lo", ""}},
                          .multicast = false,
                          .buffer_bytes = 4'194'304,
                          .participants = 120},
          .daemon = {.socket = "/run/focalfleet/control.sock",
                     .connect_error = 0,
                     .silence = "",
                     .status = WellStatus(),
                     .process = DaemonProcess{daemon, 524'288, false}},
          .operator_user = {.uid = 1000, .groups = {1000}, .name = "anna"},
          .daemon_user = daemon};
}

/// The check of this name; an empty one where there is none.
inline Check Find(const Facts& facts, const std::string& name) {
  const auto checks = Examine(facts);
  const auto found = std::ranges::find(checks, name, &Check::name);
  return found == checks.end() ? Check{} : *found;
}

}  // namespace focalfleet::doctor::test
