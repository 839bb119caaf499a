// The daemon's configuration: one TOML file, every key with a default, a type and a range. An
// unknown key is an error, because a misspelt limit would be no limit. Relative paths are relative
// to the file. deploy/focalfleet.toml shows every key with its default.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/access/role_groups.h"
#include "fleet/camera/camera_model.h"
#include "fleet/camera/spots.h"
#include "fleet/coordinator.h"
#include "fleet/drive.h"
#include "protocol/base/result.h"

namespace focalfleet {

enum class PortKind : std::uint8_t { kUnix, kSocketCan, kSimulated };
inline constexpr const char* kPortKindNames[] = {"unix", "socketcan", "simulated"};

struct DaemonConfig {
  struct Fleet {
    std::string units = "units.csv";
    std::string obstacles;    // empty: none
    double clearance_mm = 0;  // 0: by the layout's pitch
  } fleet;
  struct Store {
    std::string path = "focalfleet.db";
    std::uint32_t keep_days = 0;  // history older than that goes; 0: all of it stays
  } store;
  struct Control {
    std::string socket = "control.sock";
    RoleGroups::Names roles;  // empty: whoever the socket's file lets in may do everything
    std::string roles_at;     // file:line, for messages
  } control;
  struct Dds {
    bool enabled = true;
    std::uint32_t domain = 0;
    double rate_hz = 10;   // limit of how often the status of changed units is published
    std::string config;    // Cyclone's XML file; empty: loopback only
    std::string security;  // folder of credentials for DDS Security; empty: without
  } dds;
  struct Plane {
    std::vector<std::string> sectors;  // buses of each sector; empty: no coordinator of a plane
    std::string sectors_at;            // file:line, for messages
    [[nodiscard]] bool coordinates() const { return !sectors.empty(); }
  } plane;
  struct Sector {
    std::string buses;         // of the plane's units file; empty: this daemon is no sector
    std::uint32_t number = 0;  // place in the coordinator's list, from 0
    std::string buses_at;      // file:line, for messages
    [[nodiscard]] bool present() const { return !buses.empty(); }
  } sector;
  struct Log {
    std::string level = "info";
    std::string file;     // empty: standard error
    bool journal = true;  // events carry fields where standard error is the journal
    std::string file_at;  // file:line, for messages
  } log;
  struct Journal {
    std::uint32_t limit_MiB = 2048;  // of the folder <store.path>.journal; 0: there is no journal
  } journal;
  struct Metrics {
    std::string address = "127.0.0.1";  // numeric
    std::uint16_t port = 0;             // 0: no metrics are served
    std::vector<std::string> names;     // of this host, beside the loopback names and `address`
  } metrics;
  struct Http {
    std::string address = "127.0.0.1";  // numeric
    std::uint16_t port = 0;             // 0: there is no HTTP door
    std::vector<std::string> names;     // of this host, beside the loopback names and `address`
    std::string certificate;            // PEM; empty: plain HTTP, on the loopback interface only
    std::string key;                    // PEM
    std::string tokens = "tokens.csv";  // access/token.h
    std::string tokens_at;              // file:line, for messages
    std::uint32_t viewers_max = 16;     // pages that look on at once; 0: none may
    bool viewer_without_token = false;  // requests from this host without a token are a viewer's
    [[nodiscard]] bool tls() const { return !certificate.empty(); }
  } http;
  struct Bus {
    PortKind port = PortKind::kUnix;
    std::uint32_t bit_rate_bps = 1'000'000;
    bool can_fd = false;                          // staging frames go in groups (docs/adr/0008)
    std::uint32_t data_bit_rate_bps = 2'000'000;  // of staging frames; only where can_fd
    std::string unix_directory;                   // where bus<ID>.sock are
    std::vector<std::string> interfaces;          // by ascending bus id
    std::string interfaces_at;                    // file:line, for messages
    std::string opener;                           // socket of the program that opens CAN sockets in
                                                  // a network namespace; empty: in the daemon's own
  } bus;
  struct Sync {
    std::string chip;  // GPIO chip that pulses at the common start; empty: no SYNC line
    std::uint32_t line = 0;
    bool active_low = false;
    std::string chip_at;  // file:line, for messages
  } sync;
  struct Camera {
    // Requests and answers go through a folder (camera/camera_folder.h), or through topics of
    // [dds] (camera/camera_dds.h). With neither of them there is no camera.
    std::string directory;
    bool drop_place = false;  // the camera writes into its subfolder drop/ alone
    bool dds = false;
    [[nodiscard]] bool present() const { return dds || !directory.empty(); }
    std::string fiducials;  // fiducials.csv
    SensorLimits sensor{11'000, 11'000};
    CameraModel model{.pixels_per_mm = 5, .centre_x_px = 5500, .centre_y_px = 5500};
    double centroid_sigma_um = 2;
    DurationNs patience = Milliseconds(30'000);  // real time within which an exposure must come
  } camera;
  struct Hall {
    std::string model;  // field of the joints, from `focalfleet hall fit`; empty: sensors unused
    double noise_mT = 0.03;  // of a reading, including the residual of model and calibration
    double tilt_max_deg = 45;
  } hall;
  struct Clock {
    double speed = 1;  // host time by real time; other than 1 for simulated fleets only
  } clock;
  UnitDrive drive;           // for units whose own parameters are not known
  CoordinatorConfig timing;  // its bit rates are those of bus
  struct Simulated {
    std::uint64_t seed = 1;
    std::string spread = "nominal";
  } simulated;
};

/// Errors: kUnavailable: the file cannot be read; kInvalid: the first fault, as file:line: reason.
Result<DaemonConfig> LoadConfig(const std::string& path);
/// The same for a text that came from `path`.
Result<DaemonConfig> ParseConfig(std::string_view text, const std::string& path);

/// Every key with its effective value, as TOML that reads back the same.
std::string EffectiveConfig(const DaemonConfig& config);

}  // namespace focalfleet
