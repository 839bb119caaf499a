#include "daemon/plane/sector_seat.h"

#include <algorithm>
#include <iterator>
#include <utility>

namespace focalfleet {

SectorSeat::SectorSeat(Options options, SectorMemory memory)
    : options_(std::move(options)),
      memory_(std::move(memory)),
      agent_(options_.agent, memory_.life(), memory_.epoch()),
      kept_(memory_.epoch()),
      keeping_(memory_.epoch()) {}

Result<std::unique_ptr<SectorSeat>> SectorSeat::Create(Options options, const EventSignal* wake) {
  FOCALFLEET_TRY_ASSIGN(SectorMemory memory, SectorMemory::BeginLife(options.memory));
  std::unique_ptr<SectorSeat> seat(new SectorSeat(std::move(options), std::move(memory)));
  // From here on the memory belongs to the keeper's thread.
  FOCALFLEET_TRY_ASSIGN(seat->keeper_,
                        Keeper::Create(
                            [memory = &seat->memory_](const PlaneEpoch& epoch, const auto&) {
                              return Kept{epoch, memory->Keep(epoch)};
                            },
                            wake, {.name = "epoch"}));
  seat->link_ =
      std::make_unique<PlaneLink>(PlaneLink::Options{.dds = seat->options_.dds,
                                                     .sector = seat->options_.agent.sector,
                                                     .arrived = [wake] { wake->Raise(); },
                                                     .tell = seat->options_.tell});
  return seat;
}

/// The places of all units, at most once a second and not while they change.
std::shared_ptr<const SectorPlaces> SectorSeat::PlacesIfDue(HostInstant now,
                                                            const Coordinator& coordinator) {
  if (coordinator.sector().stage != SectorStage::kIdle || now < places_at_) return nullptr;
  places_at_ = now + Seconds(1);
  auto places = std::make_shared<SectorPlaces>();
  const auto drives = coordinator.drives();
  places->drives.assign(drives.begin(), drives.end());
  places->places.reserve(drives.size());
  for (std::uint32_t n = 0; n < drives.size(); ++n)
    places->places.push_back(coordinator.unit({n}).knowledge);
  return places;
}

void SectorSeat::Gather(HostInstant now, const Coordinator& coordinator,
                        std::vector<Command>* commands, std::vector<ShellNote>* notes) {
  while (const auto kept = keeper_->Take()) {
    if (kept->status)
      kept_ = std::max(kept_, kept->epoch);
    else
      options_.log_error("the plane's epoch cannot be kept: " + kept->status.error().text);
    keeping_ = kept_;  // an epoch that could not be kept is asked for again by its repeat
  }
  const PlaneMail mail = link_->Take();
  if (mail.empty() && !any_ && now < wake_at_ && !(agent_.accepted() < kept_)) return;
  AgentEffects effects;
  agent_.Step({.now = now,
               .orders = mail.orders,
               .news = mail.news,
               .kept = kept_,
               .view = coordinator.sector(),
               .configuration = &coordinator.configuration(),
               .job = last_.plan_job ? &*last_.plan_job : nullptr,
               .exposure = last_.exposure ? &*last_.exposure : nullptr,
               .drives = coordinator.drives(),
               .places = PlacesIfDue(now, coordinator),
               .replies = last_.replies,
               .ends = last_.border_ends},
              &effects);
  last_.Clear();
  any_ = false;
  if (effects.keep && keeping_ < *effects.keep) {
    PlaneEpoch epoch = *effects.keep;
    if (keeper_->Submit(&epoch)) keeping_ = *effects.keep;
  }
  if (effects.report) link_->Send(*effects.report);
  if (effects.news) link_->Send(*effects.news);
  std::ranges::move(effects.commands, std::back_inserter(*commands));
  std::ranges::move(effects.notes, std::back_inserter(*notes));
  wake_at_ = effects.wake_at;
}

void SectorSeat::Take(Effects* effects) {
  if (effects->plan_job) last_.plan_job = std::exchange(effects->plan_job, std::nullopt);
  if (effects->exposure) last_.exposure = std::exchange(effects->exposure, std::nullopt);
  const auto of_plane = [](const ReplyEffect& reply) {
    return reply.request == SectorAgent::kRequest;
  };
  std::ranges::copy_if(effects->replies, std::back_inserter(last_.replies), of_plane);
  std::erase_if(effects->replies, of_plane);
  std::ranges::move(effects->border_ends, std::back_inserter(last_.border_ends));
  // The agent also looks at the stage, which any step may have changed.
  any_ = true;
  wake_at_ = HostInstant{0};
}

}  // namespace focalfleet
