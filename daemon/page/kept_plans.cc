#include "daemon/page/kept_plans.h"

#include <utility>

namespace focalfleet {

void KeptPlans::PutPreview(std::uint64_t plan, std::string motion) {
  auto kept =
      motion.size() > bytes_max_ ? nullptr : std::make_shared<const std::string>(std::move(motion));
  const std::lock_guard lock(mutex_);
  preview_plan_ = plan;
  preview_ = std::move(kept);
}

void KeptPlans::Put(std::uint64_t configuration, std::string motion) {
  if (motion.size() > bytes_max_) return;
  auto kept = std::make_shared<const std::string>(std::move(motion));
  const std::lock_guard lock(mutex_);
  bytes_ += kept->size();
  plans_.push_back({configuration, std::move(kept)});
  while (bytes_ > bytes_max_) {
    bytes_ -= plans_.front().motion->size();
    plans_.pop_front();
  }
}

KeptPlans::Motion KeptPlans::Preview(std::uint64_t plan) const {
  const std::lock_guard lock(mutex_);
  return plan == preview_plan_ ? preview_ : nullptr;
}

std::vector<KeptPlans::Motion> KeptPlans::Of(std::uint64_t configuration) const {
  const std::lock_guard lock(mutex_);
  std::vector<Motion> found;
  for (const Kept& kept : plans_)
    if (kept.configuration == configuration) found.push_back(kept.motion);
  return found;
}

}  // namespace focalfleet
