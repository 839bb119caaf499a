#include "daemon/soak/store_judge.h"

#include <algorithm>
#include <utility>

namespace focalfleet::soak {

void StoreJudge::Commits(std::span<const Row> rows) { in_flight_.assign(rows.begin(), rows.end()); }

void StoreJudge::Committed(std::span<const Row> rows, bool done) {
  if (!done) return;  // a later attempt, or a kill, decides
  Enter(rows, extent_, &acknowledged_);
  in_flight_.clear();
}

void StoreJudge::Compare(const StoredPicture& read) const {
  const std::string first = FirstDifference(acknowledged_, read);
  if (first.empty()) return;
  StoredPicture with_batch = acknowledged_;
  Enter(in_flight_, extent_, &with_batch);
  if (FirstDifference(with_batch, read).empty()) return;
  broken_("durable", "the store differs from what it acknowledged: " + first);
}

void StoreJudge::LifeBegins() {
  std::string why;
  read_ = reader_.Read(disk_->Written(), extent_, &why);
  if (read_) return Compare(*read_);
  // Before the first commit there may be no tables yet.
  if (!acknowledged_.units.empty() || !acknowledged_.places.empty())
    broken_("durable", "the store cannot be read after a kill: " + why);
}

void StoreJudge::LifeHasBegun() {
  if (!read_) return;
  acknowledged_ = *std::exchange(read_, std::nullopt);
  in_flight_.clear();
}

const StoredPicture* StoreJudge::Durable() {
  if (durable_syncs_ != disk_->syncs()) {
    std::string why;
    durable_ = reader_.Read(disk_->Synced(), Extent::kMotion, &why);
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
