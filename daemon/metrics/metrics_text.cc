#include "daemon/metrics/metrics_text.h"

#include <fmt/compile.h>
#include <fmt/format.h>

#include <cstddef>

#include "daemon/metrics/exposition.h"
#include "daemon/metrics/metric_groups.h"

namespace focalfleet {
namespace {

double AsDouble(std::uint64_t count) { return static_cast<double>(count); }
double UnixSeconds(WallTime at) { return 1e-9 * static_cast<double>(at.ns); }

template <class Counts, class NameOf>
void PutEach(const char* label, const Counts& counts, const NameOf& name_of, Exposition* out) {
  for (std::size_t i = 0; i < counts.size(); ++i)
    out->Sample(label, name_of(i), AsDouble(counts[i]));
}

/// A state as one series for each that it may have: 1 for the present one.
template <class State>
void PutState(const std::string& labels, State last, State now, Exposition* out) {
  for (std::uint8_t s = 0; s <= static_cast<std::uint8_t>(last); ++s) {
    const auto state = static_cast<State>(s);
    out->SampleOf(fmt::format(FMT_COMPILE("{}state=\"{}\""), labels, Name(state)),
                  state == now ? 1 : 0);
  }
}

void PutUnits(const FleetMetrics& fleet, Exposition* out) {
  out->BeginGauge("focalfleet_units", "Units by the state of the daemon's work with them.");
  PutEach(
      "state", fleet.by_phase, [](std::size_t i) { return Name(static_cast<UnitPhase>(i)); }, out);
  out->Gauge("focalfleet_units_enabled", "Units that may be moved.", fleet.enabled);
  out->BeginGauge("focalfleet_unit_positions",
                  "Units by the source of what is known of their place, of the worse axis.");
  PutEach(
      "witness", fleet.by_witness, [](std::size_t i) { return Name(static_cast<Witness>(i)); },
      out);
  out->Gauge("focalfleet_worst_unit_error_meters",
             "Largest distance from its target of any unit of the configuration, as last measured.",
             fleet.configuration.worst_error_um / 1e6);
  out->Write("focalfleet_unit_position_error_meters",
             "Distances of units from their targets, each as a measurement found it.",
             fleet.position_error_m);
  out->Write("focalfleet_knowledge_age_seconds",
             "Time since the last measurement of each unit with a target when a configuration "
             "begins, of units measured since the start.",
             fleet.knowledge_age_s);
  out->Gauge("focalfleet_clock_rate_error_ratio",
             "Rate of the unit's clock that runs farthest from the host's, less 1.",
             fleet.clock_rate_error);
}

void PutConfiguration(const FleetMetrics& fleet, const WorkCounters& work, Exposition* out) {
  const ConfigurationMetrics& now = fleet.configuration;
  out->BeginGauge("focalfleet_configuration_units",
                  "Units of the configuration under way, or of the last one, by outcome. Targeted "
                  "are all of them.");
  out->Sample("outcome", "targeted", now.counts.targeted);
  out->Sample("outcome", "arrived", now.counts.arrived);
  out->Sample("outcome", "refused", now.counts.refused);
  out->Sample("outcome", "failed", now.counts.failed);
  out->Sample("outcome", "stopped", now.counts.stopped);
  out->Sample("outcome", "unmeasured", now.counts.unmeasured);
  out->BeginGauge("focalfleet_configuration_state",
                  "State of the configuration: 1 for the present one.");
  PutState("", ConfigurationState::kFailed, now.state, out);
  out->Gauge("focalfleet_configuration_in_progress",
             "Whether a configuration, a homing or a measurement is under way.", now.busy ? 1 : 0);
  out->Gauge("focalfleet_configuration_makespan_predicted_seconds",
             "Predicted time from start signals to last arrivals, of all rounds begun.",
             now.makespan_predicted_s);
  out->Gauge("focalfleet_configuration_makespan_seconds",
             "Time from start signals to last arrivals, of all rounds, so far.", now.makespan_s);
  out->Gauge("focalfleet_configuration_upload_seconds",
             "Time of the longest upload of moves, first frame to last unit armed.", now.upload_s);
  out->Gauge("focalfleet_configuration_start_skew_seconds",
             "Time from the first start of a unit to the last, widest of all rounds.",
             now.start_skew_s);
  out->Gauge("focalfleet_configuration_start_skew_allowed_seconds",
             "Start skew that the plan was made for.", now.start_skew_allowed_s);
  out->Gauge("focalfleet_configuration_energy_predicted_joules",
             "Predicted energy of all rounds begun.", now.energy_J);
  out->Gauge("focalfleet_configuration_began_timestamp_seconds",
             "Unix time at which the configuration began. 0: none did since the start.",
             UnixSeconds(now.began));
  out->Gauge("focalfleet_configuration_ended_timestamp_seconds",
             "Unix time at which the configuration ended. 0: it has not.", UnixSeconds(now.ended));
  out->BeginCounter("focalfleet_configurations_ended_total", "Configurations by how they ended.");
  PutEach(
      "state", fleet.configurations_ended,
      [](std::size_t i) {
        return Name(static_cast<ConfigurationState>(
            i + static_cast<std::size_t>(ConfigurationState::kDone)));
      },
      out);
  out->Write("focalfleet_configuration_retries",
             "Frames that had to be repeated, by configuration.", fleet.configuration_retries);
  out->Write("focalfleet_start_skew_seconds",
             "Time from the first start of a unit to the last, by configuration.",
             fleet.start_skew_s);
  out->Write("focalfleet_planner_seconds", "Time that the planner took, by job.",
             work.planner_s.Read());
}

void PutPower(const FleetMetrics& fleet, Exposition* out) {
  out->Gauge("focalfleet_power_predicted_watts",
             "Highest power of all rails together, by the newest plan.", fleet.power_predicted_W);
  out->Gauge("focalfleet_power_limit_watts",
             "Limit of all rails together that the newest plan was made for. 0: none.",
             fleet.limit_W);
  out->Gauge("focalfleet_rail_power_limit_watts",
             "Limit of each rail that the newest plan was made for. 0: none.", fleet.rail_limit_W);
  const std::vector<RailGroup> groups = GroupRails(fleet.rails);
  const auto each = [&](const char* name, const char* help, const auto& value_of) {
    out->BeginGauge(name, help);
    for (const RailGroup& group : groups)
      out->Sample("rail", std::string_view(group.label), value_of(group.all));
  };
  each("focalfleet_rail_power_predicted_watts", "Highest power of the rail, by the newest plan.",
       [](const RailMetrics& rail) { return rail.power_predicted_W; });
  each("focalfleet_rail_units", "Units on the rail.",
       [](const RailMetrics& rail) { return AsDouble(rail.units); });
  each("focalfleet_rail_units_answering", "Units on the rail that answer.",
       [](const RailMetrics& rail) { return AsDouble(rail.answering); });
}

void PutBuses(const FleetMetrics& fleet, Exposition* out) {
  const std::vector<BusGroup> groups = GroupBuses(fleet.buses);
  const auto each = [&](const auto& value_of) {
    for (const BusGroup& group : groups) out->Sample("bus", group.label, value_of(group.all));
  };
  const auto gauge = [&](const char* name, const char* help, const auto& value_of) {
    out->BeginGauge(name, help);
    each(value_of);
  };
  const auto counter = [&](const char* name, const char* help, const auto& value_of) {
    out->BeginCounter(name, help);
    each([&](const BusMetrics& bus) { return AsDouble(value_of(bus)); });
  };
  gauge("focalfleet_bus_units", "Units on the bus.",
        [](const BusMetrics& bus) { return AsDouble(bus.units); });
  gauge("focalfleet_bus_units_answering", "Units on the bus that answer.",
        [](const BusMetrics& bus) { return AsDouble(bus.answering); });
  out->BeginGauge("focalfleet_bus_state", "State of the bus: 1 for the present one.");
  for (const BusGroup& group : groups)
    PutState(fmt::format(FMT_COMPILE("bus=\"{}\","), group.label), LinkState::kDown, group.all.link,
             out);
  gauge("focalfleet_bus_load_ratio", "Share of the last second in which the bus carried bits.",
        [](const BusMetrics& bus) { return bus.load; });
  out->BeginCounter("focalfleet_bus_frames_total", "Frames on the bus, by direction.");
  for (const BusGroup& group : groups) {
    const auto labels = [&](const char* direction) {
      return fmt::format(FMT_COMPILE("bus=\"{}\",direction=\"{}\""), group.label, direction);
    };
    out->SampleOf(labels("sent"), AsDouble(group.all.frames_sent));
    out->SampleOf(labels("received"), AsDouble(group.all.frames_received));
  }
  counter("focalfleet_bus_retransmits_total", "Questions that were repeated without an answer.",
          [](const BusMetrics& bus) { return bus.retransmits; });
  counter("focalfleet_bus_errors_total", "Error frames, and reads and writes that failed.",
          [](const BusMetrics& bus) { return bus.errors; });
  gauge("focalfleet_bus_queue_frames", "Frames that wait for the bus.",
        [](const BusMetrics& bus) { return AsDouble(bus.waiting); });
  gauge("focalfleet_bus_clock_bound_seconds",
        "Widest bound within which the clock of a unit of the bus is known. 0: none is known.",
        [](const BusMetrics& bus) { return bus.clock_bound_s; });
}

void PutTraffic(const TrafficMetrics& traffic, Exposition* out) {
  out->Counter("focalfleet_frames_malformed_total", "Frames that are not of the protocol.",
               AsDouble(traffic.malformed));
  out->Counter("focalfleet_frames_rejected_total", "Frames of another kind than units send.",
               AsDouble(traffic.rejected));
  out->Counter("focalfleet_frames_lost_total", "Frames lost by a full receive queue of the kernel.",
               AsDouble(traffic.lost));
  out->Counter("focalfleet_frames_discarded_total",
               "Frames that found no room to wait, or waited for a bus that went down.",
               AsDouble(traffic.discarded));
  out->Counter("focalfleet_bus_reconnects_total", "Times that a bus came up again.",
               AsDouble(traffic.reconnects));
  out->Counter("focalfleet_late_starts_total", "Start signals that missed their instant.",
               AsDouble(traffic.late_starts));
}

void PutStore(const FleetMetrics& fleet, const WorkCounters& work, std::uint64_t bytes,
              Exposition* out) {
  out->Gauge("focalfleet_store_failing", "Whether the last attempt to store rows failed.",
             fleet.store_failing ? 1 : 0);
  out->Gauge("focalfleet_store_queue_batches", "Batches of rows that wait for the store.",
             AsDouble(fleet.store_waiting));
  out->Gauge("focalfleet_store_size_bytes", "Size of the store's file and its log.",
             AsDouble(bytes));
  out->Counter("focalfleet_store_rows_total", "Rows that were stored.", AsDouble(work.rows));
  out->Counter("focalfleet_store_transactions_total", "Transactions that were stored.",
               AsDouble(work.transactions));
  out->Counter("focalfleet_store_transactions_failed_total", "Transactions that were rolled back.",
               AsDouble(work.transactions_failed));
  out->Counter("focalfleet_store_rows_refused_total", "Rows that the store can never keep.",
               AsDouble(work.rows_refused));
  out->Write("focalfleet_store_commit_seconds", "Time of a transaction, failed or not.",
             work.commit_s.Read());
}

void PutOutside(const FleetMetrics& fleet, const WorkCounters& work, Exposition* out) {
  out->Gauge("focalfleet_dds_enabled", "Whether status is published by DDS.",
             fleet.dds_enabled ? 1 : 0);
  out->Gauge("focalfleet_dds_failing", "Whether a part that needs DDS is without it.",
             fleet.dds_failing ? 1 : 0);
  out->Counter("focalfleet_dds_troubles_total", "Troubles of DDS that were reported.",
               AsDouble(fleet.dds_troubles));
  out->Counter("focalfleet_dds_samples_total", "Samples that were published.",
               AsDouble(fleet.dds_samples));
  out->Counter("focalfleet_dds_published_bytes_total", "Bytes of the samples that were published.",
               AsDouble(fleet.dds_bytes));
  out->Counter("focalfleet_camera_exposures_total", "Exposures that were asked for.",
               AsDouble(work.exposures));
  out->Counter("focalfleet_camera_exposures_failed_total",
               "Exposures that were asked for and of which none could be used.",
               AsDouble(work.exposures_failed));
  out->Gauge("focalfleet_camera_last_exposure_timestamp_seconds",
             "Unix time at which the last usable exposure was assigned to units. 0: none was.",
             work.exposed_at_s);
  out->BeginCounter("focalfleet_alarms_total", "Alarms that were raised.");
  for (const AlarmKind& kind : AlarmKinds())
    out->SampleOf(
        fmt::format(FMT_COMPILE("name=\"{}\",severity=\"{}\""), kind.text, Name(kind.severity)),
        AsDouble(fleet.alarms_by_name[static_cast<std::size_t>(kind.name)]));
}

void PutProcess(const FleetMetrics& fleet, const ProcessFacts& process, Exposition* out) {
  out->Counter("process_cpu_seconds_total", "CPU time of the daemon, user and system.",
               process.cpu_s);
  out->Gauge("process_resident_memory_bytes", "Resident memory.", AsDouble(process.resident_bytes));
  out->Gauge("process_virtual_memory_bytes", "Virtual memory.", AsDouble(process.virtual_bytes));
  out->Gauge("process_open_fds", "Open file descriptors.", AsDouble(process.open_descriptors));
  out->Gauge("process_max_fds", "Limit of open file descriptors.",
             AsDouble(process.descriptors_max));
  out->Gauge("process_threads", "Threads.", AsDouble(process.threads));
  out->Gauge("process_start_time_seconds", "Unix time at which the daemon started.",
             UnixSeconds(fleet.started));
}

}  // namespace

std::string MetricsText(const FleetMetrics& fleet, const WorkCounters& work,
                        const ProcessFacts& process, std::uint64_t store_bytes) {
  Exposition out;
  out.BeginGauge("focalfleet_build_info", "The version of the daemon, as a label. Always 1.");
  out.Sample("version", fleet.version, 1);
  out.Gauge("focalfleet_sample_timestamp_seconds",
            "Unix time at which the core gave the values of this page.", UnixSeconds(fleet.at));
  out.Counter("focalfleet_core_steps_total", "Steps of the coordinator.", AsDouble(fleet.steps));
  PutUnits(fleet, &out);
  PutConfiguration(fleet, work, &out);
  PutPower(fleet, &out);
  PutBuses(fleet, &out);
  PutTraffic(fleet.traffic, &out);
  PutStore(fleet, work, store_bytes, &out);
  PutOutside(fleet, work, &out);
  PutProcess(fleet, process, &out);
  return out.text();
}

}  // namespace focalfleet
