#include "daemon/page/night_curves.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include "fleet/estimate.h"

namespace focalfleet {
namespace {

using nlohmann::json;

constexpr std::size_t kPowerParts = 400;

std::int64_t MsOf(WallTime at) { return at.ns / 1'000'000; }

json RoundedOrNull(double value) {
  return std::isfinite(value) ? json(std::round(value * 1000) / 1000) : json();
}

/// The highest power in each of kPowerParts parts of the time. A step that begins and ends within
/// one part counts there.
std::vector<double> PartsOf(const std::vector<PowerStep>& steps, double end_s) {
  std::vector<double> parts(kPowerParts, 0);
  if (!(end_s > 0)) return parts;
  const auto part = [&](double t_s) {
    return std::min(kPowerParts - 1, static_cast<std::size_t>(std::max(0.0, t_s / end_s) *
                                                              static_cast<double>(kPowerParts)));
  };
  for (std::size_t k = 0; k < steps.size(); ++k) {
    const double until_s = k + 1 < steps.size() ? steps[k + 1].t_s : steps[k].t_s;
    for (std::size_t p = part(steps[k].t_s); p <= part(until_s); ++p)
      parts[p] = std::max(parts[p], steps[k].power_W);
  }
  return parts;
}

template <class Entry>
void AddBounded(Entry entry, std::size_t most, std::deque<Entry>* list) {
  list->push_back(std::move(entry));
  while (list->size() > most) list->pop_front();
}

template <class Entry>
std::size_t FirstAfter(const std::deque<Entry>& list, std::int64_t since_ms) {
  const auto first =
      std::ranges::find_if(list, [&](const Entry& entry) { return entry.at_ms > since_ms; });
  return static_cast<std::size_t>(first - list.begin());
}

/// A column of the entries from `first` on.
template <class Entry, class ValueOf>
json ColumnFrom(const std::deque<Entry>& list, std::size_t first, ValueOf value_of) {
  json column = json::array();
  for (std::size_t k = first; k < list.size(); ++k) column.push_back(value_of(list[k]));
  return column;
}

json RoundedColumn(const std::vector<double>& values) {
  json column = json::array();
  for (const double value : values) column.push_back(RoundedOrNull(value));
  return column;
}

json PowerJson(const PlanPower& power) {
  json rails = json::object();
  for (const auto& [rail, parts] : power.rail_W)
    rails[std::to_string(rail.value)] = RoundedColumn(parts);
  return {{"configuration", power.configuration},
          {"end_s", RoundedOrNull(power.end_s)},
          {"rail_limit_W", RoundedOrNull(power.rail_limit_W)},
          {"limit_W", RoundedOrNull(power.limit_W)},
          {"rail_W", std::move(rails)},
          {"total_W", RoundedColumn(power.total_W)}};
}

}  // namespace

PlanPower PowerOverTime(const Plan& plan, const PlanJob& job, const Layout& layout,
                        std::span<const UnitDrive> drives) {
  const PlanEstimate estimate = Estimate(plan, layout, drives, MotorModel{});
  PlanPower power{.end_s = estimate.makespan_s,
                  .rail_limit_W = job.options.power.rail_W,
                  .limit_W = job.options.power.total_W,
                  .rail_W = {},
                  .total_W = PartsOf(estimate.total, estimate.makespan_s)};
  for (const RailCurve& rail : estimate.rails)
    power.rail_W[rail.rail] = PartsOf(rail.steps, estimate.makespan_s);
  return power;
}

NightCurves::NightCurves(Options options) : options_(options) {}

void NightCurves::Take(const StatusBatch& batch) {
  const std::lock_guard lock(mutex_);
  if (batch.configuration) TakeExposures(*batch.configuration);
  if (!batch.fleet) return;
  const FleetStatusValue& fleet = *batch.fleet;
  if (std::isfinite(fleet.bus_load_max))
    load_max_ = std::max(load_max_, static_cast<float>(fleet.bus_load_max));
  const std::int64_t now_ms = MsOf(fleet.at);
  // Wall time may step back: such a sample is taken at once.
  if (!samples_.empty() && now_ms >= samples_.back().at_ms &&
      now_ms - samples_.back().at_ms < options_.period_ns / 1'000'000)
    return;
  Sample sample{.at_ms = now_ms,
                .disabled = static_cast<std::uint16_t>(fleet.units - fleet.enabled),
                .load_max = std::exchange(load_max_, 0.0f)};
  for (std::size_t k = 0; k < kUnitPhaseCount; ++k)
    sample.phases[k] = static_cast<std::uint16_t>(std::min<std::uint32_t>(
        fleet.units_by_phase[k], std::numeric_limits<std::uint16_t>::max()));
  AddBounded(sample, options_.samples_max, &samples_);
}

void NightCurves::TakeExposures(const ConfigurationProgressValue& progress) {
  for (const MeasuredRound& round : progress.view.measured) {
    const bool known = std::ranges::any_of(
        exposures_, [&](const Exposure& exposure) { return exposure.exposure == round.exposure; });
    if (known) continue;
    AddBounded({.at_ms = MsOf(progress.at),
                .configuration = progress.view.id,
                .exposure = round.exposure,
                .measured = round.measured,
                .unknown = round.unknown,
                .median_um = static_cast<float>(round.median_um),
                .worst_um = static_cast<float>(round.worst_um)},
               options_.exposures_max, &exposures_);
  }
}

void NightCurves::Take(PlanPower power) {
  Peak peak{.at_ms = MsOf(power.at), .configuration = power.configuration, .rail_W = {}};
  const auto most = [](const std::vector<double>& parts) {
    return parts.empty() ? 0.0f : static_cast<float>(*std::ranges::max_element(parts));
  };
  for (const auto& [rail, parts] : power.rail_W) peak.rail_W[rail] = most(parts);
  peak.total_W = most(power.total_W);
  const std::lock_guard lock(mutex_);
  AddBounded(std::move(peak), options_.plans_max, &peaks_);
  // The longest plan of a configuration is shown: corrections are brief.
  if (power.configuration != power_.configuration || power.end_s >= power_.end_s)
    power_ = std::move(power);
}

void NightCurves::TakePreview(std::uint64_t plan, PlanPower power) {
  const std::lock_guard lock(mutex_);
  preview_plan_ = plan;
  preview_power_ = std::move(power);
}

std::optional<std::string> NightCurves::PreviewText(std::uint64_t plan) const {
  const std::lock_guard lock(mutex_);
  if (plan == 0 || plan != preview_plan_) return std::nullopt;
  return PowerJson(preview_power_).dump();
}

std::string NightCurves::Text(std::int64_t since_ms) const {
  const std::lock_guard lock(mutex_);
  const auto column = [since_ms](const auto& list, auto value_of) {
    return ColumnFrom(list, FirstAfter(list, since_ms), value_of);
  };
  json phases = json::array();
  for (std::size_t p = 0; p < kUnitPhaseCount; ++p)
    phases.push_back(column(samples_, [p](const Sample& sample) { return sample.phases[p]; }));
  const json all{
      {"samples",
       {{"at_ms", column(samples_, [](const Sample& sample) { return sample.at_ms; })},
        {"phases", std::move(phases)},
        {"disabled", column(samples_, [](const Sample& sample) { return sample.disabled; })},
        {"bus_load_max",
         column(samples_, [](const Sample& sample) { return RoundedOrNull(sample.load_max); })}}},
      {"exposures",
       {{"at_ms", column(exposures_, [](const Exposure& one) { return one.at_ms; })},
        {"configuration",
         column(exposures_, [](const Exposure& one) { return one.configuration; })},
        {"exposure", column(exposures_, [](const Exposure& one) { return one.exposure; })},
        {"measured", column(exposures_, [](const Exposure& one) { return one.measured; })},
        {"unknown", column(exposures_, [](const Exposure& one) { return one.unknown; })},
        {"median_um",
         column(exposures_, [](const Exposure& one) { return RoundedOrNull(one.median_um); })},
        {"worst_um",
         column(exposures_, [](const Exposure& one) { return RoundedOrNull(one.worst_um); })}}},
      {"plans",
       {{"at_ms", column(peaks_, [](const Peak& peak) { return peak.at_ms; })},
        {"configuration", column(peaks_, [](const Peak& peak) { return peak.configuration; })},
        {"rail_W", column(peaks_,
                          [](const Peak& peak) {
                            float most = 0;
                            for (const auto& [rail, watts] : peak.rail_W)
                              most = std::max(most, watts);
                            return RoundedOrNull(most);
                          })},
        {"total_W", column(peaks_, [](const Peak& peak) { return RoundedOrNull(peak.total_W); })}}},
      {"power", PowerJson(power_)}};
  return all.dump();
}

}  // namespace focalfleet
