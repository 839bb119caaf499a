#include "daemon/metrics/metrics_sampler.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <variant>

namespace focalfleet {
namespace {

constexpr DurationNs kPeriod = Milliseconds(1000);  // real time; Prometheus asks every 15 s

// A fibre's core is some 100 um wide; corrections end at a few um (docs/camera.md).
constexpr double kErrorBounds_m[] = {2e-6, 5e-6, 1e-5, 2e-5, 3e-5, 5e-5, 1e-4, 2e-4, 5e-4, 1e-3};
constexpr double kRetryBounds[] = {0, 1, 3, 10, 30, 100, 300, 1000, 3000, 10'000};
// Plans allow 20 ms between the starts of two units (PlanOptions).
constexpr double kSkewBounds_s[] = {1e-4, 3e-4, 1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2, 0.1, 0.5};
// From one exposure to the next, up to a day.
constexpr double kAgeBounds_s[] = {10, 60, 300, 900, 1800, 3600, 7200, 14'400, 43'200, 86'400};

bool Answers(UnitPhase phase) { return phase != UnitPhase::kAbsent && phase != UnitPhase::kSilent; }

std::uint64_t RetriesOf(const FleetView& view) {
  std::uint64_t retries = 0;
  for (const BusId bus : view.layout->buses()) retries += view.coordinator->bus(bus).retries;
  return retries;
}

double FiniteOr0(double value) { return std::isfinite(value) ? value : 0; }

}  // namespace

MetricsSampler::MetricsSampler(Parts parts)
    : parts_(std::move(parts)),
      measured_at_(parts_.layout->size(), kNever),
      power_(std::make_unique<const PlannedPower>()),
      position_error_m_(kErrorBounds_m),
      configuration_retries_(kRetryBounds),
      start_skew_s_(kSkewBounds_s),
      knowledge_age_s_(kAgeBounds_s) {
  const auto buses = parts_.layout->buses();
  for (const Unit& unit : parts_.layout->units()) rails_.push_back(unit.rail);
  std::ranges::sort(rails_);
  rails_.erase(std::unique(rails_.begin(), rails_.end()), rails_.end());
  const auto index_of = [](const auto& sorted, const auto& id) {
    return static_cast<std::uint32_t>(std::ranges::lower_bound(sorted, id) - sorted.begin());
  };
  for (const Unit& unit : parts_.layout->units()) {
    bus_of_.push_back(index_of(buses, unit.bus));
    rail_of_.push_back(index_of(rails_, unit.rail));
  }
}

void MetricsSampler::Note(const FleetView& view, const Effects& effects) {
  NoteConfiguration(view);
  for (const Row& row : effects.rows) {
    // An alarm of no times is another text for one that was counted.
    if (const auto* alarm = std::get_if<AlarmRow>(&row); alarm != nullptr && alarm->times > 0)
      ++alarms_by_name_[static_cast<std::size_t>(KindOf(alarm->name).name)];
    const auto* measurement = std::get_if<MeasurementRow>(&row);
    if (measurement == nullptr || !measurement->place) continue;
    if (measurement->error_um) position_error_m_.Observe(1e-6 * *measurement->error_um);
    if (const auto i = view.layout->Find(measurement->unit)) measured_at_[i->value] = view.now;
  }
}

void MetricsSampler::NoteConfiguration(const FleetView& view) {
  const ConfigurationView& now = view.coordinator->configuration();
  // The configuration that the store returned at the start was ended by an earlier daemon.
  if (!configuration_) configuration_ = now.id;
  if (now.id != configuration_) {
    configuration_ = now.id;
    over_ = false;
    retries_before_ = RetriesOf(view);
    began_ = view.at;
    ended_ = WallTime{};
    for (std::uint32_t n = 0; n < view.layout->size(); ++n)
      if (view.coordinator->unit({n}).outcome != TargetOutcome::kNone && measured_at_[n] != kNever)
        knowledge_age_s_.Observe((view.now - measured_at_[n]).seconds());
  }
  if (over_ || !IsOver(now.state)) return;
  over_ = true;
  ended_ = view.at;
  const auto ending = static_cast<std::size_t>(now.state);
  ++configurations_ended_[ending - static_cast<std::size_t>(ConfigurationState::kDone)];
  configuration_retries_.Observe(static_cast<double>(RetriesOf(view) - retries_before_));
  if (now.starts.reported > 0) start_skew_s_.Observe(now.starts.skew_s);
}

void MetricsSampler::SampleIfDue(const FleetView& view) {
  if (view.now < next_) return;
  next_ = view.now + parts_.clock.Real(kPeriod);
  if (auto power = parts_.power->Take()) power_ = std::move(power);
  auto out = std::make_unique<FleetMetrics>();
  out->at = view.at;
  out->units = static_cast<std::uint32_t>(view.layout->size());
  CountUnits(view, out.get());
  DescribeConfiguration(view, &out->configuration);
  DescribeShell(view, out.get());
  out->rail_limit_W = power_->rail_limit_W;
  out->limit_W = power_->limit_W;
  out->power_predicted_W = power_->peak_W;
  out->configurations_ended = configurations_ended_;
  out->alarms_by_name = alarms_by_name_;
  out->position_error_m = position_error_m_.Read();
  out->configuration_retries = configuration_retries_.Read();
  out->start_skew_s = start_skew_s_.Read();
  out->knowledge_age_s = knowledge_age_s_.Read();
  parts_.out->Put(std::move(out));
}

void MetricsSampler::CountUnits(const FleetView& view, FleetMetrics* out) const {
  const auto buses = view.layout->buses();
  out->buses.resize(buses.size());
  for (std::size_t b = 0; b < buses.size(); ++b) out->buses[b].bus = buses[b];
  out->rails.resize(rails_.size());
  for (std::size_t r = 0; r < rails_.size(); ++r) {
    const auto planned = power_->rail_peak_W.find(rails_[r]);
    out->rails[r].rail = rails_[r];
    if (planned != power_->rail_peak_W.end()) out->rails[r].power_predicted_W = planned->second;
  }
  for (std::uint32_t n = 0; n < view.layout->size(); ++n) {
    const UnitView& unit = view.coordinator->unit({n});
    BusMetrics& bus = out->buses[bus_of_[n]];
    RailMetrics& rail = out->rails[rail_of_[n]];
    const std::uint32_t answering = Answers(unit.phase) ? 1 : 0;
    out->enabled += unit.enabled ? 1u : 0u;
    ++out->by_phase[static_cast<std::size_t>(unit.phase)];
    ++out->by_witness[static_cast<std::size_t>(WitnessOf(unit.knowledge))];
    ++bus.units;
    bus.answering += answering;
    ++rail.units;
    rail.answering += answering;
    if (unit.outcome != TargetOutcome::kNone && unit.error_um)
      out->configuration.worst_error_um =
          std::max(out->configuration.worst_error_um, *unit.error_um);
    if (unit.clock.readings == 0) continue;
    bus.clock_bound_s = std::max(bus.clock_bound_s, unit.clock.bound_s);
    if (std::abs(unit.clock.rate_error) > std::abs(out->clock_rate_error))
      out->clock_rate_error = unit.clock.rate_error;
  }
}

void MetricsSampler::DescribeConfiguration(const FleetView& view, ConfigurationMetrics* out) const {
  const ConfigurationView& c = view.coordinator->configuration();
  out->state = c.state;
  out->busy = view.coordinator->busy();
  out->counts = c.counts;
  out->makespan_predicted_s = FiniteOr0(c.makespan_predicted_s);
  out->makespan_s = FiniteOr0(MakespanSoFar(view));
  out->upload_s = FiniteOr0(c.upload.measured_s);
  if (c.starts.reported > 0) {
    out->start_skew_s = FiniteOr0(c.starts.skew_s);
    out->start_skew_allowed_s = FiniteOr0(c.starts.allowed_s);
  }
  out->energy_J = FiniteOr0(c.energy_J);
  out->began = began_;
  out->ended = ended_;
}

void MetricsSampler::DescribeShell(const FleetView& view, FleetMetrics* out) const {
  const ShellFacts facts = parts_.facts();
  out->version = facts.version;
  out->started = facts.started;
  out->store_failing = facts.store_failing;
  out->store_waiting = facts.batches_waiting;
  out->dds_enabled = facts.dds_enabled;
  out->dds_failing = !facts.dds_trouble.empty();
  out->dds_troubles = facts.dds_troubles;
  out->dds_samples = facts.dds_samples;
  out->dds_bytes = facts.dds_bytes;
  out->steps = facts.steps;
  for (std::size_t b = 0; b < facts.buses.size() && b < out->buses.size(); ++b) {
    const ShellFacts::Bus& shell = facts.buses[b];
    BusMetrics& bus = out->buses[b];
    const BusView& seen = view.coordinator->bus(bus.bus);
    bus.link = seen.link;
    bus.load = seen.load;
    bus.frames_sent = seen.frames_sent;
    bus.frames_received = seen.frames_received;
    bus.retransmits = seen.retries;
    bus.errors = shell.counters.link_errors;
    bus.waiting = shell.waiting;
    out->traffic.malformed += seen.malformed;
    out->traffic.rejected += shell.counters.rejected;
    out->traffic.lost += shell.counters.lost;
    out->traffic.reconnects += shell.counters.reconnects;
    out->traffic.discarded += shell.transmit_queue.refused + shell.transmit_queue.stale;
    out->traffic.late_starts += shell.transmit_queue.late_starts;
  }
}

}  // namespace focalfleet
