#include "fleet/plane/sector_book.h"

#include <algorithm>
#include <utility>

namespace focalfleet {
namespace {

std::string InMilliseconds(DurationNs time) {
  const std::int64_t tenths = time.ns / 100'000;
  return std::to_string(tenths / 10) + "." + std::to_string(tenths % 10) + " ms";
}

bool IsSame(const PlaneOrder& a, const PlaneOrder& b) {
  return a.kind == b.kind && a.incarnation == b.incarnation && a.configuration == b.configuration &&
         a.round == b.round && a.job == b.job && a.start_at == b.start_at && a.change == b.change;
}

}  // namespace

SectorBook::SectorBook(const PlaneLayout* plane, const PlaneTimes& times)
    : times_(times), entries_(plane->sectors()) {
  for (std::uint32_t sector = 0; sector < plane->sectors(); ++sector) {
    const Result<Layout> part = plane->layout().Part(plane->own(sector));
    if (part) entries_[sector].digest = DigestOf(*part);
    entries_[sector].units = plane->own(sector).size();
    entries_[sector].order.sector = sector;
    entries_[sector].trouble = "is not heard";
  }
}

void SectorBook::BeginEpoch(const PlaneEpoch& epoch) {
  epoch_ = epoch;
  next_number_ = 1;
  for (std::uint32_t sector = 0; sector < size(); ++sector) {
    Entry& entry = entries_[sector];
    entry.order = {.epoch = epoch, .sector = sector, .number = next_number_++};
    entry.said = entry.body_said = HostInstant{INT64_MIN};
  }
}

void SectorBook::Hear(const SectorReport& report, HostInstant now) {
  if (report.sector >= size()) return;
  Entry& entry = entries_[report.sector];
  // A late word of an earlier life, or of this one.
  if (entry.report &&
      (report.incarnation < entry.report->incarnation ||
       (report.incarnation == entry.report->incarnation && report.number <= entry.report->number)))
    return;
  if (!entry.report || entry.report->incarnation != report.incarnation) {
    entry.clock.Forget();
    entry.job.reset();
    entry.exposure.reset();
  }
  if (report.echo)
    entry.clock.Add({report.echo->sent, report.echo->received, report.echo->returned, now});
  if (report.body != nullptr && FaultOf(*report.body, entry.units).empty() &&
      (entry.job == nullptr || entry.job->job < report.body->job))
    entry.job = report.body;
  if (report.places != nullptr && FaultOf(*report.places, entry.units).empty()) {
    entry.places = report.places;
    entry.places_digest = DigestOf(*report.places);
  }
  if (report.exposure != nullptr && FaultOf(*report.exposure, entry.units).empty())
    entry.exposure = report.exposure;
  entry.report = report;
  entry.report->body.reset();
  entry.report->places.reset();
  entry.report->exposure.reset();
  entry.heard = now;
}

std::string SectorBook::TroubleOf(const Entry& entry) const {
  if (!entry.report || now_ - entry.heard > times_.silence) return "is not heard";
  if (entry.report->layout != entry.digest) return "has another units file than the plane";
  if (entry.report->accepted != epoch_) return "has not accepted this coordinator yet";
  const std::optional<ClockOffset> clock = entry.clock.At(now_);
  if (!clock) return "has no clock that is known yet";
  if (times_.clock_allowance < clock->bound)
    return "has a clock that is known to " + InMilliseconds(clock->bound) +
           " only, and plans allow for " + InMilliseconds(times_.clock_allowance);
  return {};
}

void SectorBook::Look(HostInstant now) {
  now_ = now;
  for (Entry& entry : entries_) entry.trouble = TroubleOf(entry);
}

bool SectorBook::IsHeard(std::uint32_t sector) const {
  const Entry& entry = entries_[sector];
  return entry.report && now_ - entry.heard <= times_.silence;
}

bool SectorBook::HasLooseClock(std::uint32_t sector) const {
  const Entry& entry = entries_[sector];
  if (!IsHeard(sector) || entry.report->accepted != epoch_ || entry.report->layout != entry.digest)
    return false;
  const std::optional<ClockOffset> clock = entry.clock.At(now_);
  return clock && times_.clock_allowance < clock->bound;
}

PlaneEpoch SectorBook::highest_accepted() const {
  PlaneEpoch highest;
  for (const Entry& entry : entries_)
    if (entry.report) highest = std::max(highest, entry.report->accepted);
  return highest;
}

void SectorBook::Order(std::uint32_t sector, PlaneOrder order) {
  Entry& entry = entries_[sector];
  order.epoch = epoch_;
  order.sector = sector;
  order.incarnation = entry.report ? entry.report->incarnation : 0;
  if (entry.order.number != 0 && IsSame(entry.order, order)) return;
  order.number = next_number_++;
  entry.order = std::move(order);
  entry.said = entry.body_said = HostInstant{INT64_MIN};
}

bool SectorBook::IsDone(std::uint32_t sector) const {
  const Entry& entry = entries_[sector];
  return entry.report && entry.report->accepted == epoch_ &&
         entry.report->order >= entry.order.number;
}

HostInstant SectorBook::Say(HostInstant now, std::vector<PlaneOrder>* orders) {
  HostInstant due = kNever;
  for (std::uint32_t sector = 0; sector < size(); ++sector) {
    Entry& entry = entries_[sector];
    if (entry.order.number == 0) continue;
    if (entry.said.ns == INT64_MIN || now >= entry.said + times_.repeat) {
      PlaneOrder order = entry.order;
      const bool body_due =
          entry.body_said.ns == INT64_MIN || now >= entry.body_said + times_.body_repeat;
      if (IsDone(sector) || !body_due) {
        order.task.reset();
        order.round_body.reset();
        order.findings.reset();
      } else {
        entry.body_said = now;
      }
      order.sent = now;
      if (const auto clock = entry.clock.At(now)) order.ahead = clock->ahead;
      order.places_seen = entry.places_digest;
      order.exposure_seen = entry.exposure == nullptr ? 0 : entry.exposure->id;
      order.job_seen = entry.job == nullptr ? 0 : entry.job->job;
      orders->push_back(std::move(order));
      entry.said = now;
    }
    due = std::min(due, entry.said + times_.repeat);
  }
  return due;
}

}  // namespace focalfleet
