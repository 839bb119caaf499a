#include "daemon/soak/store_judge.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>
#include <variant>

namespace focalfleet::soak {

StoredPlace PlaceOf(const VectorRow& vector) {
  StoredPlace place;
  for (std::size_t axis = 0; axis < place.size(); ++axis)
    place[axis] = {static_cast<int>(vector.knowledge[axis].witness), vector.knowledge[axis].low,
                   vector.knowledge[axis].high};
  return place;
}

void StoreJudge::Apply(std::span<const Row> rows, StoredPicture* picture) {
  // Ends of intents are written last.
  for (const Row& row : rows) {
    if (const auto* vector = std::get_if<VectorRow>(&row)) {
      picture->places[vector->serial.value] = PlaceOf(*vector);
    } else if (const auto* intent = std::get_if<IntentRow>(&row)) {
      picture->intents[intent->serial.value] = {intent->unit.value,
                                                intent->move.value,
                                                {intent->hull[0].low, intent->hull[1].low},
                                                {intent->hull[0].high, intent->hull[1].high}};
    } else if (const auto* binding = std::get_if<BindingRow>(&row)) {
      picture->units[binding->unit.value].serial = binding->serial.value;
    } else if (const auto* enable = std::get_if<EnableRow>(&row)) {
      picture->units[enable->unit.value].enabled = enable->enabled;
    }
  }
  for (const Row& row : rows)
    if (const auto* end = std::get_if<IntentEndRow>(&row)) {
      const auto open = picture->intents.find(end->serial.value);
      if (open != picture->intents.end() && open->second.move == end->move.value)
        picture->intents.erase(open);
    }
}

void StoreJudge::Commits(std::span<const Row> rows) {
  in_flight_ = acknowledged_;
  Apply(rows, &*in_flight_);
}

void StoreJudge::Committed(std::span<const Row> rows, bool done) {
  if (!done) return;  // a later attempt, or a kill, decides
  Apply(rows, &acknowledged_);
  in_flight_.reset();
}

void StoreJudge::Compare(const StoredPicture& read) const {
  const auto same = [&](const StoredPicture& picture) {
    return read.places == picture.places && read.intents == picture.intents;
  };
  if (same(acknowledged_) || (in_flight_ && same(*in_flight_))) return;
  std::string first;
  for (const auto& [serial, place] : acknowledged_.places) {
    const auto found = read.places.find(serial);
    if (first.empty() && (found == read.places.end() || found->second != place))
      first = fmt::format("place of serial {}", serial);
  }
  for (const auto& [serial, intent] : acknowledged_.intents) {
    const auto found = read.intents.find(serial);
    if (first.empty() && (found == read.intents.end() || found->second != intent))
      first = fmt::format("intent of serial {}", serial);
  }
  for (const auto& [serial, intent] : read.intents)
    if (first.empty() && !acknowledged_.intents.contains(serial))
      first = fmt::format("an intent of serial {} that nobody acknowledged", serial);
  broken_("durable", "the store differs from what it acknowledged: " +
                         (first.empty() ? std::string("a row more") : first));
}

void StoreJudge::LifeBegins() {
  std::string why;
  read_ = reader_.Read(disk_->Written(), &why);
  if (read_) return Compare(*read_);
  // Before the first commit there may be no tables yet.
  if (!acknowledged_.units.empty() || !acknowledged_.places.empty())
    broken_("durable", "the store cannot be read after a kill: " + why);
}

void StoreJudge::LifeHasBegun() {
  if (!read_) return;
  acknowledged_ = *std::exchange(read_, std::nullopt);
  in_flight_.reset();
}

const StoredPicture* StoreJudge::Durable() {
  if (durable_syncs_ != disk_->syncs()) {
    std::string why;
    durable_ = reader_.Read(disk_->Synced(), &why);
    durable_syncs_ = disk_->syncs();
    if (!durable_) broken_("durable", "a power cut now would leave no store: " + why);
  }
  return durable_ ? &*durable_ : nullptr;
}

std::size_t StoreJudge::IntentsOpen() const {
  return static_cast<std::size_t>(std::ranges::count_if(
      acknowledged_.units,
      [this](const auto& unit) { return acknowledged_.intents.contains(unit.second.serial); }));
}

}  // namespace focalfleet::soak
