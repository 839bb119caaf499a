#include "fleet/plane/plane_recall.h"

#include <string>
#include <utility>

#include "fleet/plane/plane_rounds.h"

namespace focalfleet {

void PlaneRecall::Begin() { reported_.assign(state_.sectors.size(), {}); }

void PlaneRecall::Count() {
  const auto& configuration =
      state_.record.under_way ? state_.record.under_way : state_.record.last;
  if (!configuration) return;
  OutcomeCounts sum;
  sum.targeted = static_cast<std::uint32_t>(configuration->to_home.size());
  if (configuration->kind == ConfigurationKind::kMeasure)
    for (const OutcomeCounts& counts : reported_) sum.targeted += counts.targeted;
  else
    for (const auto& target : configuration->targets) sum.targeted += target ? 1u : 0u;
  for (std::uint32_t sector = 0; sector < state_.sectors.size(); ++sector) {
    const auto& report = state_.sectors[sector].report;
    const bool works = state_.record.under_way && report && report->configuration == state_.Id();
    if (works || (report && report->last_over == state_.Id())) reported_[sector] = report->counts;
    const OutcomeCounts& counts = reported_[sector];
    sum.arrived += counts.arrived;
    sum.refused += counts.refused;
    sum.failed += counts.failed;
    sum.stopped += counts.stopped;
    sum.unmeasured += counts.unmeasured;
  }
  state_.view.counts = sum;
}

void PlaneRecall::Idle() {
  for (std::uint32_t sector = 0; sector < state_.sectors.size(); ++sector) {
    if (!state_.sectors.IsUsable(sector)) continue;
    const SectorReport& report = *state_.sectors[sector].report;
    const PlaneConfigurationId configuration = report.configuration;
    const bool knows_none = configuration.number == 0 && report.last_over.number == 0;
    // Where a measured configuration ended only an exposure tells, and no sector gets one now.
    const auto& last = state_.record.last;
    const bool tells = last && last->kind == ConfigurationKind::kApply && !last->measure;
    if (tells && (configuration == state_.Id() || knows_none))
      Recall(sector);
    else
      state_.sectors.Order(
          sector, {.kind = configuration.number == 0 ? OrderKind::kStand : OrderKind::kStop,
                   .configuration = configuration});
  }
}

void PlaneRecall::Recall(std::uint32_t sector) {
  const SectorBook::Entry& entry = state_.sectors[sector];
  const SectorReport& report = *entry.report;
  if (report.configuration != state_.Id()) {
    if (report.stage == SectorStage::kIdle)
      state_.sectors.Order(sector, {.kind = OrderKind::kConfigure,
                                    .configuration = state_.Id(),
                                    .task = PartOf(*state_.record.last, state_.plane, sector)});
    return;
  }
  Withdraw(sector, &state_.sectors);  // of a round before the end, of which it had not heard
  const bool asks =
      report.stage == SectorStage::kAsking && entry.job != nullptr && entry.job->job == report.job;
  const PlanePart part{report.incarnation, report.job};
  if (!asks || parts_[sector] == part) return;
  parts_[sector] = part;
  ++state_.round;
  SectorRound body;
  body.end = state_.record.last_state;
  const bool stopped = body.end == ConfigurationState::kStopped;
  if (stopped) body.failure = "the configuration was stopped";
  for (std::uint32_t n = 0; n < entry.units && !stopped; ++n)
    if (entry.job->targets[n] && !IsAtTarget(*entry.job, n))
      body.refused.push_back(
          {PositionerIndex{n},
           std::string("it does not stand there, and the configuration is over: ") +
               Name(state_.record.last_state)});
  state_.sectors.Order(sector, EndOf(report.job, state_.Id(), state_.round, std::move(body)));
}

}  // namespace focalfleet
