// The keys of the configuration are one list: section, key, type, range and meaning. The reader,
// the writer of the effective configuration and the man page focalfleet.toml(5) visit it, so that a
// key stands nowhere else. Its default is that of the member in config.h.
#pragma once

#include <cstdint>
#include <limits>

#include "daemon/process/config.h"

namespace focalfleet {

inline constexpr const char* kLogLevels[] = {"trace", "debug", "info", "warning", "error"};
inline constexpr const char* kModes[] = {"asymmetric", "five_segment", "seven_segment"};
inline constexpr const char* kSpreads[] = {"nominal", "real"};

template <class T>
struct Range {
  T low;
  T high;
};
inline constexpr Range<std::int64_t> kMillisecondRange{1, 3'600'000};

/// The keys of what stands beside the buses: SYNC line, camera, sensors.
template <class Config, class Visitor>
void VisitInstrumentKeys(Config* c, Visitor* visit) {
  visit->Section("sync", "A line that pulses at the common start, for units with a SYNC input");
  visit->Path(
      "chip", &c->sync.chip,
      "GPIO chip that pulses at the common start, such as /dev/gpiochip0; empty: no such line");
  visit->Whole("line", &c->sync.line, {0, 1023}, "Line of the chip, counted from 0");
  visit->Flag("active_low", &c->sync.active_low, "Whether the pulse is low");
  visit->Section("camera", "The fibre-view camera, for corrections");
  visit->Path("directory", &c->camera.directory,
              "Folder for exposure requests and spot lists; empty: no camera there");
  visit->Flag("drop_place", &c->camera.drop_place,
              "Spot lists come into the subfolder drop/, the only one that the camera writes");
  visit->Flag("dds", &c->camera.dds,
              "Whether requests and spot lists go by DDS topics in the domain of [dds]");
  visit->Path("fiducials", &c->camera.fiducials,
              "fiducials.csv: lights at known places of the plate");
  visit->Real("columns_px", &c->camera.sensor.columns_px, {1, 1e6}, "Columns of the image");
  visit->Real("rows_px", &c->camera.sensor.rows_px, {1, 1e6}, "Rows of the image");
  visit->Real("pixels_per_mm", &c->camera.model.pixels_per_mm, {1e-3, 1e4},
              "Approximate scale of the image; the own scale of each exposure is found");
  visit->Real("rotation_deg", &c->camera.model.rotation_deg, {-360, 360},
              "Rotation of the image against the plate, counter-clockwise");
  visit->Real("centre_x_px", &c->camera.model.centre_x_px, {-1e6, 1e6},
              "Column of the plate's 0, 0 in the image");
  visit->Real("centre_y_px", &c->camera.model.centre_y_px, {-1e6, 1e6},
              "Row of the plate's 0, 0 in the image");
  visit->Flag("mirrored", &c->camera.model.mirrored, "Whether the image is mirrored");
  visit->Real("centroid_sigma_um", &c->camera.centroid_sigma_um, {0.01, 1000},
              "Error of one coordinate of one spot, at the plate");
  visit->Wait("patience_ms", &c->camera.patience,
              "Real time within which an exposure must have come");
  visit->Section("hall", "Units with Hall sensors at their joint");
  visit->Path(
      "model", &c->hall.model,
      "Model of the joints' field, as focalfleet hall fit writes it; empty: sensors are not read");
  visit->Real("noise_mT", &c->hall.noise_mT, {1e-5, 10},
              "Noise of a sensor's reading, including what model and calibration leave");
  visit->Real("tilt_max_deg", &c->hall.tilt_max_deg, {1, 60}, "Largest tilt of a joint");
}

/// The list of keys stands here, in VisitInstrumentKeys and in VisitTimingKeys. `visit` is a
/// reader, a writer or the maker of the man page; each visits every key once, in the order of the
/// file.
template <class Config, class Visitor>
void VisitKeys(Config* c, Visitor* visit) {
  visit->Section("fleet", "The focal plane");
  visit->Path("units", &c->fleet.units, "units.csv: position and address of each unit");
  visit->Path("obstacles", &c->fleet.obstacles,
              "obstacles.csv: what stands still on the plate; empty: nothing");
  visit->Real("clearance_mm", &c->fleet.clearance_mm, {0, 1000},
              "Distance that arms keep; 0: 0.012 of the layout's pitch");
  visit->Section("store", "The record of every axis, which survives power cuts and kills");
  visit->Path("path", &c->store.path, "The store, an SQLite file; one daemon at a time");
  visit->Whole("keep_days", &c->store.keep_days, {0, 36'500},
               "Days after which history goes: past moves, configurations, measurements, "
               "orientations, alarms, and changes of units, axes, parameters and tunings; "
               "0: all of it stays");
  visit->Section("control", "The socket of the command line");
  visit->Path("socket", &c->control.socket,
              "Control socket for the command line; owner and group may use it, or, where groups "
              "have roles, all who have one");
  visit->Texts("viewers", &c->control.roles.viewers,
               "Groups whose members may ask, and stop the fleet; where no group has a role, "
               "whoever may use the socket may do everything");
  visit->Texts("operators", &c->control.roles.operators,
               "Groups whose members may also move the fleet");
  visit->Texts("engineers", &c->control.roles.engineers, "Groups whose members may do everything");
  visit->Section("dds", "Status for many readers");
  visit->Flag("enabled", &c->dds.enabled, "Whether status is published through DDS");
  visit->Whole("domain", &c->dds.domain, {0, 230}, "DDS domain");
  visit->Real("rate_hz", &c->dds.rate_hz, {0.1, 100},
              "Highest rate of the status of changed units, in real time");
  visit->Path("config", &c->dds.config,
              "Cyclone DDS XML; empty: the loopback interface only; $CYCLONEDDS_URI is not read");
  visit->Path("security", &c->dds.security,
              "Folder of credentials for DDS Security, as make-keys writes it; empty: everybody in "
              "the domain may read and write");
  visit->Section("plane", "A focal plane of several daemons; this one is its coordinator");
  visit->Texts("sectors", &c->plane.sectors,
               "Buses of each sector, as 0-12; empty: this daemon coordinates no plane");
  visit->Section("sector", "This daemon owns one sector of a plane");
  visit->Text("buses", &c->sector.buses,
              "Buses of this sector, as 0-12; empty: this daemon owns all buses of its units file");
  visit->Whole("number", &c->sector.number, {0, 63},
               "Place of this sector in the coordinator's list, from 0");
  visit->Section("log", "The daemon's log");
  visit->Choice("level", &c->log.level, kLogLevels, "The least important lines that are logged");
  visit->Path("file", &c->log.file,
              "File of the log; empty: standard error; its folder must exist");
  visit->Flag("journal", &c->log.journal,
              "Whether events have fields in systemd's journal where standard error leads there");
  visit->Section("journal", "All that the core takes in, in files for focalfleetd --replay");
  visit->Whole("limit_MiB", &c->journal.limit_MiB, {0, 1'000'000},
               "Limit of the folder <store.path>.journal, whose oldest files go; 0: no journal");
  visit->Section("metrics", "Numbers for Prometheus, at http://ADDRESS:PORT/metrics");
  visit->Text("address", &c->metrics.address,
              "Numeric address to listen at; whoever reaches it may read the page");
  visit->Whole("port", &c->metrics.port, {0, 65'535}, "Port; 0: no metrics are served");
  visit->Texts("names", &c->metrics.names,
               "Names of this host by which it may be asked, beside localhost and the address");
  visit->Section("http", "Verbs and pages over HTTP, for those who have a token");
  visit->Text("address", &c->http.address,
              "Numeric address to listen at; other than loopback only with certificate and key");
  visit->Whole("port", &c->http.port, {0, 65'535}, "Port; 0: there is no HTTP door");
  visit->Texts("names", &c->http.names,
               "Names of this host by which it may be asked, beside localhost and the address");
  visit->Path("certificate", &c->http.certificate,
              "Certificate with its chain, PEM; empty: plain HTTP, on the loopback interface only");
  visit->Path("key", &c->http.key, "Key of the certificate, PEM");
  visit->Path("tokens", &c->http.tokens, "File of tokens, made by focalfleet token add");
  visit->Whole("viewers_max", &c->http.viewers_max, {0, 256},
               "Pages that look on at once; one more is refused with a text");
  visit->Flag("viewer_without_token", &c->http.viewer_without_token,
              "Whether requests from this host without a token are a viewer's: every user of the "
              "host may then look on, and stop the fleet");
  visit->Section("bus", "The CAN buses");
  visit->Index(
      "port", &c->bus.port, kPortKindNames,
      "unix: focalfleet-sim; socketcan: real interfaces; simulated: a fleet inside the daemon");
  visit->Whole("bit_rate_bps", &c->bus.bit_rate_bps, {10'000, 1'000'000},
               "Bit rate of the buses; schedule and load are computed from it");
  visit->Flag("can_fd", &c->bus.can_fd,
              "socketcan: moves are staged in CAN FD groups; every controller of every bus must "
              "speak CAN FD");
  visit->Whole(
      "data_bit_rate_bps", &c->bus.data_bit_rate_bps, {10'000, 8'000'000},
      "Data bit rate of these groups, not below bit_rate_bps, as set on the interfaces (dbitrate)");
  visit->Path("unix_directory", &c->bus.unix_directory, "unix: folder of the sockets bus<ID>.sock");
  visit->Texts("interfaces", &c->bus.interfaces,
               "socketcan: one interface a bus, in ascending order of bus_id; a missing one is a "
               "bus that is down");
  visit->Path("opener", &c->bus.opener,
              "socketcan: socket of focalfleet-can-opener, which opens the interfaces in a network "
              "namespace of their own; empty: they are in the daemon's");
  VisitInstrumentKeys(c, visit);
  visit->Section("clock", "Host time");
  visit->Real("speed", &c->clock.speed, {0.01, 1000},
              "Host time runs this many times faster than real time; not on SocketCAN");
  visit->Section("drive", "The drive of units whose own parameters are not known");
  visit->Real("v_bus_V", &c->drive.v_bus_V, {0.1, 60},
              "Bus voltage of units whose own parameters are not known");
  auto* axis = &c->drive.axis[0];  // both axes alike
  visit->Whole("counter1", &axis->counter1, {1, 65'535},
               "Timer counts (144 MHz) of a carrier period");
  visit->Whole("repeat", &axis->repeat, {1, 255}, "Carrier periods for which a vector is shown, n");
  visit->Whole("subdivision", &axis->subdivision, {6, 65'535}, "Vectors of an electrical turn");
  visit->Index("mode", &c->drive.mode, kModes, "Kind of space vector modulation");
}

template <class Config, class Visitor>
void VisitTimingKeys(Config* c, Visitor* visit) {
  visit->Section(
      "timing",
      "Waits and periods in host time; where clock.speed is above 1, the defaults of "
      "reply_wait_ms, start_delay_ms, settle_margin_ms and silence_limit_ms are multiplied by it");
  visit->Wait("reply_wait_ms", &c->timing.reply_wait,
              "Wait for the answer to one request, then a retry");
  visit->Wait("identify_period_ms", &c->timing.identify_period,
              "Period of requests to absent and silent units");
  visit->Wait("poll_period_ms", &c->timing.poll_period,
              "Period of questions to a moving unit; a resting one is asked ten times less");
  visit->Wait(
      "notice_ms", &c->timing.notice,
      "Time from a unit's unplanned end to the stop of units that would come where it stands");
  visit->Wait("clock_period_ms", &c->timing.clock_period,
              "Period of the host's time and sign of life on every bus");
  visit->Wait("start_delay_ms", &c->timing.start_delay, "Time from start signal to start");
  visit->Wait("sync_lead_ms", &c->timing.sync_lead,
              "With [sync]: start frames give this much more than the edge, for units that miss "
              "it; below 20");
  visit->Wait("settle_margin_ms", &c->timing.settle_margin,
              "Wait after its predicted end, before a unit is asked");
  visit->Wait("silence_limit_ms", &c->timing.silence_limit,
              "Time without an answer, after which a unit counts as silent");
  visit->Section("simulated",
                 "The fleet inside the daemon, with bus.port = simulated only; its state is lost "
                 "when the daemon ends");
  visit->Whole("seed", &c->simulated.seed, {0, std::numeric_limits<std::int64_t>::max()},
               "Seed of the simulated fleet");
  visit->Choice("spread", &c->simulated.spread, kSpreads,
                "nominal: units as described; real: the spread of service");
}

}  // namespace focalfleet
