#include "daemon/status/status_json.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>

#include "daemon/status/next_step.h"
#include "fleet/kinematics.h"

namespace focalfleet {
namespace {

void PutUpload(const UploadView& upload, Json* out) {
  (*out)["upload_bits_predicted"] = upload.bits_predicted;
  (*out)["upload_bits"] = upload.bits;
  (*out)["upload_predicted_s"] = Number(upload.predicted_s);
  (*out)["upload_s"] = Number(upload.measured_s);
}

Json PlaceJson(const FleetView& view, const std::optional<PositionerIndex>& i) {
  if (!i) return nullptr;
  const Unit& unit = view.layout->unit(*i);
  return {{"unit_id", unit.id.value}, {"bus_id", unit.bus.value}};
}

void PutStarts(const FleetView& view, Json* out) {
  const StartView& starts = view.coordinator->configuration().starts;
  const bool known = starts.reported > 0;
  const auto seconds = [&](double s) { return known ? Number(s) : Json(nullptr); };
  (*out)["starts"] = starts.begun;
  (*out)["starts_known"] = starts.reported;
  (*out)["start_skew_s"] = seconds(starts.skew_s);
  (*out)["start_skew_bound_s"] = seconds(starts.bound_s);
  (*out)["start_skew_least_s"] = seconds(starts.least_s);
  (*out)["start_skew_most_s"] = seconds(starts.most_s);
  (*out)["start_skew_allowed_s"] = seconds(starts.allowed_s);
  (*out)["start_first"] = PlaceJson(view, starts.first);
  (*out)["start_last"] = PlaceJson(view, starts.last);
}

Json ClockJson(const ClockView& clock) {
  const bool known = clock.readings > 0;
  return {{"readings", clock.readings},
          {"rate_error", known ? Json(clock.rate_error) : Json(nullptr)},
          {"rate_bound", known ? Json(clock.rate_bound) : Json(nullptr)},
          {"bound_s", known ? Json(clock.bound_s) : Json(nullptr)}};
}

/// The widest bound of a bus' units, and the rate that deviates most.
struct BusClocks {
  std::uint32_t known = 0;
  double bound_s = 0;
  double rate_error = 0;
};
std::map<BusId, BusClocks> ClocksByBus(const FleetView& view) {
  std::map<BusId, BusClocks> clocks;
  for (std::uint32_t n = 0; n < view.layout->size(); ++n) {
    const ClockView& clock = view.coordinator->unit({n}).clock;
    if (clock.readings == 0) continue;
    BusClocks& bus = clocks[view.layout->unit({n}).bus];
    ++bus.known;
    bus.bound_s = std::max(bus.bound_s, clock.bound_s);
    if (std::abs(clock.rate_error) > std::abs(bus.rate_error)) bus.rate_error = clock.rate_error;
  }
  return clocks;
}

Json UnservedJson(const FleetView& view) {
  Json unserved = Json::array();
  for (std::uint32_t n = 0; n < view.layout->size(); ++n) {
    const UnitView& unit = view.coordinator->unit({n});
    if (!IsUnserved(unit.outcome)) continue;
    unserved.push_back({{"unit_id", view.layout->unit({n}).id.value},
                        {"outcome", Name(unit.outcome)},
                        {"reason", unit.outcome_reason},
                        {"sighting", unit.measurement ? Json(Name(*unit.measurement)) : Json()},
                        {"error_um", unit.error_um ? Json(*unit.error_um) : Json()},
                        {"state", Name(unit.phase)}});
  }
  return unserved;
}

Json BusJson(const FleetView& view, BusId bus, const ShellFacts::Bus& shell,
             const BusClocks& clocks) {
  const BusView& seen = view.coordinator->bus(bus);
  Json json{{"bus_id", bus.value},
            {"link", Name(seen.link)},
            {"load", seen.load},
            {"load_max", seen.load_max},
            {"frames_sent", seen.frames_sent},
            {"frames_received", seen.frames_received},
            {"bits", seen.bits},
            {"malformed", seen.malformed},
            {"retries", seen.retries},
            {"port", shell.port},
            {"trouble", shell.trouble},
            {"waiting", shell.waiting},
            {"rejected", shell.counters.rejected},
            {"lost", shell.counters.lost},
            {"forged", shell.counters.forged},
            {"link_errors", shell.counters.link_errors},
            {"reconnects", shell.counters.reconnects},
            {"refused", shell.transmit_queue.refused},
            {"stale", shell.transmit_queue.stale},
            {"late_starts", shell.transmit_queue.late_starts}};
  PutUpload(seen.upload, &json);
  json["clocks"] = clocks.known;
  json["clock_bound_s"] = clocks.known > 0 ? Json(clocks.bound_s) : Json(nullptr);
  json["clock_rate_error"] = clocks.known > 0 ? Json(clocks.rate_error) : Json(nullptr);
  return json;
}

Json AxisJson(const FleetView& view, PositionerIndex i, const UnitKnowledge& knowledge,
              std::size_t a) {
  const Unit& unit = view.layout->unit(i);
  const UnitView& seen = view.coordinator->unit(i);
  const AxisDrive& drive = view.coordinator->drives()[i.value].axis[a];
  const bool known = knowledge[a].witness != Witness::kUnknown;
  const auto degrees = [&](std::int32_t vectors) { return AngleDeg(vectors, unit.axis[a], drive); };
  return {{"witness", Name(knowledge[a].witness)},
          {"low_deg", known ? Json(degrees(knowledge[a].low)) : Json(nullptr)},
          {"high_deg", known ? Json(degrees(knowledge[a].high)) : Json(nullptr)},
          {"low_vectors", known ? Json(knowledge[a].low) : Json(nullptr)},
          {"high_vectors", known ? Json(knowledge[a].high) : Json(nullptr)},
          {"target_deg", seen.target ? Json(degrees((*seen.target)[a])) : Json(nullptr)},
          {"target_vectors", seen.target ? Json((*seen.target)[a]) : Json(nullptr)},
          {"min_deg", unit.axis[a].min_deg},
          {"max_deg", unit.axis[a].max_deg},
          {"gear", unit.axis[a].gear},
          {"counter1", drive.counter1},
          {"repeat", drive.repeat},
          {"subdivision", drive.subdivision}};
}

/// The progress of the configuration, 0..1: by time while units move, by arrivals in the end.
double FractionOf(const FleetView& fleet) {
  const ConfigurationView& view = fleet.coordinator->configuration();
  if (view.state == ConfigurationState::kDone) return 1;
  const double arrived =
      view.counts.targeted > 0 ? double(view.counts.arrived) / view.counts.targeted : 0;
  if (view.started == kNever || view.makespan_predicted_s <= 0) return arrived;
  return std::clamp(MakespanSoFar(fleet) / view.makespan_predicted_s, arrived, 1.0);
}

}  // namespace

Json MeasuredJson(const std::vector<MeasuredRound>& measured) {
  Json rounds = Json::array();
  for (const MeasuredRound& round : measured)
    rounds.push_back({{"exposure", round.exposure},
                      {"measured", round.measured},
                      {"unknown", round.unknown},
                      {"within_tolerance", round.within_tolerance},
                      {"by_sensors", round.by_sensors},
                      {"camera", round.camera},
                      {"rms_um", Number(round.rms_um)},
                      {"median_um", Number(round.median_um)},
                      {"worst_um", Number(round.worst_um)}});
  return rounds;
}

Json ConfigurationJson(const FleetView& view) {
  const ConfigurationView& c = view.coordinator->configuration();
  Json json{{"id", c.id},
            {"kind", Name(c.kind)},
            {"source", c.source},
            {"state", Name(c.state)},
            {"round", c.round},
            {"targeted", c.counts.targeted},
            {"arrived", c.counts.arrived},
            {"refused", c.counts.refused},
            {"failed", c.counts.failed},
            {"stopped", c.counts.stopped},
            {"unmeasured", c.counts.unmeasured},
            {"makespan_predicted_s", Number(c.makespan_predicted_s)},
            {"makespan_s", Number(MakespanSoFar(view))},
            {"energy_J", Number(c.energy_J)},
            {"peak_power_W", Number(c.peak_power_W)},
            {"frames", c.frames},
            {"bus_load_max", HighestBusLoad(view)},
            {"unserved", UnservedJson(view)}};
  PutUpload(c.upload, &json);
  PutStarts(view, &json);
  json["measured"] = MeasuredJson(c.measured);
  json["not_measured"] = c.not_measured.empty() ? Json() : Json(c.not_measured);
  return json;
}

Json ProgressJson(const FleetView& view) {
  const ConfigurationView& c = view.coordinator->configuration();
  return {{"id", c.id},
          {"kind", Name(c.kind)},
          {"state", Name(c.state)},
          {"round", c.round},
          {"targeted", c.counts.targeted},
          {"arrived", c.counts.arrived},
          {"refused", c.counts.refused},
          {"failed", c.counts.failed},
          {"stopped", c.counts.stopped},
          {"unmeasured", c.counts.unmeasured},
          {"frames", c.frames},
          {"makespan_predicted_s", Number(c.makespan_predicted_s)},
          {"waiting_for", c.waiting_for},
          {"fraction", FractionOf(view)}};
}

Json StatusJson(const FleetView& view, const ShellFacts& facts) {
  const FleetCounts counts = CountFleet(view);
  Json phases = Json::object();
  for (std::size_t p = 0; p < counts.by_phase.size(); ++p)
    phases[Name(static_cast<UnitPhase>(p))] = counts.by_phase[p];
  Json witnesses = Json::object();
  for (std::size_t w = 0; w < counts.by_witness.size(); ++w)
    witnesses[Name(static_cast<Witness>(w))] = counts.by_witness[w];
  Json buses = Json::array();
  std::map<BusId, BusClocks> clocks = ClocksByBus(view);
  for (std::size_t b = 0; b < facts.buses.size(); ++b) {
    const BusId bus = view.layout->buses()[b];
    buses.push_back(BusJson(view, bus, facts.buses[b], clocks[bus]));
  }
  return {{"version", facts.version},
          {"time", ToIso8601(view.at)},
          {"started", ToIso8601(facts.started)},
          {"page", facts.page.empty() ? Json() : Json(facts.page)},
          {"units", view.layout->size()},
          {"enabled", counts.enabled},
          {"phases", std::move(phases)},
          {"positions", std::move(witnesses)},
          {"busy", view.coordinator->busy()},
          {"store",
           {{"path", facts.store_path},
            {"failing", facts.store_failing},
            {"waiting", facts.batches_waiting},
            {"transactions", facts.store.transactions},
            {"rows", facts.store.rows}}},
          {"dds",
           {{"enabled", facts.dds_enabled},
            {"trouble", facts.dds_trouble},
            {"samples", facts.dds_samples},
            {"bytes", facts.dds_bytes}}},
          {"alarms",
           {{"open", facts.alarms.open},
            {"muted", facts.alarms.muted},
            {"worst", facts.alarms.worst.empty() ? Json() : Json(facts.alarms.worst)}}},
          {"process", {{"cpu_s", facts.cpu_s}, {"steps", facts.steps}}},
          {"configuration", ConfigurationJson(view)},
          {"next", NextStep(view, facts)},
          {"buses", std::move(buses)},
          {"bus_load_max", HighestBusLoad(view)}};
}

Json FibreCarrierJson(const FibreCarrierReading& carrier) {
  Json json = {
      {"verdict", carrier.verdict}, {"trusted", carrier.trusted}, {"sensors_used", carrier.used}};
  const auto put = [&](const char* name, double value) {
    json[name] = carrier.solved ? Json(value) : Json();
  };
  const char* const angles[] = {"alpha_deg", "beta_deg", "gamma_deg"};
  const char* const covariances[] = {"cov_aa_deg2", "cov_ab_deg2", "cov_ag_deg2",
                                     "cov_bb_deg2", "cov_bg_deg2", "cov_gg_deg2"};
  for (std::size_t k = 0; k < 3; ++k) put(angles[k], carrier.angles_deg[k]);
  for (std::size_t k = 0; k < 6; ++k) put(covariances[k], carrier.covariance_deg2[k]);
  return json;
}

Json UnitJson(const FleetView& view, PositionerIndex i) {
  const Unit& unit = view.layout->unit(i);
  const UnitView& seen = view.coordinator->unit(i);
  const UnitDrive& drive = view.coordinator->drives()[i.value];
  const UnitKnowledge knowledge = view.coordinator->KnowledgeAt(i, view.now);
  const UnitStatusValue status = SnapshotUnit(view, i);
  Json target = {{"x_mm", nullptr}, {"y_mm", nullptr}};
  if (seen.target) {
    const PointFp fibre = FibreAt(unit, drive, *seen.target);
    target = {{"x_mm", fibre.x_mm}, {"y_mm", fibre.y_mm}};
  }
  return {{"unit_id", unit.id.value},
          {"phase", Name(seen.phase)},
          {"serial", seen.serial.value},
          {"bound_serial", seen.bound_serial.value},
          {"bus_id", unit.bus.value},
          {"node_id", unit.node.value},
          {"rail_id", unit.rail.value},
          {"reported_state", Name(seen.reported_state)},
          {"fault", Name(seen.fault)},
          {"move", seen.move.value},
          {"enabled", seen.enabled},
          {"disabled_reason", seen.disabled_reason},
          {"outcome", Name(seen.outcome)},
          {"reason", seen.outcome_reason},
          {"x_mm", Number(status.x_fp_mm)},
          {"y_mm", Number(status.y_fp_mm)},
          {"target", std::move(target)},
          {"sighting", seen.measurement ? Json(Name(*seen.measurement)) : Json()},
          {"error_um", seen.error_um ? Json(*seen.error_um) : Json()},
          {"measured_by", seen.measurement ? Json(Name(seen.source)) : Json()},
          {"orientation", seen.carrier ? FibreCarrierJson(*seen.carrier) : Json()},
          {"mode", Name(drive.mode)},
          {"v_bus_V", drive.v_bus_V},
          {"clock", ClockJson(seen.clock)},
          {"theta", AxisJson(view, i, knowledge, Index(Axis::kTheta))},
          {"phi", AxisJson(view, i, knowledge, Index(Axis::kPhi))}};
}

}  // namespace focalfleet
