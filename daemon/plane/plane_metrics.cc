#include "daemon/plane/plane_metrics.h"

#include <cstddef>

#include "daemon/metrics/exposition.h"
#include "daemon/usage/build_version.h"

namespace focalfleet {
namespace {

double AsDouble(std::uint64_t count) { return static_cast<double>(count); }

void PutSectors(const PlaneInstant& plane, Exposition* out) {
  const SectorBook& book = plane.coordinator->sectors();
  const auto each = [&](const char* name, const char* help, const auto& value_of) {
    out->BeginGauge(name, help);
    for (std::uint32_t n = 0; n < book.size(); ++n) out->Sample("sector", n, value_of(n));
  };
  each("focalfleet_plane_sector_units", "Units of the sector.",
       [&](std::uint32_t n) { return AsDouble(book[n].units); });
  each("focalfleet_plane_sector_heard", "Whether the coordinator hears the sector's reports.",
       [&](std::uint32_t n) { return book.IsHeard(n) ? 1.0 : 0.0; });
  each("focalfleet_plane_sector_usable", "Whether the sector can take part in rounds.",
       [&](std::uint32_t n) { return book.IsUsable(n) ? 1.0 : 0.0; });
  each("focalfleet_plane_sector_clock_bound_seconds",
       "Bound within which the clock of the sector's host is known. 0: it is not known.",
       [&](std::uint32_t n) {
         const auto clock = book[n].clock.At(plane.now);
         return clock ? clock->bound.seconds() : 0.0;
       });
  each("focalfleet_plane_sector_status_age_seconds",
       "Time since the sector last published its status. -1: it never did.",
       [&](std::uint32_t n) { return plane.table->AgeOf(n, plane.steady).value_or(-1); });
  each("focalfleet_plane_sector_silent",
       "Whether the sector's status is older than 3 s: its units count as silent.",
       [&](std::uint32_t n) { return plane.table->IsSilent(n, plane.steady) ? 1.0 : 0.0; });
}

void PutUnits(const PlaneInstant& plane, Exposition* out) {
  const PlaneTable::Counts counts = plane.table->Count(plane.steady);
  out->BeginGauge("focalfleet_plane_units",
                  "Units of the plane by the state of their daemons' work with them. Those of a "
                  "silent sector are silent.");
  for (std::size_t p = 0; p < counts.by_phase.size(); ++p)
    out->Sample("state", Name(static_cast<UnitPhase>(p)), counts.by_phase[p]);
  out->BeginGauge("focalfleet_plane_unit_positions",
                  "Units of the plane by the source of what is known of their place, of the worse "
                  "axis. Nothing is known of those of a silent sector.");
  for (std::size_t w = 0; w < counts.by_witness.size(); ++w)
    out->Sample("witness", Name(static_cast<Witness>(w)), counts.by_witness[w]);
  out->Gauge("focalfleet_plane_units_enabled", "Units of the plane that may be moved.",
             counts.enabled);
  out->Gauge("focalfleet_plane_bus_load_ratio",
             "Share of the last second in which the busiest bus of the plane carried bits.",
             counts.bus_load_max);
  out->Gauge("focalfleet_plane_store_failing",
             "Whether the daemon of any sector that is not silent cannot write its store.",
             counts.store_failing ? 1 : 0);
}

void PutConfiguration(const PlaneInstant& plane, Exposition* out) {
  const PlaneView& view = plane.coordinator->view();
  out->BeginGauge("focalfleet_plane_phase", "Phase of the coordinator: 1 for the present one.");
  for (std::size_t p = 0; p < kPlanePhaseCount; ++p) {
    const auto phase = static_cast<PlanePhase>(p);
    out->Sample("phase", Name(phase), phase == view.phase ? 1 : 0);
  }
  out->Gauge("focalfleet_plane_epoch",
             "The epoch in which this coordinator gives orders. 0: it gives none yet.",
             AsDouble(view.epoch.number));
  out->Gauge("focalfleet_plane_in_progress", "Whether a configuration is under way.",
             plane.coordinator->busy() ? 1 : 0);
  out->BeginGauge("focalfleet_plane_configuration_units",
                  "Units of the configuration under way, or of the last one, by outcome. Targeted "
                  "are all of them.");
  out->Sample("outcome", "targeted", view.counts.targeted);
  out->Sample("outcome", "arrived", view.counts.arrived);
  out->Sample("outcome", "refused", view.counts.refused);
  out->Sample("outcome", "failed", view.counts.failed);
  out->Sample("outcome", "stopped", view.counts.stopped);
  out->Sample("outcome", "unmeasured", view.counts.unmeasured);
  out->Gauge("focalfleet_plane_configuration_rounds",
             "Rounds of the configuration under way, or of the last one.", view.rounds);
  out->Gauge("focalfleet_plane_makespan_predicted_seconds",
             "Predicted time from start to last arrival, of all rounds begun.",
             view.makespan_predicted_s);
  out->Gauge("focalfleet_plane_follows_beyond",
             "Pairs of units that follow each other over a border, by the last plan.",
             view.follows_beyond);
  out->Gauge("focalfleet_plane_unnoticed_pairs", "Those of them for which the notice is too short.",
             AsDouble(view.unnoticed.size()));
}

void PutMessages(const PlaneLinkCounters& link, Exposition* out) {
  out->BeginCounter("focalfleet_plane_messages_total", "Orders sent, and reports received.");
  out->Sample("direction", "sent", AsDouble(link.sent));
  out->Sample("direction", "received", AsDouble(link.received));
  out->BeginCounter("focalfleet_plane_message_bytes_total", "Bodies of these messages.");
  out->Sample("direction", "sent", AsDouble(link.sent_bytes));
  out->Sample("direction", "received", AsDouble(link.received_bytes));
  out->Counter("focalfleet_plane_messages_refused_total",
               "Messages of another format, or that were none.", AsDouble(link.refused));
}

}  // namespace

std::string PlaneMetricsText(const PlaneInstant& plane, const ProcessFacts& process) {
  Exposition out;
  out.BeginGauge("focalfleet_build_info", "The version of the daemon, as a label. Always 1.");
  out.Sample("version", BuildVersion(), 1);
  out.Gauge("focalfleet_sample_timestamp_seconds",
            "Unix time at which the core gave the values of this page.",
            1e-9 * static_cast<double>(plane.at.ns));
  PutConfiguration(plane, &out);
  PutUnits(plane, &out);
  PutSectors(plane, &out);
  PutMessages(plane.link, &out);
  const AlarmRegister::Counts alarms = plane.alarms->Count(plane.at);
  out.Gauge("focalfleet_plane_alarms_open",
            "Alarms of the coordinator that are neither acknowledged nor muted.",
            AsDouble(alarms.open));
  out.Counter("process_cpu_seconds_total", "CPU time of the daemon, user and system.",
              process.cpu_s);
  out.Gauge("process_resident_memory_bytes", "Resident memory.", AsDouble(process.resident_bytes));
  return out.text();
}

}  // namespace focalfleet
